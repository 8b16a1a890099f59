//! Base parameters of an arm of motion and torque: what its logs can tell about masses, moments, inertias and friction.

use crate::lab::{Lab, noise};
use serde_json::Value;
use std::f64::consts::TAU;
use std::fmt::Write;

const MODEL: &str = r#"name = "arm"

[robot]
urdf = "URDF"
base = "fixed"

[actuators."*"]
kind = "prescribed"
"#;

/// An arm of three joints with a tool that is bolted on, and how far its links are from what the model's file says.
fn urdf(wrong: f64) -> String {
    let link = |name: &str, mass: f64, com: [f64; 3], moments: [f64; 3]| {
        let ([x, y, z], [a, b, c]) = (com, moments);
        format!(
            "<link name=\"{name}\"><inertial><origin xyz=\"{} {y} {z}\"/><mass value=\"{}\"/><inertia ixx=\"{a}\" \
             iyy=\"{}\" izz=\"{c}\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>\n",
            x * (1.0 + wrong),
            mass * (1.0 - wrong),
            b * (1.0 + wrong)
        )
    };
    let links = [
        link("column", 5.0, [0.01, 0.02, 0.1], [0.05, 0.05, 0.04]),
        link("upper", 6.0, [0.15, 0.01, 0.02], [0.02, 0.08, 0.085]),
        link("forearm", 3.0, [0.12, -0.01, 0.0], [0.01, 0.03, 0.032]),
        link("tool", 0.5, [0.0, 0.0, 0.04], [0.001, 0.001, 0.0005]),
    ];
    let joint = |name: &str, kind: &str, [parent, child]: [&str; 2], xyz: &str, axis: &str| {
        format!(
            "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <origin xyz=\"{xyz}\"/><axis xyz=\"{axis}\"/>\
             <limit lower=\"-3\" upper=\"3\" effort=\"200\" velocity=\"9\"/></joint>\n"
        )
    };
    let joints = [
        joint("waist", "revolute", ["base", "column"], "0 0 0.2", "0 0 1"),
        joint("shoulder", "revolute", ["column", "upper"], "0.05 0 0.2", "0 1 0"),
        joint("elbow", "revolute", ["upper", "forearm"], "0.3 0 0", "0 1 0"),
        joint("flange", "fixed", ["forearm", "tool"], "0.25 0 0", "1 0 0"),
    ];
    format!("<robot name=\"arm\"><link name=\"base\"/>\n{}{}</robot>\n", links.concat(), joints.concat())
}

const JOINTS: [&str; 3] = ["waist", "shoulder", "elbow"];
const RATE_HZ: f64 = 200.0;
const SAMPLES: u32 = 2400;
const VISCOUS: [f64; 3] = [3.0, 4.0, 1.5];
const COULOMB: [f64; 3] = [5.0, 6.0, 2.0];
const ROTOR: [f64; 3] = [0.4, 0.5, 0.1];
const OFFSET: [f64; 3] = [0.0, 0.8, -0.3];
const ENCODER_RAD: f64 = 1e-5;
const TORQUE_NM: [f64; 3] = [1.0, 1.0, 0.4];

/// Angle, velocity and acceleration of a joint.
fn swing(t: f64, phase: f64, joint: usize, still: bool) -> [f64; 3] {
    let turns = [(0.5, 1.3), (0.3, 2.9), (0.15, 4.1)];
    let mut motion = [[0.2, -0.7, 0.9][joint], 0.0, 0.0];
    for (k, (a, w)) in turns.into_iter().enumerate().filter(|_| !still) {
        let (w, p) = (w * (1.0 + 0.07 * joint as f64), phase * (k + 1) as f64 + 2.0 * joint as f64);
        motion[0] += a * (w * t + p).sin();
        motion[1] += a * w * (w * t + p).cos();
        motion[2] -= a * w * w * (w * t + p).sin();
    }
    motion
}

/// What the true arm's motors did, without noise.
struct Recording {
    motion: Vec<[[f64; 3]; 3]>,
    torques: Vec<[f64; 3]>,
}

