//! Logs of motion and torque: the motion is prescribed, and the torques that it requires are compared.

use crate::lab::{Lab, named, noise};
use serde_json::Value;
use std::f64::consts::PI;
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

/// A motion with its velocity and its acceleration; slow enough for the parabolas by which velocities are estimated:
/// they shift the reversals of faster ones.
fn swing(t: f64, phase: f64, (slow, fast): (f64, f64)) -> [f64; 3] {
    let (a, b) = (slow * t + phase, fast * t + 2.0 * phase);
    [
        0.5 * a.sin() + 0.3 * b.cos(),
        0.5 * slow * a.cos() - 0.3 * fast * b.sin(),
        -0.5 * slow * slow * a.sin() - 0.3 * fast * fast * b.cos(),
    ]
}

/// A leg with what is [`HIDDEN`], and with more.
struct Planted {
    /// Torque at the knee by where the hip is, as by a cable that runs past it, in N·m/rad.
    cable: f64,
    /// What a motor that turns with both joints takes of both: dry friction in N·m, viscous friction in N·m·s/rad, and
    /// a rotor in kg·m².
    motor: [f64; 3],
    /// The motions of hip and knee at a time, in a log that has a phase.
    motions: fn(f64, f64) -> [[f64; 3]; 2],
    /// What friction holds in N·m at a time, while both stand still.
    held: fn(f64) -> f64,
}

impl Default for Planted {
    fn default() -> Self {
        let motions = |t, phase| [swing(t, phase, (2.1, 4.7)), swing(t, phase, (2.9, 5.3))];
        Planted { cable: 0.0, motor: [0.0; 3], motions, held: |_| 0.0 }
    }
}

impl Planted {
    /// Two logs of motion and torque: the torques that the model without anything hidden requires, and on top what
    /// friction and rotor take. Simulated torques are smoothed, and friction's steps are not.
    fn lab(self) -> Lab {
        let lab = Lab::new();
        lab.write("leg.urdf", URDF);
        lab.write("leg.toml", MODEL);
        for (name, phase) in [("learn", 0.0), ("held_out", 2.0)] {
            self.write(&lab, name, phase);
        }
        lab
    }

    fn write(&self, lab: &Lab, name: &str, phase: f64) {
        let at = |i: u32| {
            let t = f64::from(i) / RATE_HZ;
            (t, (self.motions)(t, phase))
        };
        let mut motion = "t,q_hip,q_knee\n".to_owned();
        for (t, [hip, knee]) in (0..SAMPLES).map(at) {
            writeln!(motion, "{t},{},{}", hip[0], knee[0]).unwrap();
        }
        lab.write("motion.csv", &motion);
        lab.ok("simulate leg.toml --log motion.csv -q --overwrite -o torque.csv");
        let required = lab.read("torque.csv");
        let header: Vec<&str> = required.lines().next().unwrap().split(',').collect();
        let columns = ["tau_hip", "tau_knee"].map(|name| header.iter().position(|h| *h == name).unwrap());
        let mut log = "t,q_hip,q_knee,tau_hip,tau_knee\n".to_owned();
        let sign = |velocity: f64| if velocity == 0.0 { 0.0 } else { velocity.signum() };
        for (i, line) in (0..SAMPLES).zip(required.lines().skip(1)) {
            let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
            let (t, [hip, knee]) = at(i);
            let noise = |k: usize, sigma: f64| sigma * noise(i, phase + 3.0 * k as f64);
            let (q_hip, q_knee) = (hip[0] + noise(0, ENCODER_RAD), knee[0] + noise(1, ENCODER_RAD));
            let both = [hip[1] + knee[1], hip[2] + knee[2]];
            let shared = self.motor[0] * sign(both[0]) + self.motor[1] * both[0] + self.motor[2] * both[1];
            let held = if hip[1] == 0.0 && knee[1] == 0.0 { (self.held)(t) } else { 0.0 };
            let tau_hip = cells[columns[0]] + 0.8 * hip[1] + 0.05 * hip[2] + shared + held + noise(2, TORQUE_NM[0]);
            let own = 0.04 * sign(knee[1]) + self.cable * hip[0] + shared;
            let tau_knee = cells[columns[1]] + own + held + noise(3, TORQUE_NM[1]);
            writeln!(log, "{t},{q_hip},{q_knee},{tau_hip},{tau_knee}").unwrap();
        }
        lab.write(&format!("{name}.csv"), &log);
    }
}

