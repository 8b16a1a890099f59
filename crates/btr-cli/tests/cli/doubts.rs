//! Logs that would mislead: what is held, cut, told and refused before anything is concluded from them.

use crate::lab::{Lab, noise, text};
use serde_json::Value;
use std::fmt::Write;

const MODEL: &str = r#"name = "leg"

[robot]
urdf = "leg.urdf"

[actuators."*"]
kind = "position"
kp = 15.0
kd = 0.6

[simulation]
control_s = 0.01
steps_per_control = 5
sample_every = 5

[noise]
position_rad = 0.0005

[parameters]
"kp@hip" = { relative = [0.8, 1.25] }
"kp@knee" = { relative = [0.8, 1.25] }
"#;

const URDF: &str = r#"<robot name="leg">
<link name="base"/>
<link name="thigh"><inertial><origin xyz="0 0 -0.15"/><mass value="0.8"/>
<inertia ixx="0.006" iyy="0.006" izz="0.0005" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="shank"><inertial><origin xyz="0 0 -0.12"/><mass value="0.5"/>
<inertia ixx="0.0024" iyy="0.0024" izz="0.0003" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hip" type="revolute"><parent link="base"/><child link="thigh"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="20" velocity="20"/></joint>
<joint name="knee" type="revolute"><parent link="thigh"/><child link="shank"/><origin xyz="0 0 -0.3"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="20" velocity="20"/></joint>
</robot>
"#;

/// Columns of the log.
const CMD_HIP: usize = 1;
const CMD_KNEE: usize = 2;
const Q_HIP: usize = 3;
const Q_KNEE: usize = 4;
const DQ_HIP: usize = 5;
const DQ_KNEE: usize = 6;

/// A leg that does as its model says, for four seconds at 100 Hz.
fn lab() -> Lab {
    let lab = Lab::new();
    lab.write("leg.toml", MODEL);
    lab.write("leg.urdf", URDF);
    let mut told = "t,cmd_hip,cmd_knee\n".to_owned();
    for tick in 0..=400 {
        let t = f64::from(tick) * 0.01;
        let wave = |rate: f64| 0.4 * (rate * t).sin() + 0.2 * (2.7 * rate * t).sin();
        writeln!(told, "{t},{},{}", wave(1.9), wave(2.6)).unwrap();
    }
    lab.write("told.csv", &told);
    lab.ok("simulate leg.toml -q --log told.csv -o log.csv --seed 3");
    lab
}

/// The log with one column changed by a factor.
fn scaled(lab: &Lab, name: &str, columns: &[usize], factor: f64) {
    lab.edit("log.csv", name, |k, cells| {
        for &column in columns.iter().filter(|_| k > 0) {
            cells[column] = (cells[column].parse::<f64>().unwrap() * factor).to_string();
        }
        true
    });
}

/// The log with some rows of a column empty.
fn emptied(lab: &Lab, name: &str, column: usize, rows: std::ops::Range<usize>) {
    lab.edit("log.csv", name, |k, cells| {
        if rows.contains(&k) {
            cells[column].clear();
        }
        true
    });
}

fn sentences(document: &Value) -> Vec<String> {
    let findings = document["logs"][0]["findings"].as_array().unwrap().iter();
    findings.map(|f| format!("{}: {}", f["severity"].as_str().unwrap(), f["sentence"].as_str().unwrap())).collect()
}

/// What `check` says of a log, with the exit code.
fn check(lab: &Lab, log: &str) -> (Vec<String>, i32) {
    let output = lab.run(&format!("check leg.toml {log} --json"));
    (sentences(&serde_json::from_str(&text(&output.stdout)).unwrap()), output.status.code().unwrap())
}

#[track_caller]
fn says(lab: &Lab, log: &str, code: i32, what: &str) {
    let (sentences, exit) = check(lab, log);
    assert!(sentences.iter().any(|s| s.starts_with(what)), "{log}: {what}: {sentences:?}");
    assert_eq!(exit, code, "{log}: {sentences:?}");
}

/// How far the worst joint is off.
fn chi(lab: &Lab, log: &str) -> f64 {
    let found = lab.json(&format!("compare leg.toml {log}"));
    let positions = found["channels"].as_array().unwrap().iter().filter(|c| c["unit"] == "rad");
    positions.map(|c| c["chi"].as_f64().unwrap()).fold(0.0, f64::max)
}