/// Rigid torques are those of the true arm's file; friction, rotors and offsets come on top.
fn record(lab: &Lab, phase: f64, still: &[usize]) -> Recording {
    let at = |i: u32| {
        let t = f64::from(i) / RATE_HZ;
        std::array::from_fn(|j| swing(t, phase, j, still.contains(&j)))
    };
    let motion: Vec<[[f64; 3]; 3]> = (0..SAMPLES).map(at).collect();
    let mut csv = "t,q_waist,q_shoulder,q_elbow\n".to_owned();
    for (i, [a, b, c]) in motion.iter().enumerate() {
        writeln!(csv, "{},{},{},{}", i as f64 / RATE_HZ, a[0], b[0], c[0]).unwrap();
    }
    lab.write("motion.csv", &csv);
    lab.ok("simulate true.toml --log motion.csv -q --overwrite -o torque.csv");
    let required = lab.read("torque.csv");
    let header: Vec<&str> = required.lines().next().unwrap().split(',').collect();
    let columns = JOINTS.map(|joint| header.iter().position(|h| *h == format!("tau_{joint}")).unwrap());
    let torques = required.lines().skip(1).zip(&motion).map(|(line, motion)| {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
        std::array::from_fn(|j| {
            let [_, dq, ddq] = motion[j];
            let dry = if dq == 0.0 { 0.0 } else { COULOMB[j] * dq.signum() };
            cells[columns[j]] + VISCOUS[j] * dq + dry + ROTOR[j] * ddq + OFFSET[j]
        })
    });
    Recording { torques: torques.collect(), motion }
}

impl Recording {
    /// The log with noise of a seed.
    fn write(&self, lab: &Lab, name: &str, seed: f64) {
        let mut log = "t,q_waist,q_shoulder,q_elbow,tau_waist,tau_shoulder,tau_elbow\n".to_owned();
        for (i, (motion, torques)) in (0..).zip(self.motion.iter().zip(&self.torques)) {
            let noise = |k: usize, sigma: f64| sigma * noise(i, seed + 3.0 * k as f64);
            let q = std::array::from_fn::<f64, 3, _>(|j| motion[j][0] + noise(j, ENCODER_RAD));
            let tau = std::array::from_fn::<f64, 3, _>(|j| torques[j] + noise(3 + j, TORQUE_NM[j]));
            let cells = q.iter().chain(&tau).map(f64::to_string).collect::<Vec<_>>();
            writeln!(log, "{},{}", f64::from(i) / RATE_HZ, cells.join(",")).unwrap();
        }
        lab.write(name, &log);
    }
}

/// A true arm, and a model whose masses, centres and inertias are 20 % off.
fn arm() -> Lab {
    let lab = Lab::new();
    for (name, wrong) in [("true", 0.0), ("arm", 0.2)] {
        lab.write(&format!("{name}.urdf"), &urdf(wrong));
        lab.write(&format!("{name}.toml"), &MODEL.replace("URDF", &format!("{name}.urdf")));
    }
    lab
}

fn combinations(answer: &Value) -> Vec<&Value> {
    answer["base_parameters"]["combinations"].as_array().unwrap().iter().collect()
}