fn lab() -> Lab {
    Planted::default().lab()
}

/// Spoils every seventieth reading of each torque: full scale, a zero, or the reading before.
fn spoil_torques(lab: &Lab, log: &str) {
    let mut before = vec![String::new(); 5];
    lab.edit(log, log, |row, cells| {
        for column in 3..5 {
            match (row + 20 * column) % 210 {
                25 => cells[column] = "-80".to_owned(),
                105 => cells[column] = "0".to_owned(),
                185 => cells[column].clone_from(&before[column]),
                _ => {}
            }
        }
        before.clone_from_slice(cells);
        true
    });
}

#[test]
fn glitches_of_torques_change_no_verdict() {
    let answer = |lab: &Lab, options: &str| {
        lab.json(&format!("diagnose leg.toml learn.csv --held-out held_out.csv -q{options}"))
    };
    let lab = lab();
    let clean = answer(&lab, "");
    ["learn.csv", "held_out.csv"].iter().for_each(|log| spoil_torques(&lab, log));
    let spoilt = answer(&lab, "");
    assert_eq!(named(&spoilt), named(&clean));
    assert_eq!(spoilt["verdict"], "effect_missing");
    let glitches = lab.json("check leg.toml learn.csv -q");
    let glitches = glitches["logs"][0]["glitches"].as_array().unwrap();
    let full_scale = |glitch: &&Value| glitch["channel"] == "tau_hip" && glitch["value"].as_f64().unwrap() < -70.0;
    let samples: Vec<_> = glitches.iter().filter(full_scale).map(|glitch| glitch["sample"].as_u64().unwrap()).collect();
    assert_eq!(samples, (0..9).map(|k| 174 + 210 * k).collect::<Vec<_>>());
    assert_eq!(answer(&lab, " --keep-glitches")["verdict"], "unexplained");
}

fn floor(answer: &Value, channel: &str) -> f64 {
    let floors = answer["noise_floor"].as_array().unwrap();
    floors.iter().find(|floor| floor["channel"] == channel).unwrap()["sigma"].as_f64().unwrap()
}

#[test]
fn each_torque_has_its_own_floor_and_a_weak_joint_is_not_overlooked() {
    let lab = lab();
    let answer = lab.json("diagnose leg.toml learn.csv --held-out held_out.csv -q");
    let (hip, knee) = (floor(&answer, "tau_hip") / TORQUE_NM[0], floor(&answer, "tau_knee") / TORQUE_NM[1]);
    // Both torques are smoothed over nine samples or more; the motion's noise comes on top.
    assert!((0.3..1.0).contains(&hip) && (0.3..1.0).contains(&knee), "{hip} {knee}");
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
    // Two laws in one torque are told apart: neither bounds the other's probability.
    assert!(!answer["effects"].to_string().contains("same_place"), "{answer}");
    assert!((answer["time_step_s"].as_f64().unwrap() * RATE_HZ - 1.0).abs() < 1e-9);
}