#[test]
fn lost_commands_are_held_and_torque_is_off_where_none_come() {
    let lab = lab();
    assert!(check(&lab, "log.csv").0.iter().all(|s| s.starts_with("fine")), "{:?}", check(&lab, "log.csv"));
    emptied(&lab, "lost.csv", CMD_HIP, 200..202);
    says(&lab, "lost.csv", 0, "fine: cmd_hip is empty 2 times, 20 ms at most: the last command is held");
    assert!(chi(&lab, "log.csv") < 2.0 && chi(&lab, "lost.csv") < 3.0, "{}", chi(&lab, "lost.csv"));
    emptied(&lab, "off.csv", CMD_HIP, 121..191);
    says(&lab, "off.csv", 0, "fine: cmd_hip is empty, which is torque off, 1.20..1.90 s");
    // The robot was driven all the while.
    assert!(chi(&lab, "off.csv") > 50.0);
    lab.edit("log.csv", "sparse.csv", |k, cells| {
        if k % 10 > 0 {
            cells[CMD_HIP].clear();
        }
        true
    });
    says(&lab, "sparse.csv", 0, "doubtful: cmd_hip is empty, which is torque off, 0.00");
}

#[test]
fn a_log_with_a_gap_is_replayed_in_pieces() {
    let lab = lab();
    // Where the leg is fast, nobody knows where it went in half a second.
    lab.edit("log.csv", "gap.csv", |k, _| !(150..200).contains(&k));
    says(&lab, "gap.csv", 0, "doubtful: 1 gap of 0.510 s at 1.480 s: the log is replayed in 2 pieces");
    assert!(chi(&lab, "gap.csv") < 2.0, "{}", chi(&lab, "gap.csv"));
    let document = lab.json("diagnose leg.toml gap.csv");
    assert_eq!((&document["verdict"], &document["doubts"][0]["topic"]), (&"nothing_missing".into(), &"gaps".into()));
    lab.edit("log.csv", "short.csv", |k, _| !(20..100).contains(&k));
    let output = lab.run("compare leg.toml short.csv");
    assert!(text(&output.stderr).contains("19 samples between gaps from 0.000 s on: too short, left out"));
    lab.edit("log.csv", "holes.csv", |k, _| k % 30 < 10);
    let complaint = lab.complaint("compare leg.toml holes.csv");
    assert!(complaint.starts_with("error: holes.csv: no 0.5 s without a gap"), "{complaint}");
}

#[test]
fn units_and_signs_that_do_not_fit_are_told_and_end_with_1() {
    let lab = lab();
    scaled(&lab, "degrees.csv", &[CMD_HIP, CMD_KNEE, Q_HIP, Q_KNEE], 1f64.to_degrees());
    says(&lab, "degrees.csv", 1, "bad: q_hip reaches");
    let told = lab.ok("fit leg.toml degrees.csv");
    assert!(told.contains("do not rely on this result: the logs have a bad finding"), "{told}");
    // From where it moves, it would have to be torn back.
    lab.edit("degrees.csv", "late.csv", |k, _| k == 0 || k > 90);
    let complaint = lab.complaint("compare leg.toml late.csv");
    let help = complaint.split("help: ").nth(1).unwrap_or_default();
    assert!(help.contains("in degrees? A column called q_hip_deg is read in degrees"), "{complaint}");
    assert!(complaint.contains("diverged at t = 0.001 s"), "{complaint}");
    scaled(&lab, "reversed.csv", &[Q_KNEE], -1.0);
    says(&lab, "reversed.csv", 1, "bad: knee moves opposite to its command");
    scaled(&lab, "speed.csv", &[DQ_KNEE], 1f64.to_degrees());
    says(&lab, "speed.csv", 1, "bad: dq_knee is 57 times the slope of q_knee: is dq_knee in degrees?");
    scaled(&lab, "against.csv", &[DQ_KNEE], -1.0);
    says(&lab, "against.csv", 1, "bad: dq_knee has the opposite sign");
    scaled(&lab, "half.csv", &[DQ_KNEE], 0.5);
    says(&lab, "half.csv", 0, "doubtful: dq_knee is 0.49 times the slope of q_knee");
    scaled(&lab, "wide.csv", &[Q_HIP], 4.5);
    says(&lab, "wide.csv", 0, "doubtful: q_hip reaches");
}

