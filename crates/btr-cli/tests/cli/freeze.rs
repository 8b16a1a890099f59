//! `--freeze`: free parameters that stay as the model has them.

use crate::lab::Lab;
use serde_json::{Value, json};

/// A pendulum whose mass and friction are free.
pub(crate) const MODEL: &str = r#"name = "swing"

[robot]
builtin = "pendulum"
length_m = 0.5

[actuators.hinge]
kind = "torque"

[simulation]
control_s = 0.01
duration_s = 4.0

[noise]
position_rad = 0.001

[parameters]
"mass@bob" = { bounds = [0.5, 2.0], value = 1.0 }
"viscous_friction.coefficient@hinge" = { bounds = [0.0, 1.0], value = 0.1 }

[drive]
kind = "sine"
omega_rad_s = 5.0
set = { "amplitude@hinge" = 0.8 }
"#;

const FRICTION: &str = "viscous_friction.coefficient@hinge";

/// The model, and logs of pendulums whose mass and friction are others.
fn lab() -> Lab {
    let lab = Lab::new();
    lab.write("swing.toml", MODEL);
    planted(&lab, "swing.toml", "log.csv", 1, 1.3, 0.3);
    lab
}

/// Writes the log of a pendulum with this mass and friction, and noise of this seed.
pub(crate) fn planted(lab: &Lab, model: &str, log: &str, seed: u64, mass: f64, friction: f64) {
    let set = format!("--set parameters.mass@bob.value={mass} --set parameters.\"{FRICTION}\".value={friction}");
    lab.ok(&format!("simulate {model} -q --seed {seed} {set} -o {log}"));
}

/// The estimate of a parameter, if it was fitted.
pub(crate) fn estimate<'a>(fitted: &'a Value, name: &str) -> Option<&'a Value> {
    fitted["parameters"].as_array().unwrap().iter().find(|p| p["name"] == name)
}

#[test]
fn a_frozen_parameter_keeps_its_value_and_the_others_are_recovered_beside_it() {
    let lab = lab();
    let right = MODEL.replace("value = 1.0 }", "value = 1.30 }");
    lab.write("right.toml", &right);
    let fitted = lab.json("fit right.toml log.csv --freeze mass@* -o fitted.toml");
    assert_eq!((&fitted["frozen"], estimate(&fitted, "mass@bob")), (&json!(["mass@bob"]), None));
    let friction = estimate(&fitted, FRICTION).unwrap()["value"].as_f64().unwrap();
    assert!((friction - 0.3).abs() < 0.01, "{fitted}");
    let line = right.lines().find(|line| line.contains("mass@bob")).unwrap();
    assert!(lab.read("fitted.toml").contains(line), "a frozen parameter stays as it is written");
    let told = lab.ok("fit right.toml log.csv --freeze mass@bob");
    assert!(told.contains("frozen at the model's values: mass@bob"), "{told}");
    // Frozen at a wrong value, it leaves an error that the friction cannot explain.
    let wrong = lab.json("fit swing.toml log.csv --freeze mass@bob");
    assert!(wrong["train"].as_f64().unwrap() > 2.0 * fitted["train"].as_f64().unwrap(), "{wrong}");
    assert_eq!(lab.json("fit swing.toml log.csv")["frozen"], Value::Null, "without --freeze nothing is said");
}

#[test]
fn a_pattern_that_freezes_nothing_is_an_error_and_so_is_a_fit_of_nothing() {
    let lab = lab();
    let near = lab.complaint("fit swing.toml log.csv --freeze mas@bob");
    assert!(
        near.contains("`mas@bob` matches no free parameter") && near.contains("did you mean `mass@bob`?"),
        "{near}"
    );
    let none = lab.complaint("diagnose swing.toml log.csv --freeze mass@* --freeze coulomb*");
    assert!(none.contains("`coulomb*` matches no free parameter") && none.contains(FRICTION), "{none}");
    let all = lab.complaint("fit swing.toml log.csv --freeze *");
    assert!(all.contains("all free parameters are frozen") && all.contains("--add an effect"), "{all}");
    // An added effect stays free, whatever the pattern.
    let added = lab.json("fit swing.toml log.csv --add armature@hinge --freeze *");
    assert_eq!(added["frozen"], json!(["mass@bob", FRICTION]));
    assert_eq!(added["parameters"].as_array().unwrap().len(), 1, "{added}");
}

#[test]
fn a_diagnosis_takes_frozen_values_as_they_are() {
    let lab = lab();
    let frozen = lab.json("diagnose swing.toml log.csv --freeze * -o found.toml --max-rollouts 200");
    assert_eq!(frozen["frozen"], json!(["mass@bob", FRICTION]));
    let steps = frozen["error_ladder"].as_array().unwrap();
    assert!(steps.iter().all(|step| step["step"] != "its parameters fitted"), "{frozen}");
    let found = lab.read("found.toml");
    assert!(found.contains("value = 1.0") && found.contains("value = 0.1"), "{found}");
    assert_eq!(lab.json("diagnose swing.toml log.csv")["verdict"], "nothing_missing", "the free parameters explain it");
    assert_ne!(frozen["verdict"], "nothing_missing", "{frozen}");
}