/// No effect of the library couples two joints' positions: the law that is left names the neighbour.
#[test]
fn a_coupled_joint_is_told_as_a_law_over_its_neighbour() {
    let lab = Planted { cable: 0.1, ..Planted::default() }.lab();
    let answer = lab.json("diagnose leg.toml learn.csv --held-out held_out.csv -q");
    assert!(["unexplained", "partly_explained"].contains(&answer["verdict"].as_str().unwrap()), "{answer}");
    let law = &answer["residual_law"];
    assert_eq!((law["site"].as_str(), law["on"].as_str()), (Some("knee"), Some("torque")), "{answer}");
    assert!(law["law"].as_str().unwrap().contains("q_parent"), "{law}");
    assert!(law["explains"].as_f64().unwrap() > 0.8, "{law}");
}

/// A motor that turns with both joints, as in many wrists: its friction and its rotor act on both, and what it does by
/// a joint's own motion is that joint's viscous friction and rotor.
#[test]
fn a_motor_that_turns_with_two_joints_is_named_at_both() {
    let lab = Planted { motor: [0.1, 0.06, 0.004], ..Planted::default() }.lab();
    let answer = lab.json("diagnose leg.toml learn.csv --held-out held_out.csv -q");
    let value = |name: &str| {
        let effects = answer["effects"].as_array().unwrap().iter();
        let all = effects.flat_map(|effect| effect["parameters"].as_array().unwrap().clone());
        all.into_iter().find(|parameter| parameter["name"] == name).and_then(|parameter| parameter["value"].as_f64())
    };
    for (name, truth) in [
        ("parent_coupling.coulomb@knee", 0.1),
        ("parent_coupling.viscous@knee", 0.06),
        ("parent_coupling.inertia@knee", 0.004),
        ("parent_coupling.ratio@knee", 1.0),
        ("coulomb_friction.torque@knee", 0.04),
        ("viscous_friction.coefficient@knee", 0.06),
        ("viscous_friction.coefficient@hip", 0.86),
    ] {
        assert!(value(name).is_some_and(|value| (value / truth - 1.0).abs() < 0.1), "{name}: {answer}");
    }
    assert!(value("child_coupling.viscous@hip").is_some(), "{answer}");
    assert!(!answer["effects"].to_string().contains("asymmetric"), "{answer}");
}

/// The verdict and the names of a diagnosis of the leg.
fn verdict_and_names(answer: &Value) -> (String, Vec<String>) {
    (answer["verdict"].as_str().unwrap().to_owned(), named(answer))
}

/// Friction holds any torque up to its size while a joint stands: what the log shows there depends on how it came to
/// rest, and says nothing of the laws.
#[test]
fn torques_of_joints_that_stand_still_are_left_out() {
    /// Both come to rest between the fourth and the fifth second: what has passed by then, and its two derivatives.
    fn passed(t: f64) -> [f64; 3] {
        match t {
            t if t < 4.0 => [t, 1.0, 0.0],
            t if t < 5.0 => {
                let (sin, cos) = (PI * (t - 4.0)).sin_cos();
                [4.0 + 0.5 * (t - 4.0 + sin / PI), 0.5 * (1.0 + cos), -0.5 * PI * sin]
            }
            _ => [4.5, 0.0, 0.0],
        }
    }
    let motions = |t: f64, phase: f64| {
        let [s, ds, dds] = passed(t);
        [(2.1, 4.7), (2.9, 5.3)].map(|w| {
            let [q, dq, ddq] = swing(s, phase, w);
            [q, dq * ds, ddq * ds * ds + dq * dds]
        })
    };
    let lab = Planted { motions, held: |t| 0.03 * (5.0 - t).exp() - 0.015, ..Planted::default() }.lab();
    let left_out = lab.json("diagnose leg.toml learn.csv --held-out held_out.csv -q -o found.toml");
    let true_names = ["armature@hip", "coulomb_friction@knee", "viscous_friction@hip"].map(str::to_owned);
    assert_eq!(verdict_and_names(&left_out), ("effect_missing".to_owned(), true_names.to_vec()), "{left_out}");
    let told = String::from_utf8(lab.run("compare leg.toml held_out.csv").stderr).unwrap();
    assert!(told.contains("stands still") && told.contains("hip (3."), "{told}");
    let knee = |options: &str| {
        let compared = lab.json(&format!("compare found.toml learn.csv -q{options}"));
        let mut channels = compared["channels"].as_array().unwrap().iter();
        let knee = channels.find(|channel| channel["name"] == "tau_knee").unwrap();
        (knee["samples"].as_u64().unwrap(), knee["chi"].as_f64().unwrap())
    };
    let (left_out, kept) = (knee(""), knee(" --set channels.keep_standstill=true"));
    assert!(kept.0 > left_out.0 + 300 && kept.1 > 1.1 && left_out.1 < 1.0, "{left_out:?} {kept:?}");
}

