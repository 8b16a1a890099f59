//! A diagnosis of a real servo, where its public logs are there: `BTR_DATA`, or `shared/data` beside the workspace.

use crate::lab::{Lab, robots};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Logs of a Dynamixel XL330 at a position gain.
fn logs(data: &Path, gain: u32) -> String {
    let moves = ["sin_sin", "lift_and_drop", "up_and_down", "sin_time_square"];
    let log = |name: &str| data.join(format!("episodes/xl330_{name}_kp{gain}.csv")).display().to_string();
    moves.map(log).join(" ")
}

/// The library explains most of this servo's error, but far from all of it: nothing is certain then, and no law stands
/// on its head.
#[test]
fn nothing_is_certain_of_a_servo_whose_error_stays() {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let data = std::env::var_os("BTR_DATA").map_or_else(beside, PathBuf::from).join("bam_xl330_pendulum");
    if !data.is_dir() {
        println!("skipped: data not there ({})", data.display());
        return;
    }
    let (model, index) = (robots().join("xl330_model.toml"), data.join("index.csv"));
    let diagnose = format!("diagnose {} --set logs.index=\"{}\" --max-effects 2", model.display(), index.display());
    let logs = format!("{} --held-out {}", logs(&data, 100), logs(&data, 200));
    let answer = Lab::new().json(&format!("{diagnose} {logs} -q"));
    assert!(["unexplained", "partly_explained"].contains(&answer["verdict"].as_str().unwrap()), "{answer}");
    let held_out: Vec<f64> =
        answer["error_ladder"].as_array().unwrap().iter().map(|step| number(&step["held_out"])).collect();
    assert!(held_out[held_out.len() - 1] < 0.6 * held_out[1], "{held_out:?}");
    let found = answer["effects"].as_array().unwrap();
    assert!(!found.is_empty() && found.iter().all(|effect| number(&effect["probability"]) <= 0.95), "{answer}");
    for parameters in found.iter().map(|effect| effect["parameters"].as_array().unwrap()) {
        let value = |name: &str| {
            let is = |parameter: &&Value| parameter["name"].as_str().unwrap().contains(name);
            parameters.iter().find(is).map(|parameter| number(&parameter["value"]))
        };
        if let (Some(coulomb), Some(resting)) = (value("stribeck_friction.coulomb"), value("stribeck_friction.static"))
        {
            assert!(resting >= coulomb, "{answer}");
        }
        assert!(parameters.iter().all(|parameter| parameter["ci95"].is_null()), "{answer}");
    }
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}
