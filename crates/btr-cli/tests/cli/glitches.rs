//! Readings that a failing sensor or bus has spoilt: named, left out, and without influence on what is found.

use crate::lab::{Lab, robots};
use serde_json::{Value, json};

const TRAINING: [&str; 4] = ["learn_1.csv", "learn_2.csv", "learn_3.csv", "learn_4.csv"];
const HELD_OUT: [&str; 3] = ["held_out_1.csv", "held_out_2.csv", "held_out_3.csv"];
/// Columns of yaw, shoulder and elbow.
const POSITIONS: [usize; 3] = [4, 5, 6];
/// Row 0 is the header.
const SPIKES: [usize; 3] = [41, 163, 302];
const WRAPPED: std::ops::Range<usize> = 220..222;
const ZERO: std::ops::Range<usize> = 91..93;
const LOST: std::ops::Range<usize> = 141..144;

/// The shipped arm with its logs; every fiftieth reading of each joint is spoilt in some way.
fn lab() -> Lab {
    let lab = Lab::new();
    for file in ["arm.toml", "arm.urdf"] {
        lab.write(file, &std::fs::read_to_string(robots().join(file)).unwrap());
    }
    for (k, log) in TRAINING.into_iter().chain(HELD_OUT).enumerate() {
        lab.write(log, &std::fs::read_to_string(robots().join("arm").join(log)).unwrap());
        let elbow = POSITIONS[2];
        let before: Vec<String> =
            lab.read(log).lines().nth(LOST.start).unwrap().split(',').map(str::to_owned).collect();
        lab.edit(log, log, |row, cells| {
            let moved = row.saturating_sub(k);
            let mut spoil = |column: usize, to: &dyn Fn(f64) -> f64| {
                cells[column] = to(cells[column].parse().unwrap()).to_string();
            };
            if SPIKES.contains(&moved) {
                spoil(POSITIONS[row % 3], &|_| -2.9);
            }
            if WRAPPED.contains(&moved) {
                spoil(POSITIONS[0], &|x| x - std::f64::consts::TAU);
            }
            if ZERO.contains(&moved) {
                spoil(elbow, &|_| 0.0);
            }
            if (LOST.start + 1..=LOST.end).contains(&row) {
                POSITIONS.iter().for_each(|&column| cells[column].clone_from(&before[column]));
            }
            true
        });
    }
    lab
}

/// The verdict, and the effects with their sites.
fn answer(document: &Value) -> Value {
    let effects = document["effects"].as_array().unwrap().iter();
    json!([document["verdict"], effects.map(|effect| json!([effect["effect"], effect["site"]])).collect::<Vec<_>>()])
}

fn torque(document: &Value) -> f64 {
    document["effects"][0]["parameters"][0]["value"].as_f64().unwrap()
}

fn command(folder: &str, options: &str) -> String {
    let logs = |names: &[&str]| names.iter().map(|name| format!("{folder}{name}")).collect::<Vec<_>>().join(" ");
    format!("diagnose arm.toml {} -q --held-out {} {options}", logs(&TRAINING), logs(&HELD_OUT))
}

#[test]
fn what_is_missing_is_found_despite_glitches_and_not_with_them() {
    let lab = lab();
    let spoilt = lab.json(&command("", ""));
    let clean = lab.json(&command(&format!("{}/arm/", robots().display()), ""));
    assert_eq!(answer(&spoilt), answer(&clean), "{spoilt}");
    assert!((torque(&spoilt) / torque(&clean) - 1.0).abs() < 0.02, "{} {}", torque(&spoilt), torque(&clean));
    let doubts: Vec<&Value> = spoilt["doubts"].as_array().unwrap().iter().collect();
    assert!(doubts.iter().all(|doubt| doubt["topic"] == "glitches"), "{doubts:?}");
    let kept = lab.json(&command("", "--keep-glitches"));
    assert_ne!(answer(&kept), answer(&clean), "glitches that are kept have no influence");
}