/// Without held-out logs the last part of each is held out: the last part in which the robot moves.
#[test]
fn a_log_that_ends_at_rest_is_judged_where_it_moves() {
    let motions = |t: f64, phase: f64| {
        let moves = if t < 5.0 { 1.0 } else { 0.0 };
        [(2.1, 4.7), (2.9, 5.3)].map(|w| {
            let [q, dq, ddq] = swing(t.min(5.0), phase, w);
            [q, moves * dq, moves * ddq]
        })
    };
    let lab = Planted { motions, ..Planted::default() }.lab();
    let answer = lab.json("diagnose leg.toml learn.csv -q");
    assert_eq!(answer["error_ladder"][0]["held_out"].as_f64().map(|error| error > 10.0), Some(true), "{answer}");
    assert!(named(&answer).contains(&"viscous_friction@hip".to_owned()), "{answer}");
}

/// Where both joints move together in the training log and against each other in the held-out one, friction at the
/// knee and its coupling to the hip are only confirmed beside each other.
#[test]
fn a_coupling_that_the_training_log_shows_as_friction_is_named() {
    let motions = |t: f64, phase: f64| {
        let (hip, own) = (swing(t, phase, (2.1, 4.7)), swing(t, phase, (2.9, 5.3)));
        let with = if phase == 0.0 { 1.0 } else { -1.8 };
        [hip, [0, 1, 2].map(|k| with * hip[k] + 0.35 * own[k])]
    };
    let lab = Planted { motor: [0.1, 0.06, 0.0], motions, ..Planted::default() }.lab();
    let answer = lab.json("diagnose leg.toml learn.csv --held-out held_out.csv -q");
    let (verdict, names) = verdict_and_names(&answer);
    assert!(names.contains(&"parent_coupling@knee".to_owned()) && verdict != "unexplained", "{answer}");
    let has = |law: &str| names.iter().any(|name| name.contains(law) && name.ends_with("friction@knee"));
    assert!(has("coulomb") || has("asymmetric"), "{answer}");
    let error = &answer["error_ladder"].as_array().unwrap().last().unwrap()["held_out"];
    assert!(error.as_f64().unwrap() < 1.5, "{answer}");
}

/// A wrong sign of a torque is told from everything else. A torque constant that is not the drive's follows from links
/// that are known; what else could be heavier is not asked here.
#[test]
fn a_sign_of_a_torque_is_named_and_its_scale_fitted() {
    let lab = Lab::new();
    lab.write("leg.urdf", URDF);
    lab.write("leg.toml", MODEL);
    let record_with = |scale: &str| {
        let scaled = format!("{MODEL}{HIDDEN}\n[[effects]]\neffect = \"torque_scale\"\n{scale}\n");
        lab.write("truth.toml", &scaled);
        record(&lab, "learn", 0.0);
        record(&lab, "held_out", 2.0);
    };
    record_with("site = \"knee\"\nerror = -2.0");
    let answer = lab.json("diagnose leg.toml learn.csv --held-out held_out.csv -q");
    let effects = answer["effects"].as_array().unwrap();
    let scale = effects.iter().find(|effect| effect["effect"] == "torque_scale").unwrap();
    assert_eq!(scale["site"], "knee", "{answer}");
    let error = scale["parameters"][0]["value"].as_f64().unwrap();
    assert!((error + 2.0).abs() < 0.05 && effects.len() == 4, "{answer}");

    record_with("site = \"hip\"\nerror = 0.15");
    let others = "--add viscous_friction@hip --add armature@hip --add coulomb_friction@knee";
    let fit = lab.json(&format!("fit leg.toml learn.csv --add torque_scale@hip {others} -q"));
    let parameters = fit["parameters"].as_array().unwrap();
    let error = parameters.iter().find(|parameter| parameter["name"] == "torque_scale.error@hip").unwrap();
    assert!((error["value"].as_f64().unwrap() - 0.15).abs() < 0.02, "{fit}");
}

