//! What a demanding researcher tries on day one, as far as it takes seconds; docs/howto/index.md lists all of it.

use crate::lab::{Lab, robots};
use serde_json::Value;
use std::fmt::Write;

/// A pendulum on a servo; `EFFECTS` is replaced by what reality has.
const PENDULUM: &str = r#"name = "pendulum"

[robot]
builtin = "pendulum"
length_m = 0.3

[actuators.hinge]
kind = "position"
kp = 12.0
kd = 0.3

[simulation]
control_s = 0.01
steps_per_control = 10
sample_every = 10

[noise]
position_rad = 0.0003
position_quantum_rad = 0.0005

[parameters]
"mass@bob" = { relative = [0.8, 1.25] }
"kp@hinge" = { relative = [0.8, 1.25] }
"kd@hinge" = { relative = [0.8, 1.25] }
"#;

/// A lift: the load that its motor carries hardly changes within a log.
const LIFT: &str = r#"name = "lift"

[robot]
urdf = "lift.urdf"
base = "fixed"

[actuators.slide]
kind = "position"
kp = 4000.0
kd = 120.0

[simulation]
control_s = 0.01
steps_per_control = 10
sample_every = 10

[noise]
position_rad = 0.0006

[parameters]
"kp@slide" = { relative = [0.9, 1.11] }
"kd@slide" = { relative = [0.9, 1.11] }

[logs]
index = "index.csv"
columns = { "payload.mass@carriage" = { column = "payload" } }
"#;

const LIFT_URDF: &str = r#"<robot name="lift"><link name="frame"/><joint name="slide" type="prismatic"><parent link="frame"/>
<child link="carriage"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1000" velocity="10"/></joint>
<link name="carriage"><inertial><mass value="5"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>
"#;

/// Commands for some joints: from rest, fast and slow, other ones in each episode.
fn commands(lab: &Lab, name: &str, joints: &[&str], size: f64, episode: usize) {
    let mut text = format!("t,{}\n", joints.iter().map(|j| format!("cmd_{j}")).collect::<Vec<_>>().join(","));
    for tick in 0..=400 {
        let t = f64::from(tick) * 0.01;
        write!(text, "{t}").unwrap();
        for k in 0..joints.len() {
            let rate = 1.1 + 0.6 * k as f64 + 0.9 * episode as f64;
            let wave = 0.6 * (rate * t).sin() + 0.35 * (2.7 * rate * t).sin() + 0.1 * (9.0 * t).sin();
            write!(text, ",{}", size * (1.0 - (-3.0 * t).exp()) * wave).unwrap();
        }
        text.push('\n');
    }
    lab.write(name, &text);
}

/// Three logs of a reality, which is the model `name` (already in the lab) with this text behind it: two to learn from
/// and one to judge on.
fn record(lab: &Lab, name: &str, joints: &[&str], size: f64, hidden: &str) {
    lab.write("reality.toml", &format!("{}\n{hidden}", lab.read(name)));
    for episode in 0..3 {
        commands(lab, "told.csv", joints, size, episode);
        lab.ok(&format!("simulate reality.toml -q --log told.csv -o log_{episode}.csv --seed {}", episode + 1));
    }
}

fn effect(name: &str, site: &str, values: &str) -> String {
    format!("[[effects]]\neffect = \"{name}\"\nsite = \"{site}\"\n{values}\n")
}

fn diagnosis(lab: &Lab, name: &str) -> Value {
    lab.json(&format!("diagnose {name} log_0.csv log_1.csv --held-out log_2.csv"))
}

/// `effect@site` of everything that is missing.
fn missing(document: &Value) -> Vec<String> {
    let name = |e: &Value| format!("{}@{}", e["effect"].as_str().unwrap(), e["site"].as_str().unwrap());
    document["effects"].as_array().unwrap().iter().map(name).collect()
}

/// The first of what is missing, and what cannot be told from it.
fn with_alike(document: &Value) -> Vec<String> {
    let others = document["effects"][0]["alike"].as_array().unwrap().iter().map(|x| x.as_str().unwrap().to_owned());
    missing(document).into_iter().take(1).chain(others).collect()
}