#[test]
fn the_samples_are_named_with_what_they_look_like() {
    let lab = lab();
    let document = lab.json(&format!("check arm.toml {}", TRAINING[0]));
    let glitches = document["logs"][0]["glitches"].as_array().unwrap();
    let of = |channel: &str, kind: &str, lost: bool| {
        let found = glitches
            .iter()
            .filter(|glitch| glitch["channel"] == channel && glitch["kind"] == kind && glitch["lost_message"] == lost);
        found
            .map(|glitch| (glitch["sample"].as_u64().unwrap(), glitch["samples"].as_u64().unwrap()))
            .collect::<Vec<_>>()
    };
    // A row's sample counts from zero, without the header.
    assert_eq!(of("q_yaw", "wrap_around", false), [(219, 2)], "{glitches:?}");
    assert_eq!(of("q_elbow", "zero", false), [(90, 2)]);
    assert_eq!(of("q_shoulder", "stuck", true), [(141, 3)]);
    assert_eq!(of("q_elbow", "spike", false), [(40, 1), (301, 1)], "{glitches:?}");
    assert!(glitches.iter().all(|glitch| glitch["left_out"] == true));
    let text = lab.ok(&format!("check arm.toml {}", TRAINING[0]));
    assert!(text.contains("no motion explains") && text.contains("they are left out"), "{text}");
}

#[test]
fn rows_that_a_column_marks_as_bad_are_left_out() {
    let lab = lab();
    lab.edit(TRAINING[0], "marked.csv", |row, cells| {
        cells.push(if row == 0 { "ok".to_owned() } else { (!SPIKES.contains(&row)).to_string() });
        true
    });
    let settings = "--set channels.valid=ok --set channels.keep_glitches=true";
    let document = lab.json(&format!("check arm.toml marked.csv {settings}"));
    let glitches = document["logs"][0]["glitches"].as_array().unwrap();
    assert!(glitches.iter().all(|glitch| glitch["kind"] != "spike"), "{glitches:?}");
    assert!(!glitches.is_empty() && glitches.iter().all(|glitch| glitch["left_out"] == false));
}

/// Yaw is stuck for two samples each, which the error of a model without its friction hides.
#[test]
fn what_only_the_fitted_model_shows_is_left_out_and_told() {
    let lab = lab();
    let yaw = POSITIONS[0];
    let clean = std::fs::read_to_string(robots().join("arm").join("learn_1.csv")).unwrap();
    lab.write("spoilt.csv", &clean);
    let before = |row: usize| clean.lines().nth(row).unwrap().split(',').nth(yaw).unwrap().to_owned();
    let stuck: Vec<usize> = (20..380).step_by(31).collect();
    lab.edit("spoilt.csv", "spoilt.csv", |row, cells| {
        if let Some(sample) = stuck.iter().copied().find(|sample| (sample + 1..sample + 3).contains(&row)) {
            cells[yaw] = before(sample);
        }
        true
    });
    let arm = format!("{}/arm", robots().display());
    let ask = |options: &str| {
        lab.json(&format!(
            "diagnose arm.toml spoilt.csv {arm}/learn_2.csv -q --held-out {arm}/held_out_1.csv {options}"
        ))
    };
    let document = ask("");
    assert_eq!(answer(&document), json!(["effect_missing", [["coulomb_friction", "yaw"]]]), "{document}");
    let found = document["glitches"].as_array().unwrap().iter();
    let found: Vec<Value> = found.map(|it| json!([it["log"], it["channel"], it["sample"], it["samples"]])).collect();
    assert!(!found.is_empty(), "{document}");
    let planted: Vec<Value> = stuck.iter().map(|sample| json!(["spoilt.csv", "q_yaw", sample, 2])).collect();
    assert!(found.iter().all(|glitch| planted.contains(glitch)), "{found:?}");
    let sentence = document["doubts"].as_array().unwrap().iter().map(|doubt| doubt["sentence"].as_str().unwrap());
    assert!(sentence.into_iter().any(|text| text.contains("beside the fitted model")), "{document}");
    assert!(ask("--keep-glitches").get("glitches").is_none());
}