/// The effect and its law as a formula require the same torque.
#[test]
fn a_coupling_equals_its_law() {
    let lab = Lab::new();
    lab.write("leg.urdf", URDF);
    let coupling =
        "effect = \"parent_coupling\"\nsite = \"knee\"\ncoulomb = 0.4\nviscous = 0.2\ninertia = 0.05\nratio = -0.7\n";
    let law = "-0.4*tanh((dq - 0.7*dq_parent)/0.005) - 0.2*dq_parent - 0.05*ddq_parent";
    let formula = format!("effect = \"formula\"\nsite = \"knee\"\non = \"torque\"\nlaw = \"{law}\"\n");
    let required = |effect: &str| {
        lab.write("truth.toml", &format!("{MODEL}\n[[effects]]\n{effect}"));
        record(&lab, "log", 0.3);
        let table = lab.read("torque.csv");
        let column = table.lines().next().unwrap().split(',').position(|name| name == "tau_knee").unwrap();
        let cell = |line: &str| line.split(',').nth(column).unwrap().parse::<f64>().unwrap_or(f64::NAN);
        table.lines().skip(1).map(cell).collect::<Vec<f64>>()
    };
    let (one, other) = (required(coupling), required(&formula));
    let apart = one.iter().zip(&other).map(|(a, b)| (a - b).abs()).filter(|d| d.is_finite()).fold(0.0, f64::max);
    assert!(apart < 1e-6 && one.iter().any(|torque| torque.abs() > 0.5), "{apart}");
    lab.write("servo.toml", &MODEL.replace("\"prescribed\"", "\"position\"\nkp = 10.0\nkd = 0.1"));
    let row = |i: u32| (0.01 * f64::from(i), 0.3 * (0.05 * f64::from(i)).sin());
    let rows: String = (0..200).map(row).map(|(t, q)| format!("{t},{q},{q},{q},{q}\n")).collect();
    lab.write("servo.csv", &format!("t,q_hip,q_knee,cmd_hip,cmd_knee\n{rows}"));
    let refused = lab.run("fit servo.toml servo.csv --add parent_coupling@knee -q");
    assert!(
        !refused.status.success() && String::from_utf8_lossy(&refused.stderr).contains("prescribed"),
        "{refused:?}"
    );
}

/// A log of what `truth.toml` requires, with noise. Simulated torques are smoothed: friction's steps are rounded.
fn record(lab: &Lab, name: &str, phase: f64) {
    let mut motion = "t,q_hip,q_knee\n".to_owned();
    let at = |i: u32| {
        let t = f64::from(i) / RATE_HZ;
        (t, swing(t, phase, (2.1, 4.7))[0], swing(t, phase, (2.9, 5.3))[0])
    };
    for (t, hip, knee) in (0..2 * SAMPLES).map(at) {
        writeln!(motion, "{t},{hip},{knee}").unwrap();
    }
    lab.write("motion.csv", &motion);
    lab.ok("simulate truth.toml --log motion.csv -q --overwrite -o torque.csv");
    let required = lab.read("torque.csv");
    let header: Vec<&str> = required.lines().next().unwrap().split(',').collect();
    let columns = ["tau_hip", "tau_knee"].map(|name| header.iter().position(|h| *h == name).unwrap());
    let mut log = "t,q_hip,q_knee,tau_hip,tau_knee\n".to_owned();
    for (i, line) in (0..2 * SAMPLES).zip(required.lines().skip(1)) {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
        let (t, hip, knee) = at(i);
        let noise = |k: usize, sigma: f64| sigma * noise(i, phase + 3.0 * k as f64);
        let (q_hip, q_knee) = (hip + noise(0, ENCODER_RAD), knee + noise(1, ENCODER_RAD));
        let (tau_hip, tau_knee) = (cells[columns[0]] + noise(2, TORQUE_NM[0]), cells[columns[1]] + noise(3, 0.02));
        writeln!(log, "{t},{q_hip},{q_knee},{tau_hip},{tau_knee}").unwrap();
    }
    lab.write(&format!("{name}.csv"), &log);
}

