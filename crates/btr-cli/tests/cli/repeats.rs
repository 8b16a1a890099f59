//! Runs of the same command: a robot that does not repeat itself limits what a model can explain.

use crate::lab::{Lab, noise};
use serde_json::Value;
use std::fmt::Write;

const MODEL: &str = r#"name = "swing"

[robot]
builtin = "pendulum"
length_m = 0.5

[actuators.hinge]
kind = "position"
kp = 10.0
kd = 0.3

[simulation]
control_s = 0.01
steps_per_control = 4
sample_every = 4
"#;

const SAMPLES: u32 = 500;
/// Standard deviation of the encoder, in rad.
const ENCODER_RAD: f64 = 0.0004;
/// That of a disturbance which wanders within a run, and its memory in samples.
const WANDER_RAD: f64 = 0.002;
const MEMORY: f64 = 10.0;
/// The friction that the model lacks, in N·m.
const FRICTION: f64 = 0.2;

/// The command of a name, in rad.
fn command(name: &str, t: f64) -> f64 {
    let phase = f64::from(name.bytes().next().unwrap_or(0));
    (t / 0.4).min(1.0) * (0.5 * (2.3 * t + phase).sin() + 0.3 * (5.1 * t + 2.0 * phase).sin() - 0.2)
}

/// Logs of commands, each given as often as stated: `a0.csv`, `a1.csv`, ... Reality has dry friction, and in each run
/// `offset_rad` times a number of its own.
fn lab(commands: &[(&str, u32)], offset_rad: f64) -> Lab {
    let lab = Lab::new();
    lab.write("swing.toml", MODEL);
    let hidden = format!("\n[[effects]]\neffect = \"coulomb_friction\"\nsite = \"hinge\"\ntorque = {FRICTION}\n");
    lab.write("reality.toml", &format!("{MODEL}{hidden}"));
    for (k, (name, runs)) in commands.iter().enumerate() {
        let mut told = "t,cmd_hinge,q_hinge\n".to_owned();
        for t in (0..SAMPLES).map(|i| 0.01 * f64::from(i)) {
            writeln!(told, "{t},{},0", command(name, t)).unwrap();
        }
        lab.write("told.csv", &told);
        lab.ok("simulate reality.toml --log told.csv -q --overwrite -o true.csv");
        let header = lab.read("true.csv").lines().next().unwrap().to_owned();
        let column = header.split(',').position(|name| name == "q_hinge").unwrap();
        let truth: Vec<f64> = lab
            .read("true.csv")
            .lines()
            .skip(1)
            .map(|line| line.split(',').nth(column).unwrap().parse().unwrap())
            .collect();
        for run in 0..*runs {
            let salt = f64::from(run) + 31.0 * k as f64;
            let offset = offset_rad * noise(run + 1000, salt);
            let (keep, mut state) = ((-1.0 / MEMORY).exp(), WANDER_RAD * noise(0, salt + 0.5));
            let mut log = "t,cmd_hinge,q_hinge\n".to_owned();
            for (i, truth) in (0..SAMPLES).zip(&truth) {
                let t = 0.01 * f64::from(i);
                state = keep * state + WANDER_RAD * (1.0 - keep * keep).sqrt() * noise(i, salt + 0.25);
                let q = truth + offset + state + ENCODER_RAD * noise(i, salt + 0.75);
                writeln!(log, "{t},{},{q}", command(name, t)).unwrap();
            }
            lab.write(&format!("{name}{run}.csv"), &log);
        }
    }
    lab
}

/// The disturbance and the encoder together.
fn planted() -> f64 {
    WANDER_RAD.hypot(ENCODER_RAD)
}

fn names(document: &Value) -> Vec<&str> {
    document["effects"].as_array().unwrap().iter().map(|effect| effect["effect"].as_str().unwrap()).collect()
}

#[test]
fn check_tells_how_far_runs_differ_and_what_to_repeat() {
    let lab = lab(&[("a", 4), ("b", 1)], 0.0);
    let document = lab.json("check swing.toml a0.csv a1.csv b0.csv a2.csv a3.csv");
    let found = &document["repeatability"];
    assert_eq!(found["runs"], serde_json::json!([["a0", "a1", "a2", "a3"]]));
    let channel = &found["channels"][0];
    let ratio = channel["repeatability"].as_f64().unwrap() / planted();
    assert!((0.8..1.25).contains(&ratio), "{channel}");
    // A part of the disturbance is new in every sample, as noise is.
    let floor = channel["noise_floor"].as_f64().unwrap() / ENCODER_RAD;
    assert!((0.9..2.0).contains(&floor), "{channel}");
    assert!(found["outliers"].as_array().unwrap().is_empty());
    let alone = lab.json("check swing.toml a0.csv b0.csv");
    let advice = alone["repeatability"]["advice"].as_str().unwrap();
    assert!(advice.contains("record 4 runs of "), "{advice}");
}

