//! `btr check`: which numbers a log tells, and which it tells together only.

use crate::lab::Lab;
use serde_json::Value;

/// A pendulum on a servo without its gravity known apart: mass, gain and damping together are only a scale.
const MODEL: &str = r#"name = "scale"

[robot]
builtin = "pendulum"
length_m = 0.5

[actuators.hinge]
kind = "position"
kp = 10.0
kd = 0.5

[simulation]
control_s = 0.01
duration_s = 3.0

[noise]
position_rad = 0.0005

[parameters]
"mass@bob" = { relative = [0.5, 2.0] }
"kp@hinge" = { relative = [0.8, 1.25] }
"kd@hinge" = { relative = [0.8, 1.25] }
"max_torque@hinge" = { bounds = [500.0, 2000.0], value = 1000.0 }

[drive]
kind = "sine"
omega_rad_s = 6.0
set = { "amplitude@hinge" = 0.5 }
"#;

fn lab() -> Lab {
    let lab = Lab::new();
    lab.write("scale.toml", MODEL);
    lab.ok("simulate scale.toml -q -o bare.csv");
    lab
}

fn parameter<'a>(document: &'a Value, name: &str) -> &'a Value {
    document["parameters"].as_array().unwrap().iter().find(|p| p["name"] == name).unwrap()
}

#[test]
fn what_is_only_a_scale_is_named_and_what_does_nothing_is_dead() {
    let lab = lab();
    let document = lab.json("check scale.toml bare.csv");
    assert_eq!(
        (&document["rank"], &document["dead"]),
        (&2.into(), &serde_json::json!(["max_torque@hinge"])),
        "{document}"
    );
    let sentences: Vec<&str> =
        document["null_directions"].as_array().unwrap().iter().map(|d| d["sentence"].as_str().unwrap()).collect();
    assert_eq!(sentences.len(), 2);
    assert!(sentences[0].starts_with("max_torque@hinge is dead"), "{sentences:?}");
    let factor = "a common factor of mass@bob, kp@hinge and kd@hinge changes nothing in these logs";
    assert!(sentences[1].starts_with(factor) && sentences[1].contains("a payload of known mass"), "{sentences:?}");
    assert!(parameter(&document, "mass@bob")["sensitivity"].as_f64().unwrap() > 1.0);
    assert!(parameter(&document, "max_torque@hinge")["uncertainty_left"].as_f64().unwrap() > 0.99);
    let told = lab.ok("check scale.toml bare.csv");
    assert!(told.contains("rank 2 of 4") && told.contains(sentences[1]), "{told}");
    assert!(told.contains("a rank below full is not a defect of the logs"), "{told}");
}

#[test]
fn friction_that_may_be_of_any_size_is_part_of_the_scale() {
    let lab = lab();
    lab.write(
        "rubs.toml",
        &format!("{MODEL}\n[[effects]]\neffect = \"coulomb_friction\"\nsite = \"hinge\"\ntorque = 0.3\n"),
    );
    lab.ok("simulate rubs.toml -q -o rubs.csv");
    let told = lab.ok("fit scale.toml rubs.csv --add coulomb_friction@hinge");
    let factor = "a common factor of mass@bob, kp@hinge, kd@hinge and coulomb_friction.torque@hinge changes nothing";
    assert!(told.contains(factor), "{told}");
}

#[test]
fn a_payload_of_known_mass_separates_them() {
    let lab = lab();
    lab.write("scale.toml", &format!("{MODEL}\n[logs]\nindex = \"index.csv\"\ncolumns = {{ \"payload.mass@bob\" = {{ column = \"payload\" }} }}\n"));
    lab.write("index.csv", "file,payload\nbare.csv,0\nloaded.csv,0.5\n");
    let loaded = MODEL.replace("[drive]", "[[effects]]\neffect = \"payload\"\nsite = \"bob\"\nmass = 0.5\n\n[drive]");
    lab.write("loaded.toml", &loaded);
    lab.ok("simulate loaded.toml -q -o loaded.csv");
    let document = lab.json("check scale.toml bare.csv loaded.csv");
    assert_eq!(
        (&document["rank"], document["null_directions"].as_array().unwrap().len()),
        (&3.into(), 1),
        "{document}"
    );
    assert!(parameter(&document, "mass@bob")["uncertainty_left"].as_f64().unwrap() < 0.1, "{document}");
}

#[test]
fn without_anything_in_doubt_the_logs_are_judged_all_the_same() {
    let lab = lab();
    let (before, after) = (MODEL.find("[parameters]").unwrap(), MODEL.find("[drive]").unwrap());
    lab.write("sure.toml", &format!("{}{}", &MODEL[..before], &MODEL[after..]));
    let document = lab.json("check sure.toml bare.csv");
    assert!(document["not_judged"].as_str().unwrap().contains("free parameters"), "{document}");
    assert_eq!(document["logs"][0]["verdict"], "fine");
}
