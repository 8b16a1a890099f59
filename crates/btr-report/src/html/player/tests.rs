#![allow(clippy::unwrap_used)]

use super::*;
use btr_core::log::{Log, Role};
use btr_identify::compare::{LogPair, compare};
use btr_lab::experiment::Source;
use btr_lab::verbs::VerbInput;
use serde_json::Value;
use std::path::{Path, PathBuf};

fn robot(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots").join(name)
}

/// A log of these joints of the arm, with a sample per position.
fn log(clock_s: &[f64], joints: &[(&str, &[f64])]) -> Log {
    let mut log = Log::new(clock_s.to_vec()).unwrap();
    for (joint, q) in joints {
        log.insert(format!("q_{joint}"), "rad", Role::Measured, q.to_vec()).unwrap();
    }
    log
}

/// What the player of the arm has of these logs and their simulations, with a noise floor of 0.01 rad.
fn motion(names: &[&str], logs: &[Log], simulated: &[Log]) -> Option<Value> {
    let source = Source::read(&robot("arm.toml")).unwrap();
    let input = VerbInput::new(source, &[robot("arm/learn_1.csv")], &[]).unwrap();
    let pairs = names.iter().zip(logs).zip(simulated);
    let pairs: Vec<LogPair> = pairs.map(|((name, real), simulated)| LogPair { name, real, simulated }).collect();
    let comparison = compare(&pairs, |_, _, _| Some(0.01));
    let state = ReplayedState { name: AS_IT_STANDS.to_owned(), error: Some(2.5), comparison: &comparison, simulated };
    let model = input.problem.model();
    let player =
        Player::of(&Replayed { model, names, logs, states: vec![state], errors_are: None, in_windows: false })?;
    assert!(!player.document.contains(['<', '>', '&']), "{}", player.document);
    Some(serde_json::from_str(&player.document).unwrap())
}

#[test]
fn the_document_has_frames_of_20_ms_with_the_largest_errors_between_them() {
    let clock_s = [0.0, 0.01, 0.02, 0.03, 0.1];
    let yaw: &[f64] = &[0.0, 0.1, f64::NAN, 0.123456789, 0.2];
    let real = log(&clock_s, &[("yaw", yaw), ("shoulder", &[0.5; 5])]);
    let simulated = log(&clock_s, &[("yaw", &[0.0; 5]), ("shoulder", &[0.5; 5]), ("elbow", &[-1.0; 5])]);
    let name = "</script><script>alert(1)</script>&";
    let motion = motion(&[name], &[real], &[simulated]).unwrap();
    // A name is data, whatever it looks like.
    assert_eq!(motion["logs"][0]["name"], name);
    insta::assert_snapshot!(serde_json::to_string_pretty(&short(motion)).unwrap());
}

/// The document with each list of numbers in a line.
fn short(document: Value) -> Value {
    match document {
        Value::Array(items) if items.iter().all(|item| item.is_number() || item.is_null()) => {
            Value::String(Value::Array(items).to_string())
        }
        Value::Array(items) => items.into_iter().map(short).collect(),
        Value::Object(fields) => fields.into_iter().map(|(name, value)| (name, short(value))).collect(),
        other => other,
    }
}

#[test]
fn many_long_logs_are_thinned_and_the_worst_are_kept() {
    let clock_s: Vec<f64> = (0..60_000).map(|k| f64::from(k) * 0.01).collect();
    let still = |q: f64| log(&clock_s, &[("yaw", &vec![q; clock_s.len()])]);
    let names = ["a", "b", "c", "d", "e", "f", "g", "h", "i", "j"];
    let logs: Vec<Log> = (0..10).map(|k| still(if k == 4 { 0.0 } else { 0.1 * f64::from(k + 1) })).collect();
    let motion = motion(&names, &logs, &vec![still(0.0); 10]).unwrap();
    let played = motion["logs"].as_array().unwrap();
    let names: Vec<&Value> = played.iter().map(|log| &log["name"]).collect();
    assert_eq!(names, ["b", "c", "d", "f", "g", "h", "i", "j"]);
    assert!(motion.to_string().len() < 2_500_000, "{}", motion.to_string().len());
    let time_s = played[0]["time_s"].as_array().unwrap();
    assert!(time_s.len() > 1000 && time_s.last().unwrap() == 599.99, "{}", time_s.len());
    assert_eq!(motion["notes"][1], "The 8 logs with the largest errors are played, of 10.");
}

#[test]
fn logs_without_motion_have_no_player() {
    assert_eq!(motion(&["one"], &[log(&[0.0], &[("yaw", &[0.0])])], &[log(&[0.0], &[("yaw", &[0.0])])]), None);
}

#[test]
fn the_policy_allows_the_script_of_the_page_and_no_other() {
    let player = Player { document: "{}".to_owned() };
    let html = player.html();
    let script = html.split("<script>").nth(1).unwrap().split("</script>").next().unwrap();
    assert_eq!(script, SCRIPT);
    assert_eq!(Player::script_source(), format!("'sha256-{}'", STANDARD.encode(Sha256::digest(script))));
}