#[test]
fn what_runs_differ_by_is_explained_and_no_more_is_asked() {
    let lab = lab(&[("a", 4), ("b", 4), ("c", 2)], 0.0);
    let logs = "a0.csv a1.csv a2.csv a3.csv b0.csv b1.csv b2.csv b3.csv --held-out c0.csv c1.csv";
    let document = lab.json(&format!("diagnose swing.toml {logs} -q"));
    let said = (document["verdict"].as_str().unwrap(), document["degree"].as_str().unwrap());
    assert_eq!(said, ("effect_missing", "explained_to_repeatability"), "{document}");
    assert_eq!(names(&document), ["coulomb_friction"], "{document}");
    let [low, high] = [0, 1].map(|k| document["effects"][0]["parameters"][0]["ci95"][k].as_f64().unwrap());
    assert!(low < FRICTION && FRICTION < high && high - low < 0.1 * FRICTION, "{low} {high}");
    let left = &document["remaining"][0];
    assert!(left["x_noise_floor"].as_f64().unwrap() > 3.0, "{left}");
    assert!((0.7..1.3).contains(&left["x_repeatability"].as_f64().unwrap()), "{left}");
    let text = lab.ok(&format!("diagnose swing.toml {logs} -q"));
    for word in ["no more than runs of the same command differ by", "error (x repeatability)"] {
        assert!(text.contains(word), "{text}");
    }
    lab.ok(&format!("diagnose swing.toml {logs} -q --report why.html"));
    assert!(lab.read("why.html").contains("no more than runs of the same command differ by."));
    // The same friction without runs that could show it: the error has structure far above the encoder's noise.
    let alone = lab.json("diagnose swing.toml a0.csv b0.csv --held-out c0.csv -q");
    assert!(["unexplained", "partly_explained"].contains(&alone["degree"].as_str().unwrap()), "{alone}");
    // What the user knows of the robot is as good as runs.
    let stated = "diagnose swing.toml a0.csv b0.csv --held-out c0.csv -q --set noise.model_rad=0.002";
    assert_eq!(lab.json(stated)["degree"], "explained_to_repeatability");
}

#[test]
fn the_true_model_lacks_nothing_whatever_its_runs_differ_by() {
    for offset_rad in [0.0, 0.01] {
        let lab = lab(&[("a", 4), ("b", 4)], offset_rad);
        let logs = "a0.csv a1.csv a2.csv b0.csv b1.csv b2.csv --held-out a3.csv b3.csv";
        let document = lab.json(&format!("diagnose reality.toml {logs} -q"));
        assert_eq!(document["verdict"], "nothing_missing", "{offset_rad}: {document}");
        assert_eq!(document["degree"], "explained_to_repeatability", "{document}");
        let offset = &document["noise_floor"][0]["run_offset"];
        match offset_rad > 0.0 {
            true => assert!((0.004..0.02).contains(&offset.as_f64().unwrap()), "{offset}"),
            false => assert!(offset.is_null(), "{offset}"),
        }
    }
}

#[test]
fn the_index_says_which_logs_are_runs_of_one_command() {
    let lab = lab(&[("a", 2), ("b", 2)], 0.0);
    let index = "file,motion\na0.csv,one\na1.csv,two\nb0.csv,\nb1.csv,three\n";
    lab.write("index.csv", index);
    let model = |column: &str| format!("{MODEL}\n[logs]\nindex = \"index.csv\"\nrepeats = \"{column}\"\n");
    lab.write("told.toml", &model("motion"));
    let runs = |logs: &str| lab.json(&format!("check told.toml {logs}"))["repeatability"]["runs"].clone();
    assert_eq!(runs("a0.csv a1.csv b0.csv b1.csv"), serde_json::json!([]));
    lab.write("index.csv", &index.replace("two", "one"));
    assert_eq!(runs("a0.csv a1.csv b0.csv b1.csv"), serde_json::json!([["a0", "a1"]]));
    lab.write("told.toml", &model("movement"));
    let error = lab.complaint("check told.toml a0.csv a1.csv");
    assert!(error.contains("the index has no column `movement`") && error.contains("motion"), "{error}");
}

#[test]
fn a_run_out_of_line_is_named() {
    let lab = lab(&[("a", 5)], 0.0);
    lab.edit("a3.csv", "a3.csv", |row, cells| {
        if let Ok(q) = cells[2].parse::<f64>()
            && row > 100
        {
            cells[2] = (q + 0.03 * (0.2 * row as f64).sin()).to_string();
        }
        true
    });
    let document = lab.json("check swing.toml a0.csv a1.csv a2.csv a3.csv a4.csv");
    assert_eq!(document["repeatability"]["outliers"][0]["log"], "a3", "{}", document["repeatability"]);
}
