//! Logs of motion and torque: the motion is prescribed, and the torques that it requires are compared.

use crate::lab::Lab;
use serde_json::Value;
use std::fmt::Write;

const MODEL: &str = r#"name = "leg"

[robot]
urdf = "leg.urdf"
base = "fixed"

[actuators."*"]
kind = "prescribed"
"#;

/// What the leg has and the model lacks: at the knee, whose motor is twenty times weaker, as well as at the hip.
const HIDDEN: &str = r#"
[[effects]]
effect = "viscous_friction"
site = "hip"
coefficient = 0.8

[[effects]]
effect = "armature"
site = "hip"
inertia = 0.05

[[effects]]
effect = "coulomb_friction"
site = "knee"
torque = 0.04
"#;

const URDF: &str = r#"<robot name="leg">
<link name="base"/>
<link name="thigh"><inertial><origin xyz="0 0 -0.15"/><mass value="2.0"/>
<inertia ixx="0.02" iyy="0.02" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="shank"><inertial><origin xyz="0 0 -0.05"/><mass value="0.1"/>
<inertia ixx="0.0002" iyy="0.0002" izz="0.00003" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hip" type="revolute"><parent link="base"/><child link="thigh"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="20" velocity="20"/></joint>
<joint name="knee" type="revolute"><parent link="thigh"/><child link="shank"/><origin xyz="0 0 -0.3"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="20" velocity="20"/></joint>
</robot>
"#;

const RATE_HZ: f64 = 250.0;
const SAMPLES: u32 = 2000;
/// Standard deviations of the encoders in rad, and of the torques of hip and knee in N·m.
const ENCODER_RAD: f64 = 2e-5;
const TORQUE_NM: [f64; 2] = [0.1, 0.004];

/// Numbers of variance one that look random.
fn noise(i: u32, salt: f64) -> f64 {
    let even = |k: f64| (f64::from(i) * (12.9898 + k) + 78.233 * (salt + k)).sin() * 43758.5453;
    let even = |k: f64| even(k) - even(k).floor();
    (0..12).map(|k| even(f64::from(k))).sum::<f64>() - 6.0
}

/// A leg that did as its hidden model says, in two logs of motion and torque.
fn lab() -> Lab {
    let lab = Lab::new();
    lab.write("leg.urdf", URDF);
    lab.write("leg.toml", MODEL);
    lab.write("hidden.toml", &format!("{MODEL}{HIDDEN}"));
    for (name, phase) in [("learn", 0.0), ("held_out", 2.0)] {
        let mut motion = "t,q_hip,q_knee\n".to_owned();
        for i in 0..SAMPLES {
            let t = f64::from(i) / RATE_HZ;
            let swing = |a: f64, b: f64| 0.5 * (a * t + phase).sin() + 0.3 * (b * t + 2.0 * phase).cos();
            writeln!(motion, "{t},{},{}", swing(3.1, 7.7), swing(4.3, 9.1)).unwrap();
        }
        lab.write("motion.csv", &motion);
        lab.ok("simulate hidden.toml --log motion.csv -q --overwrite -o torque.csv");
        let required = lab.read("torque.csv");
        let header: Vec<&str> = required.lines().next().unwrap().split(',').collect();
        let columns =
            ["q_hip", "q_knee", "tau_hip", "tau_knee"].map(|name| header.iter().position(|h| *h == name).unwrap());
        let mut log = "t,q_hip,q_knee,tau_hip,tau_knee\n".to_owned();
        for (i, line) in (0..).zip(required.lines().skip(1)) {
            let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
            let sigmas = [ENCODER_RAD, ENCODER_RAD, TORQUE_NM[0], TORQUE_NM[1]];
            let read = |k: usize| cells[columns[k]] + sigmas[k] * noise(i, phase + 3.0 * k as f64);
            writeln!(log, "{},{},{},{},{}", cells[0], read(0), read(1), read(2), read(3)).unwrap();
        }
        lab.write(&format!("{name}.csv"), &log);
    }
    lab
}

fn floor(answer: &Value, channel: &str) -> f64 {
    let floors = answer["noise_floor"].as_array().unwrap();
    floors.iter().find(|floor| floor["channel"] == channel).unwrap()["sigma"].as_f64().unwrap()
}

#[test]
fn each_torque_has_its_own_floor_and_a_weak_joint_is_not_overlooked() {
    let lab = lab();
    let answer = lab.json("diagnose leg.toml learn.csv --held-out held_out.csv -q");
    // The motion's noise adds to that of the torque.
    let (hip, knee) = (floor(&answer, "tau_hip") / TORQUE_NM[0], floor(&answer, "tau_knee") / TORQUE_NM[1]);
    assert!((0.9..1.6).contains(&hip) && (0.9..1.6).contains(&knee), "{hip} {knee}");
    let named: Vec<(String, f64)> = answer["effects"]
        .as_array()
        .unwrap()
        .iter()
        .map(|effect| {
            let name = format!("{}@{}", effect["effect"].as_str().unwrap(), effect["site"].as_str().unwrap());
            (name, effect["parameters"][0]["value"].as_f64().unwrap())
        })
        .collect();
    for (name, true_value) in [("viscous_friction@hip", 0.8), ("armature@hip", 0.05), ("coulomb_friction@knee", 0.04)] {
        let found = named.iter().find(|(found, _)| found == name);
        assert!(found.is_some_and(|(_, value)| (value / true_value - 1.0).abs() < 0.05), "{name}: {named:?} {answer}");
    }
    assert_eq!((answer["verdict"].as_str().unwrap(), named.len()), ("effect_missing", 3), "{answer}");
    assert!((answer["time_step_s"].as_f64().unwrap() * RATE_HZ - 1.0).abs() < 1e-9);
}

#[test]
fn torques_are_compared_by_joint_and_regime_and_positions_are_not() {
    let lab = lab();
    let document = lab.json("compare leg.toml learn.csv");
    let channels: Vec<&str> =
        document["channels"].as_array().unwrap().iter().map(|c| c["name"].as_str().unwrap()).collect();
    assert_eq!(channels, ["tau_hip", "tau_knee"]);
    assert!(document["channels"].as_array().unwrap().iter().all(|c| c["error_percent"].as_f64().unwrap() > 5.0));
    let failures = document["failures"].as_array().unwrap();
    let hints = |joint: &str| failures.iter().any(|cell| cell["joint"] == joint && !cell["follows"].is_null());
    assert!(hints("hip") && hints("knee"), "{failures:?}");
}

#[test]
fn an_effect_without_a_site_has_a_value_for_each_joint() {
    let lab = lab();
    let fitted = |add: &str| {
        let fit = lab.json(&format!("fit leg.toml learn.csv --held-out held_out.csv --add {add} -q"));
        let names = fit["parameters"].as_array().unwrap().iter().map(|p| p["name"].as_str().unwrap().to_owned());
        names.collect::<Vec<_>>()
    };
    let [hip, knee, all] = ["hip", "knee", "*"].map(|site| format!("viscous_friction.coefficient@{site}"));
    assert_eq!(fitted("viscous_friction"), [hip, knee]);
    assert_eq!(fitted("viscous_friction@*"), [all]);
}