fn pendulum(hidden: &str) -> (Lab, Value) {
    let lab = Lab::new();
    lab.write("pendulum.toml", PENDULUM);
    record(&lab, "pendulum.toml", &["hinge"], 0.9, hidden);
    let document = diagnosis(&lab, "pendulum.toml");
    (lab, document)
}

#[test]
fn friction_hidden_on_one_joint_of_five_is_seen_named_added_and_measured() {
    let lab = Lab::new();
    for file in ["arm5.toml", "arm5.urdf"] {
        lab.write(file, &std::fs::read_to_string(robots().join(file)).unwrap());
    }
    let joints = ["base_yaw", "shoulder", "elbow", "wrist_roll", "wrist_pitch"];
    record(&lab, "arm5.toml", &joints, 0.5, &effect("coulomb_friction", "shoulder", "torque = 0.5"));
    let compared = lab.ok("compare arm5.toml log_2.csv");
    assert!(compared.contains("shoulder") && compared.contains("sign of the velocity"), "{compared}");
    let document = diagnosis(&lab, "arm5.toml");
    assert_eq!(missing(&document), ["coulomb_friction@shoulder"], "{document}");
    assert!(document["effects"][0]["delta_bic"].as_f64().unwrap() > 1000.0);
    assert!(document["ranking"][0][0]["held_out"].as_f64().unwrap() < 1.1, "{document}");
    lab.ok("fit arm5.toml log_0.csv log_1.csv --held-out log_2.csv --add coulomb_friction@shoulder -o fitted.toml");
    let found = document["effects"][0]["parameters"][0]["value"].as_f64().unwrap();
    assert!((found / 0.5 - 1.0).abs() < 0.01, "{found}");
    let ladder = document["error_ladder"].as_array().unwrap();
    assert!(ladder.last().unwrap()["held_out"].as_f64().unwrap() < 1.1, "{document}");
}

#[test]
fn a_stiff_spring_in_a_small_swing_is_no_cogging() {
    let lab = Lab::new();
    for file in ["arm.toml", "arm.urdf"] {
        lab.write(file, &std::fs::read_to_string(robots().join(file)).unwrap());
    }
    let spring = effect("parallel_spring", "shoulder", "stiffness = 4.0\nrest = 0.4");
    record(&lab, "arm.toml", &["yaw", "shoulder", "elbow"], 0.3, &spring);
    let document = diagnosis(&lab, "arm.toml");
    assert_eq!(missing(&document), ["parallel_spring@shoulder"], "{document}");
}

#[test]
fn ten_parameters_are_found_from_twelve_starts() {
    let lab = Lab::new();
    for file in ["arm5.toml", "arm5.urdf"] {
        lab.write(file, &std::fs::read_to_string(robots().join(file)).unwrap());
    }
    let joints = ["base_yaw", "shoulder", "elbow", "wrist_roll", "wrist_pitch"];
    commands(&lab, "told.csv", &joints, 0.5, 1);
    lab.ok("simulate arm5.toml -q --log told.csv -o log.csv");
    let truth = lab.json("fit arm5.toml log.csv -o none.toml");
    let numbers: Vec<(&str, f64)> = truth["parameters"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| (p["name"].as_str().unwrap(), p["value"].as_f64().unwrap()))
        .collect();
    assert_eq!(numbers.len(), 10);
    let within = |start: usize| {
        let set = |(k, (name, value)): (usize, &(&str, f64))| {
            // Anywhere between a little more than half and a little less than twice the truth.
            let share = ((start * 7 + k * 5 + start * k) % 13) as f64 / 12.0;
            format!("--set parameters.\"{name}\".value={}", value * 0.55 * (1.8f64 / 0.55).powf(share))
        };
        let sets: Vec<String> = numbers.iter().enumerate().map(set).collect();
        let document = lab.json(&format!("fit arm5.toml log.csv -o start.toml {}", sets.join(" ")));
        let found = document["parameters"].as_array().unwrap().iter().map(|p| p["value"].as_f64().unwrap());
        found.zip(&numbers).all(|(found, (_, truth))| (found / truth - 1.0).abs() < 0.01)
    };
    let good = (0..12).filter(|&start| within(start)).count();
    assert!(good >= 11, "{good} of 12");
}