#[test]
fn late_and_strange_joints_are_doubtful() {
    let lab = lab();
    let rows: Vec<String> = lab.read("log.csv").lines().map(str::to_owned).collect();
    lab.edit("log.csv", "late.csv", |k, cells| {
        let row = rows[k.saturating_sub(15).max(1)].split(',').nth(Q_HIP).unwrap();
        if k > 0 {
            row.clone_into(&mut cells[Q_HIP]);
        }
        true
    });
    let late = check(&lab, "late.csv").0.into_iter().find(|s| s.contains("hip follows")).unwrap();
    assert!(late.starts_with("doubtful") && late.contains("late for a servo"), "{late}");
    lab.edit("log.csv", "swapped.csv", |k, cells| {
        if k > 0 {
            cells.swap(Q_HIP, Q_KNEE);
        }
        true
    });
    assert!(check(&lab, "swapped.csv").0.iter().any(|s| !s.starts_with("fine")));
}

/// The report lists as many findings as the terminal counts: without what the model explains.
#[test]
fn what_the_model_explains_is_no_doubt_in_the_report_either() {
    let lab = lab();
    lab.write("leg.toml", &MODEL.replace("kp = 15.0", "kp = 4.0").replace("kd = 0.6", "kd = 2.0"));
    lab.ok("simulate leg.toml -q --log log.csv -o told.csv");
    lab.edit("told.csv", "slow.csv", |k, cells| {
        for column in [Q_HIP, Q_KNEE].into_iter().filter(|_| k > 0) {
            let reading = cells[column].parse::<f64>().unwrap();
            cells[column] = (reading + 0.0005 * noise(k as u32, column as f64)).to_string();
        }
        true
    });
    let doubtful = |said: &str| said.matches("late for a servo").count();
    let checked = lab.ok("check leg.toml slow.csv");
    assert!(doubtful(&checked) > 0, "{checked}");
    let document = lab.json("fit leg.toml slow.csv --report report.html");
    let (left, report) = (document["doubts"].as_array().unwrap().len(), lab.read("report.html"));
    assert_eq!((left, doubtful(&report)), (0, 0), "{document}");
    assert!(!report.contains("that may affect this result"), "{document}");
}

#[test]
fn a_commanded_joint_without_an_actuator_is_told_before_a_diagnosis() {
    let lab = lab();
    lab.write("leg.toml", &MODEL.replace("\"*\"", "\"hip\"").replace("\"kp@knee\" = { relative = [0.8, 1.25] }\n", ""));
    says(&lab, "log.csv", 0, "doubtful: cmd_knee is in the log, but knee has no actuator");
    let output = lab.run("fit leg.toml log.csv");
    assert!(text(&output.stderr).starts_with("doubtful: log.csv: cmd_knee is in the log"), "{}", text(&output.stderr));
    assert!(
        text(&output.stdout).contains("the logs have 1 finding that may affect this result"),
        "{}",
        text(&output.stdout)
    );
}

#[test]
fn no_verdict_covers_a_joint_that_is_not_measured() {
    let lab = lab();
    emptied(&lab, "empty.csv", Q_KNEE, 1..1000);
    lab.edit("log.csv", "absent.csv", |_, cells| {
        cells.remove(Q_KNEE);
        true
    });
    for log in ["empty.csv", "absent.csv"] {
        let document = lab.json(&format!("diagnose leg.toml {log}"));
        assert_eq!(
            (&document["verdict"], &document["not_judged"]),
            (&"nothing_missing".into(), &serde_json::json!(["knee"]))
        );
        assert!(!document["doubts"].as_array().unwrap().is_empty(), "{document}");
        assert_eq!(lab.json(&format!("compare leg.toml {log}"))["not_judged"], serde_json::json!(["knee"]));
    }
    let told = lab.ok("diagnose leg.toml absent.csv");
    assert!(told.contains("nothing is missing on hip: what remains is noise\nknee was not measured"), "{told}");
    assert!(lab.ok("compare leg.toml absent.csv").contains("knee was not measured, and so not judged"));
}

