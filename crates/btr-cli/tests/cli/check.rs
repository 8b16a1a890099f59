//! `btr check`: which numbers a log tells, and which it tells together only.

use crate::lab::{Lab, noise};
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

/// The pendulum on a servo of this gain and damping, late by this delay, follows nine steps of 0.15 to 0.4 rad.
fn stepped(lab: &Lab, gain: f64, damping: f64, delay_s: f64) -> Value {
    let levels = [0.0, 0.2, -0.1, 0.15, 0.0, 0.3, 0.1, -0.2, 0.1, 0.25];
    let row = |i: usize| format!("{:.2},{},0\n", 0.01 * i as f64, levels[i / 200]);
    lab.write("commands.csv", &format!("t,cmd_hinge,q_hinge\n{}", (0..2000).map(row).collect::<String>()));
    let effect = format!("[[effects]]\neffect = \"command_delay\"\nsite = \"hinge\"\ndelay = {delay_s}\n[drive]");
    let servo = MODEL.replace("kp = 10.0", &format!("kp = {gain}")).replace("kd = 0.5", &format!("kd = {damping}"));
    let model =
        format!("{}[drive]\nkind = \"replay\"\nlog = \"commands.csv\"\n", &servo[..servo.find("[drive]").unwrap()]);
    lab.write("stepped.toml", &model.replace("duration_s = 3.0", "duration_s = 20.0"));
    lab.write("late.toml", &lab.read("stepped.toml").replace("[drive]", &effect));
    lab.ok("simulate late.toml -q -o exact.csv");
    let position = lab.read("exact.csv").lines().next().unwrap().split(',').position(|name| name == "q_hinge").unwrap();
    lab.edit("exact.csv", "read.csv", |row, cells| {
        if row > 0 {
            let steps = cells[position].parse::<f64>().unwrap() / 0.0015 + 0.5 * (12.9898 * row as f64).sin();
            cells[position] = (0.0015 * steps.round()).to_string();
        }
        true
    });
    std::fs::remove_file(lab.path("exact.csv")).unwrap();
    lab.json("check stepped.toml read.csv")["logs"][0].clone()
}

#[test]
fn dead_time_is_told_apart_from_lag_at_any_gain() {
    let lab = lab();
    for (gain, damping, delay_s) in [(15.0, 4.0, 0.04), (400.0, 15.0, 0.04), (400.0, 15.0, 0.0)] {
        let checked = stepped(&lab, gain, damping, delay_s);
        let joint = &checked["joints"][0];
        let [low, high] = [0, 1].map(|k| joint["dead_time_ci95_s"][k].as_f64().unwrap());
        assert!((joint["dead_time_s"].as_f64().unwrap() - delay_s).abs() < 0.007, "{joint}");
        assert!(low <= delay_s && delay_s <= high && joint["dead_time_onsets"] == 9, "{joint}");
        assert!(joint["command_lag"]["lag_s"].as_f64().unwrap() > delay_s + 0.03, "{joint}");
        let said = checked["findings"].to_string();
        let [lacking, none] = ["its effect is command_delay@hinge", "no dead time is seen"].map(|it| said.contains(it));
        assert_eq!((lacking, none), (delay_s > 0.0, delay_s == 0.0), "{said}");
    }
    let told = lab.ok("check late.toml read.csv");
    assert!(!told.contains("the model has no dead time"), "{told}");
}

#[test]
fn a_sine_tells_no_dead_time_but_what_to_record() {
    let checked = lab().json("check scale.toml bare.csv");
    let joint = &checked["logs"][0]["joints"][0];
    assert!(joint["dead_time_s"].is_null() && joint["dead_time_onsets"] == 0, "{joint}");
    let said = checked["logs"][0]["findings"].to_string();
    assert!(said.contains("record at least three steps"), "{said}");
}

/// Each log's servo gain and the phase of its command.
const GAINS: [(&str, f64, f64); 4] =
    [("soft", 20.0, 0.0), ("stiff", 80.0, 1.0), ("soft_again", 20.0, 2.0), ("stiff_again", 80.0, 3.0)];

/// A log in which the pendulum of `late.toml` follows three sines.
fn sines(lab: &Lab, name: &str, phase: f64) {
    let command = |t: f64| {
        let slow = 0.5 * ((1.3 * t + phase).sin() - phase.sin());
        slow + 0.2 * (4.1 * t).sin() + 0.1 * (9.0 * t).sin()
    };
    let time = |i: u32| 0.01 * f64::from(i);
    let rows: String = (0..1000).map(|i| format!("{:.2},{},0\n", time(i), command(time(i)))).collect();
    lab.write(&format!("{name}_command.csv"), &format!("t,cmd_hinge,q_hinge\n{rows}"));
    lab.ok(&format!("simulate late.toml --log {name}_command.csv -q --overwrite -o exact.csv"));
    let exact = lab.read("exact.csv");
    let column = |name: &str| exact.lines().next().unwrap().split(',').position(|it| it == name).unwrap();
    let (t, q) = (column("t"), column("q_hinge"));
    let cell = |line: &str, column: usize| line.split(',').nth(column).unwrap().parse::<f64>().unwrap();
    let at: Vec<(f64, f64)> = exact.lines().skip(1).map(|line| (cell(line, t), cell(line, q))).collect();
    let recorded = (0..1000).filter_map(|i| {
        let exact = at.iter().find(|(t, _)| (t - time(i)).abs() < 1e-6)?.1;
        Some(format!("{:.2},{},{}\n", time(i), command(time(i)), exact + 5e-4 * noise(i, phase)))
    });
    lab.write(&format!("{name}.csv"), &format!("t,cmd_hinge,q_hinge\n{}", recorded.collect::<String>()));
}

#[test]
fn logs_at_two_gains_tell_a_dead_time_without_a_step() {
    let lab = lab();
    let row = |(name, gain, _): &(&str, f64, f64)| format!("{name}.csv,{gain}\n{name}_command.csv,{gain}\n");
    lab.write("index.csv", &format!("file,gain\n{}", GAINS.iter().map(row).collect::<String>()));
    let robot = &MODEL[..MODEL.find("[parameters]").unwrap()];
    let logs = "[logs]\nindex = \"index.csv\"\ncolumns = { \"kp@hinge\" = { column = \"gain\" } }\n";
    let free = "[parameters]\n\"kd@hinge\" = { bounds = [0.1, 9.0] }\n";
    lab.write("servo.toml", &format!("{robot}{logs}{free}"));
    let late = "[[effects]]\neffect = \"command_delay\"\nsite = \"hinge\"\ndelay = 0.04\n";
    lab.write("late.toml", &format!("{}{logs}{late}", robot.replace("kd = 0.5", "kd = 2.5")));
    GAINS.iter().for_each(|(name, _, phase)| sines(&lab, name, *phase));
    let checked = lab.json("check servo.toml soft.csv stiff.csv");
    let lag = |log: usize| checked["logs"][log]["joints"][0]["command_lag"]["lag_s"].as_f64().unwrap();
    assert!(lag(0) > 1.5 * lag(1) && lag(1) > 0.06, "{} {}", lag(0), lag(1));
    let held_out = "--held-out soft_again.csv stiff_again.csv";
    let fitted = lab.json(&format!("fit servo.toml soft.csv stiff.csv {held_out} --add command_delay@hinge"));
    let delay = &parameter(&fitted, "command_delay.delay@hinge")["value"];
    assert!((delay.as_f64().unwrap() - 0.04).abs() < 5e-4, "{fitted}");
}