fn f(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

/// The true value of a combination: that of the true arm's file, and what is no part of any file.
fn truth(combination: &Value, of_file: &Value) -> f64 {
    let beside = |part: &Value| {
        let (what, site) = part["parameter"].as_str().unwrap().split_once('@').unwrap();
        let joint = JOINTS.iter().position(|joint| *joint == site);
        let values = match what {
            "viscous" => VISCOUS,
            "coulomb" => COULOMB,
            "rotor" => ROTOR,
            "offset" => OFFSET,
            _ => return 0.0,
        };
        f(&part["coefficient"]) * values[joint.unwrap()]
    };
    f(&of_file["model"]) + combination["parts"].as_array().unwrap().iter().map(beside).sum::<f64>()
}

const ASK: &str = "learn.csv --held-out held_out.csv --base-parameters -q";

/// Estimates are the truth to their deviations, and these are what the estimates of other noise scatter by.
#[test]
fn an_arm_with_wrong_inertias_has_the_true_base_parameters() {
    const SEEDS: u32 = 20;
    let lab = arm();
    let [learn, held_out] = [0.3, 1.9].map(|phase| record(&lab, phase, &[]));
    let mut scores: Vec<Vec<f64>> = Vec::new();
    let mut of_file = Value::Null;
    for seed in 0..SEEDS {
        learn.write(&lab, "learn.csv", TAU * f64::from(seed));
        held_out.write(&lab, "held_out.csv", 1.0 + TAU * f64::from(seed));
        if seed == 0 {
            of_file = lab.json(&format!("fit true.toml {ASK}"));
        }
        let answer = lab.json(&format!("fit arm.toml {ASK}"));
        let pairs = combinations(&answer).into_iter().zip(combinations(&of_file));
        let score = |(found, of_file): (&Value, &Value)| {
            assert_eq!(found["name"], of_file["name"]);
            (f(&found["value"]) - truth(found, of_file)) / f(&found["sd"])
        };
        scores.push(pairs.map(score).collect());
        for joint in answer["base_parameters"]["remaining"].as_array().unwrap() {
            assert!(f(&joint["train_percent"]) < 8.0 && f(&joint["held_out_percent"]) < 8.0, "{joint}");
        }
        assert_ne!(answer["base_parameters"]["possible"]["membership"], "contradicted", "{answer}");
    }
    let names: Vec<&str> = combinations(&of_file).iter().map(|c| c["name"].as_str().unwrap()).collect();
    assert!(names.contains(&"mass*com_x@upper + 0.3*mass@forearm"), "{names:?}");
    assert!(names.contains(&"rotor@elbow") && names.contains(&"inertia_yy@upper + 0.09*mass@forearm + rotor@shoulder"));
    let spread = |k: usize| (scores.iter().map(|run| run[k] * run[k]).sum::<f64>() / f64::from(SEEDS)).sqrt();
    let spreads: Vec<f64> = (0..names.len()).map(spread).collect();
    let all = (spreads.iter().map(|s| s * s).sum::<f64>() / names.len() as f64).sqrt();
    assert!((0.85..1.25).contains(&all) && spreads.iter().all(|s| (0.5..1.6).contains(s)), "{all} {spreads:?}");
    // Of 500 independent scores, one would be beyond 3.3.
    let far = scores.iter().flatten().filter(|z| z.abs() > 3.3).count();
    assert!(far <= 5, "{far}: {scores:?}");
}

/// What a motion does not excite acts with something else, or not at all.
#[test]
fn what_a_still_joint_hides_is_regrouped_or_has_no_effect() {
    let lab = arm();
    for (name, phase) in [("learn.csv", 0.3), ("held_out.csv", 1.9)] {
        record(&lab, phase, &[2]).write(&lab, name, phase);
    }
    let answer = lab.json(&format!("fit arm.toml {ASK}"));
    let found = combinations(&answer);
    let leads = |name: &str| found.iter().find(|c| c["parts"][0]["parameter"] == name).copied();
    let moving = leads("viscous@shoulder").unwrap();
    assert!((f(&moving["value"]) - VISCOUS[1]).abs() < 4.0 * f(&moving["sd"]), "{moving}");
    let none: Vec<&str> =
        answer["base_parameters"]["not_identifiable"].as_array().unwrap().iter().map(|n| n.as_str().unwrap()).collect();
    assert!(none.contains(&"mass@column") && none.contains(&"inertia_xx@column"), "{none:?}");
    // The torques of a joint that stands are left out.
    assert!(leads("viscous@elbow").is_none() && none.contains(&"viscous@elbow"), "{none:?}");
    // With them, its encoder's noise is all that moves: the deviation tells.
    let kept = lab.json(&format!("fit arm.toml {ASK} --set channels.keep_standstill=true"));
    let still = combinations(&kept).into_iter().find(|c| c["parts"][0]["parameter"] == "viscous@elbow").unwrap();
    assert!(f(&still["sd"]) > 3.0 * VISCOUS[2], "{still}");
}

/// The pseudo-inertia of a body as a file states it has positive leading minors.
fn assert_possible(body: &Value) {
    let numbers = |key: &str| body[key].as_array().unwrap().iter().map(f).collect::<Vec<f64>>();
    let ([xx, yy, zz, xy, xz, yz], mass) = (numbers("inertia_kg_m2").try_into().unwrap(), f(&body["mass_kg"]));
    let half = 0.5 * (xx + yy + zz);
    let (a, b, c) = (half - xx, half - yy, half - zz);
    let minors = [a, a * b - xy * xy, a * (b * c - yz * yz) - xy * (xy * c + yz * xz) - xz * (xy * yz + b * xz)];
    assert!(mass > 0.0 && minors.iter().all(|minor| *minor > 0.0), "{minors:?} {body}");
}

/// Much noise, little motion: most combinations are hardly known, and the model that is written is one of rigid bodies.
#[test]
fn the_written_model_has_possible_bodies_and_leaves_noise() {
    let lab = arm();
    for (name, phase) in [("learn.csv", 0.3), ("held_out.csv", 1.9)] {
        let mut recording = record(&lab, phase, &[]);
        for (i, torques) in (0..).zip(&mut recording.torques) {
            torques.iter_mut().enumerate().for_each(|(j, tau)| *tau += 12.0 * noise(i, phase + 20.0 + j as f64));
        }
        recording.write(&lab, name, phase);
    }
    let answer = lab.json(&format!("fit arm.toml {ASK} -o fitted.toml"));
    let possible = &answer["base_parameters"]["possible"];
    possible["links"].as_array().unwrap().iter().for_each(assert_possible);
    assert_ne!(possible["membership"], "contradicted", "{possible}");
    let text = lab.read("fitted.toml");
    assert!(text.contains("[links.forearm]") && text.contains("[links.tool]"), "{text}");
    // The combinations of the written model are those of the possible bodies.
    let again = lab.json(&format!("fit fitted.toml {ASK}"));
    assert!((f(&again["train"]) - f(&possible["train"])).abs() < 0.02, "{} {}", again["train"], possible["train"]);
    let compared = lab.json("compare fitted.toml held_out.csv");
    for channel in compared["channels"].as_array().unwrap() {
        assert!(f(&channel["chi"]) < 1.2, "{channel}");
    }
    let rows = combinations(&again).into_iter().zip(combinations(&answer));
    for (written, estimate) in rows.filter(|(written, _)| !written["name"].as_str().unwrap().contains("offset")) {
        let far = (f(&written["model"]) - f(&estimate["value"])).abs() / f(&estimate["sd"]);
        assert!(far < 3.0, "{written} {estimate}");
    }
}

#[test]
fn what_cannot_be_asked_ends_in_a_remedy() {
    let lab = arm();
    record(&lab, 0.3, &[]).write(&lab, "learn.csv", 0.0);
    lab.write("servo.toml", &lab.read("arm.toml").replace("\"prescribed\"", "\"position\"\nkp = 100.0"));
    lab.edit("learn.csv", "commands.csv", |k, cells| {
        cells.iter_mut().filter(|_| k == 0).for_each(|cell| *cell = cell.replace("tau_", "cmd_"));
        true
    });
    let message = lab.complaint("fit servo.toml commands.csv --base-parameters -q");
    assert!(message.contains("elbow") && message.contains("prescribed"), "{message}");
    let free = "\n[parameters]\n\"length@upper\" = { relative = [0.9, 1.1] }\n";
    lab.write("long.toml", &(lab.read("arm.toml") + free));
    assert!(lab.complaint("fit long.toml learn.csv --base-parameters -q").contains("length@upper"));
    let link = "mass_kg = 1.0\ncom_m = [0.0, 0.0, 0.0]\ninertia_kg_m2 = [0.1, 0.1, 0.1, 0.0, 0.0, 0.0]\n";
    lab.write("unknown.toml", &format!("{}\n[links.foream]\n{link}", lab.read("arm.toml")));
    let message = lab.complaint("compare unknown.toml learn.csv");
    assert!(message.contains("foream") && message.contains("forearm"), "{message}");
    lab.write("lighter.toml", &format!("{}\n[links.forearm]\n{}", lab.read("arm.toml"), link.replace("1.0", "-1.0")));
    assert!(lab.complaint("compare lighter.toml learn.csv").contains("not negative"));
}