#[test]
fn a_joint_under_another_name_is_told_with_what_to_write() {
    let lab = lab();
    let renamed = |k: usize, cells: &mut Vec<String>| {
        if k == 0 {
            cells[Q_KNEE] = "knee_position".to_owned();
        }
        true
    };
    lab.edit("log.csv", "foreign.csv", renamed);
    let output = lab.run("compare leg.toml foreign.csv");
    let (told, said) = (text(&output.stdout), text(&output.stderr));
    let above = told.split("\n\n").nth(1).unwrap();
    assert!(above.ends_with("knee was not measured, and so not judged"), "{told}");
    let channel = "q_knee = \"knee_position\"";
    assert!(
        said.contains("is it `knee_position`?") && said.contains(&format!("[channels.channels] {channel}")),
        "{said}"
    );
    lab.write("leg.toml", &format!("{MODEL}\n[channels.channels]\n{channel}\n"));
    assert_eq!(lab.json("compare leg.toml foreign.csv")["not_judged"], serde_json::json!([]));
}

#[test]
fn where_nothing_moves_or_is_measured_there_is_no_verdict() {
    let lab = lab();
    let first: Vec<String> = lab.read("log.csv").lines().nth(1).unwrap().split(',').map(str::to_owned).collect();
    lab.edit("log.csv", "still.csv", |k, cells| {
        for column in (1..cells.len()).filter(|_| k > 0) {
            first[column].clone_into(&mut cells[column]);
        }
        true
    });
    lab.edit("log.csv", "blind.csv", |k, cells| {
        for column in [Q_HIP, Q_KNEE].into_iter().filter(|_| k > 0) {
            cells[column].clear();
        }
        true
    });
    for verb in ["diagnose", "fit"] {
        let told = lab.complaint(&format!("{verb} leg.toml still.csv"));
        assert!(told.contains("error: nothing moves in the training logs"), "{told}");
        let told = lab.complaint(&format!("{verb} leg.toml blind.csv"));
        assert!(told.contains("error: no joint's position is measured"), "{told}");
    }
}

#[test]
fn of_readings_without_noise_it_is_said_that_their_floor_is_assumed() {
    let lab = lab();
    lab.write("leg.toml", &MODEL.replace("position_rad = 0.0005", ""));
    lab.ok("simulate leg.toml -q --log told.csv -o clean.csv");
    let document = lab.json("fit leg.toml clean.csv");
    assert_eq!(document["noise_floor"][0]["assumed"], true);
    assert!(document["noise_floor"][0]["sigma"].as_f64().unwrap() > 5e-6, "{document}");
    assert!(lab.ok("fit leg.toml clean.csv").contains("(assumed: its readings show no noise)"));
    says(&lab, "clean.csv", 0, "fine: q_hip shows no noise, as if simulated");
}

#[test]
fn what_tells_nothing_or_is_held_out_from_itself_is_refused() {
    let lab = lab();
    lab.edit("log.csv", "short.csv", |k, _| k < 15);
    for verb in ["fit", "diagnose"] {
        let why = lab.complaint(&format!("{verb} leg.toml short.csv"));
        assert!(why.contains("the longest training log has 14 samples: too few for an estimate"), "{why}");
    }
    lab.edit("log.csv", "copy.csv", |_, _| true);
    let why = lab.complaint("fit leg.toml log.csv --held-out copy.csv");
    assert!(why.contains("log.csv and copy.csv hold the same measurements"), "{why}");
}

#[test]
fn degrees_that_a_joint_could_reach_in_rad_are_told_all_the_same() {
    let lab = lab();
    lab.edit("log.csv", "degrees.csv", |k, cells| {
        for (column, factor) in [(CMD_HIP, 0.15 * 57.3), (Q_HIP, 0.15), (DQ_HIP, 0.15)] {
            if k > 0 {
                cells[column] = (cells[column].parse::<f64>().unwrap() * factor).to_string();
            }
        }
        true
    });
    says(&lab, "degrees.csv", 1, "fine: cmd_hip reaches");
    says(&lab, "degrees.csv", 1, "bad: cmd_hip moves");
}