#[test]
fn a_joint_that_rings_is_elastic_and_not_damped() {
    let (_, document) = pendulum(&effect("joint_elasticity", "hinge", "stiffness = 60.0\ndamping = 0.02"));
    assert_eq!(missing(&document), ["joint_elasticity@hinge"], "{document}");
}

#[test]
fn a_lag_is_found_before_anything_is_fitted() {
    let (lab, document) = pendulum(&effect("command_delay", "hinge", "delay = 0.03"));
    let late = lab.json("check pendulum.toml log_0.csv");
    assert!(late.to_string().contains("follows its command after"), "{late}");
    // On one joint alone it makes no difference whether the command or the reading is late, and btr says so.
    assert!(with_alike(&document).iter().any(|x| x == "command_delay@hinge"), "{document}");
    assert!(with_alike(&document).iter().all(|x| x.ends_with("_delay@hinge")), "{document}");
}

#[test]
fn the_friction_law_that_made_the_log_is_named() {
    let ladder = [
        ("coulomb_friction", "torque = 0.25"),
        ("stribeck_friction", "coulomb = 0.15\nstatic = 0.4\nvelocity = 0.3"),
        ("load_dependent_friction", "ratio = 0.15"),
    ];
    for (name, values) in ladder {
        let (_, document) = pendulum(&effect(name, "hinge", values));
        assert_eq!(missing(&document), [format!("{name}@hinge")], "{document}");
    }
    let both = [effect(ladder[1].0, "hinge", ladder[1].1), effect(ladder[2].0, "hinge", ladder[2].1)].join("\n");
    let (_, document) = pendulum(&both);
    // A joint that sticks so much of the time hides the second law behind the first; it may be called by its formula,
    // but nothing else may pass for the explanation.
    assert_eq!(missing(&document)[0], "stribeck_friction@hinge", "{document}");
    let law = document["residual_law"]["law"].as_str().unwrap_or_default();
    let named = missing(&document).iter().any(|name| name == "load_dependent_friction@hinge");
    assert!(named || (document["verdict"] == "unexplained" && law.contains("abs(tau)")), "{document}");
}

#[test]
fn what_only_held_out_logs_show_is_said_to_show_there_alone() {
    let lab = Lab::new();
    lab.write("pendulum.toml", PENDULUM);
    // A limit that gentle motions never meet.
    let weak = effect("torque_limit", "hinge", "torque = 2.0");
    lab.write("reality.toml", &format!("{PENDULUM}\n{weak}"));
    for (episode, size) in [0.2, 0.2, 0.9].into_iter().enumerate() {
        commands(&lab, "told.csv", &["hinge"], size, episode);
        lab.ok(&format!("simulate reality.toml -q --log told.csv -o log_{episode}.csv --seed {}", episode + 1));
    }
    let told = lab.ok("diagnose pendulum.toml log_0.csv log_1.csv --held-out log_2.csv");
    assert!(told.contains("unexplained") && told.contains("shows in the held-out logs alone"), "{told}");
    let swapped = lab.json("diagnose pendulum.toml log_0.csv log_2.csv --held-out log_1.csv");
    assert!(missing(&swapped)[0].contains("torque_limit@hinge"), "{swapped}");
}

