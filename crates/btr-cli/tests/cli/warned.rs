//! What is said of a model beside the logs: noise that it states too low, and torques that stand at its limit.

use crate::compare::{NONE, lab};
use crate::lab::Lab;

/// Lets a copy of the lab's model state another noise, and says its name.
fn noise(lab: &Lab, stated: &str) -> &'static str {
    let both = "position_rad = 0.0005\nposition_quantum_rad = 0.0015\n";
    let text = lab.read("swing.toml");
    assert!(text.contains(both));
    lab.write("noise.toml", &text.replace(both, stated));
    "noise.toml"
}

#[test]
fn half_of_the_noise_is_completed_from_the_log() {
    let lab = lab(NONE);
    for stated in ["position_rad = 0.0005\n", "position_quantum_rad = 0.0015\n", ""] {
        let model = noise(&lab, stated);
        let found = lab.json(&format!("compare {model} log.csv"));
        let floor = found["channels"][0]["noise_floor"].as_f64().unwrap();
        assert!((floor / 0.000_661 - 1.0).abs() < 0.12, "{stated}: {floor}");
        assert_eq!(found["warnings"], serde_json::json!([]), "{stated}");
        assert_eq!(lab.json(&format!("diagnose {model} log.csv"))["verdict"], "nothing_missing", "{stated}");
    }
}

#[test]
fn noise_that_is_stated_far_too_low_is_told_with_the_factor_and_the_remedy() {
    let lab = lab(NONE);
    let model = noise(&lab, "position_rad = 0.0001\nposition_quantum_rad = 0.0001\n");
    for verb in ["check", "compare"] {
        let warnings = lab.json(&format!("{verb} {model} log.csv"))["warnings"].to_string();
        assert!(warnings.contains("[noise] states 1.0e-4 rad for q_hinge"), "{warnings}");
        assert!(warnings.contains("5.9 times as much") && warnings.contains("set position_rad = 6.1e-4"), "{warnings}");
    }
    // What the model cannot predict counts.
    let model = noise(&lab, "position_rad = 0.0001\nposition_quantum_rad = 0.0001\nmodel_rad = 0.001\n");
    assert_eq!(lab.json(&format!("compare {model} log.csv"))["warnings"], serde_json::json!([]));
}

#[test]
fn a_model_at_its_limit_is_told_with_the_setting() {
    let lab = lab(NONE);
    let swing = lab.read("swing.toml");
    lab.write("weak.toml", &swing.replace("kd = 4.0", "kd = 4.0\nmax_torque = 2.0"));
    let limited = |torque: f64| format!("{swing}[[effects]]\neffect = \"torque_limit\"\ntorque = {torque}\n");
    lab.write("limited.toml", &limited(1.5));
    lab.write("free.toml", &limited(50.0));
    for (model, limit, setting) in [
        ("weak.toml", "2 N·m", "raise max_torque of hinge in [actuators]"),
        ("limited.toml", "1.5 N·m", "raise torque of the effect torque_limit@hinge"),
    ] {
        for verb in ["check", "compare"] {
            let warnings = lab.json(&format!("{verb} {model} log.csv"))["warnings"].to_string();
            assert!(warnings.contains(&format!("hinge: the model is at its limit of {limit} for ")), "{warnings}");
            assert!(warnings.contains(" % of log: ") && warnings.contains(setting), "{warnings}");
        }
    }
    for model in ["free.toml", "swing.toml"] {
        assert_eq!(lab.json(&format!("compare {model} log.csv"))["warnings"], serde_json::json!([]), "{model}");
    }
}
