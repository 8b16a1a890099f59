//! What a fitted model states, and where.

use crate::lab::Lab;
use crate::patterns::{MODEL, URDF};
use toml::{Table, Value};

/// Logs of an arm with other gains, and a model with these parameters and effects.
fn lab(parameters: &str) -> Lab {
    let lab = Lab::new();
    lab.write("arm.urdf", URDF);
    lab.write("arm.toml", &format!("{MODEL}{parameters}"));
    let real = MODEL.replace("kp = 20.0", "kp = 24.0").replace("kp = 10.0", "kp = 9.0");
    lab.write("real.toml", &format!("{real}\"kp@hip\" = {{ relative = [0.5, 2.0] }}\n"));
    lab.ok("simulate real.toml -q --seed 3 -o log.csv");
    lab
}

fn table(lab: &Lab, name: &str) -> Table {
    toml::from_str(&lab.read(name)).unwrap()
}

/// A fitted value, which must be the same in `[parameters]`.
fn both(fitted: &Table, name: &str, place: &Value) -> f64 {
    let value = fitted["parameters"][name]["value"].as_float().unwrap();
    assert_eq!(place.as_float(), Some(value), "{name}");
    value
}

const GAINS: &str = "\"kp@hip\" = { relative = [0.5, 2.0], scale = \"log\" }\n\"kp@knee\" = { bounds = [5.0, 20.0] }\n";

#[test]
fn gains_are_where_the_file_states_them() {
    let lab = lab(GAINS);
    lab.ok("fit arm.toml log.csv -q -o fitted.toml");
    let (fitted, text) = (table(&lab, "fitted.toml"), lab.read("fitted.toml"));
    let actuators = &fitted["actuators"];
    assert!((both(&fitted, "kp@hip", &actuators["hip"]["kp"]) - 24.0).abs() < 0.5, "{text}");
    assert!((both(&fitted, "kp@knee", &actuators["knee"]["kp"]) - 9.0).abs() < 0.3, "{text}");
    // The hip alone had the entry for all: its comments and its other values go along, and the bounds stay.
    assert!(
        text.contains("# The servos.\n[actuators.hip]\nkind = \"position\"\nkp = ") && !text.contains("\"*\""),
        "{text}"
    );
    assert!(text.contains("  # from the data sheet") && actuators["hip"]["kd"].as_float() == Some(0.5), "{text}");
    assert!(text.contains("\"kp@hip\" = { bounds = [10.0, 40.0], scale = \"log\", value = "), "{text}");
    // It is the same model as one without free parameters.
    lab.write("bare.toml", text.split("[parameters]").next().unwrap());
    let errors = |model: &str| lab.json(&format!("compare {model} log.csv"))["channels"].clone();
    assert_eq!(errors("fitted.toml"), errors("bare.toml"));
}

#[test]
fn joints_without_a_fitted_gain_keep_the_entry_for_all() {
    let lab = lab("\"kd@knee\" = { bounds = [0.1, 2.0] }\n");
    let shared = lab.read("arm.toml").replace("[actuators.knee]\nkind = \"position\"\nkp = 10.0\nkd = 0.4\n\n", "");
    lab.write("arm.toml", &shared);
    lab.ok("fit arm.toml log.csv -q -o fitted.toml");
    let fitted = table(&lab, "fitted.toml");
    both(&fitted, "kd@knee", &fitted["actuators"]["knee"]["kd"]);
    assert_eq!((&fitted["actuators"]["knee"]["kp"], &fitted["actuators"]["*"]["kd"]), (&20.0.into(), &0.5.into()));
}

#[test]
fn values_of_effects_are_in_their_entries() {
    let effects = "\"armature.inertia@knee\" = { bounds = [0.0, 0.5] }\n\
                   \"viscous_friction.coefficient@hip\" = { bounds = [0.0, 1.0] }\n\
                   [[effects]]\neffect = \"armature\"\ninertia = 0.02 # of the data sheet\n\
                   [[effects]]\neffect = \"viscous_friction\"\nsite = \"hip\"\ncoefficient = 0.1\n";
    let lab = lab(&format!("{GAINS}{effects}"));
    lab.ok("fit arm.toml log.csv -q -o fitted.toml");
    let fitted = table(&lab, "fitted.toml");
    let effects = fitted["effects"].as_array().unwrap();
    let sites: Vec<&str> = effects.iter().map(|effect| effect["site"].as_str().unwrap()).collect();
    assert_eq!(sites, ["hip,thumb", "knee", "hip"]);
    assert_eq!(effects[0]["inertia"].as_float(), Some(0.02));
    both(&fitted, "armature.inertia@knee", &effects[1]["inertia"]);
    both(&fitted, "viscous_friction.coefficient@hip", &effects[2]["coefficient"]);
}

#[test]
fn gains_that_were_fitted_are_no_longer_called_guesses() {
    let lab = lab(GAINS);
    lab.ok("new arm.urdf log.csv -o mine.toml");
    let guessed = lab.read("mine.toml");
    assert!(
        guessed.contains("# Guessed gains") && guessed.matches("FILL IN kp and kd: a GUESS").count() == 3,
        "{guessed}"
    );
    lab.ok("fit mine.toml log.csv -q -o fitted.toml --freeze kp@thumb --freeze kd@thumb");
    assert!(lab.read("fitted.toml").contains("# Guessed gains"), "{}", lab.read("fitted.toml"));
    lab.ok("fit mine.toml log.csv -q -o fitted.toml");
    let fitted = lab.read("fitted.toml");
    assert!(!fitted.contains("Guessed") && !fitted.contains("FILL IN kp and kd"), "{fitted}");
}

#[test]
fn an_effect_that_ends_at_nothing_is_said_to_be_removable() {
    let lab = lab(GAINS);
    let fit = "fit arm.toml log.csv -q --add quadratic_drag@hip --add backlash@knee";
    let told = lab.ok(fit);
    let document = lab.json(fit);
    let idle: Vec<&str> =
        document["without_effect"].as_array().into_iter().flatten().filter_map(|x| x.as_str()).collect();
    assert!(!idle.is_empty(), "{told}");
    assert!(
        told.contains(&format!("{} do", idle.join(", "))) && told.contains("nothing in these logs; to remove"),
        "{told}"
    );
    assert!(!lab.ok("fit arm.toml log.csv -q").contains("nothing in these logs"));
}
