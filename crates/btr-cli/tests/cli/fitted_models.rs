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

#[test]
fn a_model_that_people_wrote_is_not_replaced() {
    let lab = lab(GAINS);
    let by_hand = format!("# My arm.\n{}", lab.read("arm.toml"));
    lab.write("mine.toml", &by_hand);
    for verb in ["fit", "diagnose"] {
        let told = lab.complaint(&format!("{verb} arm.toml log.csv -q -o mine.toml"));
        assert!(told.contains("mine.toml exists and was not written by btr"), "{told}");
        assert!(told.contains("help: give the output another name"), "{told}");
        assert_eq!(lab.read("mine.toml"), by_hand);
        // Its own output is replaced.
        let output = format!("{verb} arm.toml log.csv -q -o {verb}.toml");
        lab.ok(&output);
        assert_eq!(lab.read(&format!("{verb}.toml")).matches("# Written by btr").count(), 1);
        lab.ok(&output);
    }
}

#[test]
fn a_fit_says_what_the_model_stated_and_what_has_moved() {
    let lab = lab(GAINS);
    let said = lab.ok("fit arm.toml log.csv -q");
    assert!(said.starts_with("step "), "{said}");
    let row = |name: &str| {
        let row = said.lines().find(|line| line.starts_with(name)).unwrap_or_else(|| panic!("{said}"));
        row.split_whitespace().map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!((row("kp@hip")[1].as_str(), row("kp@hip").last().unwrap().as_str()), ("20.00", "yes"), "{said}");
    assert!(said.contains("moved: the value in the model lies outside the 95 % interval"), "{said}");
    // What is in the model already has not moved, and two numbers are not many.
    lab.ok("fit arm.toml log.csv -q -o fitted.toml");
    let again = lab.ok("fit fitted.toml log.csv -q");
    assert!(!again.contains("yes") && !again.contains("by noise alone"), "{again}");
    let stated = &lab.json("fit arm.toml log.csv -q")["in_model"];
    assert_eq!(stated, &serde_json::json!({ "kp@hip": 20.0, "kp@knee": 10.0 }));
}