/// The floors are what the truth leaves.
#[test]
fn the_true_model_leaves_its_noise_floors() {
    let lab = lab();
    for noise in ["", "\n[noise]\nchannels = { tau_hip = 0.1, tau_knee = 0.004 }\n"] {
        lab.write("true.toml", &format!("{MODEL}{noise}{HIDDEN}"));
        let document = lab.json("compare true.toml learn.csv");
        for channel in document["channels"].as_array().unwrap() {
            assert!((0.85..1.15).contains(&channel["chi"].as_f64().unwrap()), "{noise} {channel}");
        }
    }
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
fn a_report_plays_the_given_motion_and_colours_joints_by_their_torques() {
    let lab = lab();
    lab.ok("compare leg.toml learn.csv -q --report leg.html");
    let html = lab.read("leg.html");
    assert!(html.contains("The motion of hip, knee is given to the model"));
    let errors = html.split("\"errors\":[[").nth(1).unwrap();
    // At the ends no torques are compared.
    let worst = errors.split([',', ']']).take(40).filter_map(|error| error.parse::<f64>().ok()).fold(0.0, f64::max);
    assert!(worst > 2.0, "{worst}");
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

/// More samples than a prescribed motion is followed at are taken as means, unless the model asks for all.
#[test]
fn a_fast_log_is_taken_as_means_and_says_so() {
    let lab = Lab::new();
    lab.write("leg.urdf", URDF);
    let mut log = "t,q_hip,q_knee,tau_hip,tau_knee\n".to_owned();
    for i in 0..3000 {
        let t = f64::from(i) / 1000.0;
        let (hip, knee) = (swing(t, 0.0, (2.1, 4.7)), swing(t, 0.0, (2.9, 5.3)));
        writeln!(log, "{t},{},{},{},{}", hip[0], knee[0], 0.1 * hip[1], 0.1 * noise(i, 0.5)).unwrap();
    }
    lab.write("fast.csv", &log);
    lab.write("leg.toml", MODEL);
    // Lost readings of torque and motion are filled: no mean of five is lost with them.
    lab.edit("fast.csv", "lost.csv", |row, cells| {
        match row % 50 {
            20 | 21 => cells[3].clear(),
            40 => cells[2].clear(),
            _ => {}
        }
        true
    });
    let samples = |log: &str| lab.json(&format!("compare leg.toml {log}"))["channels"][0]["samples"].clone();
    assert_eq!(samples("lost.csv"), samples("fast.csv"));
    for (control, told) in [("", true), ("\n[simulation]\ncontrol_s = 0.001\n", false)] {
        lab.write("leg.toml", &format!("{MODEL}{control}"));
        let output = lab.run("compare leg.toml fast.csv --json");
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(text.contains("means of 5 samples, 200 instead of 1000 per second"), told, "{text}");
        let document: Value = serde_json::from_slice(&output.stdout).unwrap();
        let samples = document["channels"][0]["samples"].as_u64();
        assert!(samples.is_none_or(|samples| (samples < 700) == told), "{document}");
    }
}