#[test]
fn one_load_does_not_tell_whether_friction_grows_with_it_and_two_do() {
    let lab = Lab::new();
    lab.write("lift.toml", LIFT);
    lab.write("lift.urdf", LIFT_URDF);
    let loads = |payloads: [f64; 3]| {
        let row = |(i, payload): (usize, &f64)| format!("log_{i}.csv,{payload}\n");
        let rows: String = payloads.iter().enumerate().map(row).collect();
        lab.write("index.csv", &format!("file,payload\n{rows}"));
        for (episode, payload) in payloads.iter().enumerate() {
            let hidden = effect("load_dependent_friction", "slide", "ratio = 0.1");
            let loaded = effect("payload", "carriage", &format!("mass = {payload}"));
            lab.write("reality.toml", &format!("{LIFT}\n{hidden}\n{loaded}"));
            commands(&lab, "told.csv", &["slide"], 0.02, episode);
            lab.ok(&format!(
                "simulate reality.toml -q --log told.csv -o log_{episode}.csv --overwrite --seed {}",
                episode + 1
            ));
        }
        diagnosis(&lab, "lift.toml")
    };
    let one = loads([0.0, 0.0, 0.0]);
    for name in ["coulomb_friction@slide", "load_dependent_friction@slide"] {
        assert!(with_alike(&one).iter().any(|x| x == name), "{one}");
    }
    let two = loads([0.0, 5.0, 2.0]);
    assert_eq!(missing(&two), ["load_dependent_friction@slide"], "{two}");
    assert!(!with_alike(&two).iter().any(|x| x.starts_with("coulomb")), "{two}");
}

/// A row may hold a command and what was measured after it; and the recorder's clock may run at another rate.
#[test]
fn readings_ahead_of_commands_are_told_from_a_clock_of_another_rate() {
    for (name, parameter, value) in [("encoder_lead", "lead", 0.02), ("clock_skew", "skew", 0.004)] {
        let lab = Lab::new();
        let arm = std::fs::read_to_string(robots().join("arm.toml")).unwrap();
        lab.write("arm.urdf", &std::fs::read_to_string(robots().join("arm.urdf")).unwrap());
        lab.write("arm.toml", &arm);
        let hidden = format!("[[effects]]\neffect = \"{name}\"\nsite = \"*\"\n{parameter} = {value}\n\n[parameters]\n");
        lab.write("real.toml", &arm.replacen("[parameters]\n", &hidden, 1));
        for log in ["learn_1", "learn_2", "learn_3"] {
            let commands = robots().join(format!("arm/{log}.csv"));
            lab.ok(&format!("simulate real.toml --log {} --seed 7 -q -o {log}.csv", commands.display()));
        }
        let found = lab.json("diagnose arm.toml learn_1.csv learn_2.csv --held-out learn_3.csv");
        let effects = found["effects"].as_array().unwrap();
        assert_eq!((&found["verdict"], effects.len()), (&"effect_missing".into(), 1), "{found}");
        assert_eq!(effects[0]["effect"], name);
        let estimate = effects[0]["parameters"][0]["value"].as_f64().unwrap();
        assert!((estimate / value - 1.0).abs() < 0.05, "{name}: {estimate}");
    }
}

#[test]
fn a_finding_that_adds_to_a_free_parameter_is_told() {
    let lab = Lab::new();
    let arm = std::fs::read_to_string(robots().join("arm.toml")).unwrap();
    lab.write("arm.urdf", &std::fs::read_to_string(robots().join("arm.urdf")).unwrap());
    let model = |before: &str, free: &str| arm.replacen("[parameters]\n", &format!("{before}[parameters]\n{free}"), 1);
    let damping = "\"damping@shoulder\" = { bounds = [0.0, 0.05] }\n";
    lab.write("arm.toml", &model("", damping));
    let hidden = "[[effects]]\neffect = \"viscous_friction\"\nsite = \"shoulder\"\ncoefficient = 0.6\n\n";
    lab.write("real.toml", &model(hidden, ""));
    for log in ["learn_1", "learn_2"] {
        let commands = robots().join(format!("arm/{log}.csv"));
        lab.ok(&format!("simulate real.toml --log {} --seed 7 -q -o {log}.csv", commands.display()));
    }
    let told = lab.ok("diagnose arm.toml learn_1.csv --held-out learn_2.csv");
    let sentence = "viscous_friction.coefficient@shoulder adds to damping@shoulder, which is free";
    assert!(told.contains(sentence), "{told}");
}
