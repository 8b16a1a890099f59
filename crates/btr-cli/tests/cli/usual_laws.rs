//! Arms of whose joints the URDF states nothing: friction and rotors at all of them, beside what else is missing.

use crate::lab::{Lab, named, noise};
use serde_json::Value;
use std::fmt::Write;

const JOINTS: [&str; 3] = ["hip", "knee", "ankle"];
/// Length in m, mass in kg, centre of mass in m along the link, and inertia about it in kg·m².
const LINKS: [[f64; 4]; 3] = [[0.42, 9.0, 0.19, 0.16], [0.36, 5.0, 0.15, 0.07], [0.2, 1.6, 0.07, 0.008]];
/// Frequencies of each joint's motion in rad/s.
const MOTIONS: [[f64; 3]; 3] = [[0.7, 2.1, 3.4], [0.9, 2.4, 4.1], [0.8, 1.9, 3.7]];
const AMPLITUDES: [f64; 3] = [0.5, 0.3, 0.12];
const TORQUE_NM: [f64; 3] = [0.5, 0.2, 0.05];
const ENCODER_RAD: f64 = 1e-5;
const RATE_HZ: f64 = 200.0;
const SAMPLES: u32 = 3000;

const MODEL: &str = r#"name = "arm"

[robot]
urdf = "arm.urdf"
base = "fixed"

[actuators."*"]
kind = "prescribed"
"#;

const LOAD: &str = r#"
[[effects]]
effect = "tool_load"
site = "ankle_link"
mass = 1.7
x = 0.14
y = 0.0
z = 0.03
"#;

/// Dry friction in N·m, viscous friction in N·m·s/rad and rotor in kg·m² of each joint; the knee has no rotor.
const DRIVES: [[f64; 3]; 3] = [[12.0, 9.0, 0.8], [5.5, 3.2, 0.0], [1.4, 0.45, 0.06]];

fn urdf() -> String {
    let mut text = r#"<robot name="arm"><link name="base"/>"#.to_owned();
    let (mut parent, mut x) = ("base".to_owned(), 0.0);
    for (joint, [length, mass, com, inertia]) in JOINTS.iter().zip(LINKS) {
        let ixx = 0.3 * inertia;
        write!(
            text,
            r#"<link name="{joint}_link"><inertial><origin xyz="{com} 0 0"/><mass value="{mass}"/>
            <inertia ixx="{ixx}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial></link>
            <joint name="{joint}" type="revolute"><parent link="{parent}"/><child link="{joint}_link"/>
            <origin xyz="{x} 0 0"/><axis xyz="0 1 0"/>
            <limit lower="-3.1" upper="3.1" effort="300" velocity="8"/></joint>"#
        )
        .unwrap();
        (parent, x) = (format!("{joint}_link"), length);
    }
    text + "</robot>\n"
}

/// A joint's position, velocity and acceleration at a time of a log that has a phase.
fn swing(joint: usize, t: f64, phase: f64) -> [f64; 3] {
    let mut motion = [[-0.7, 0.9, 0.3][joint], 0.0, 0.0];
    for (k, (w, amplitude)) in MOTIONS[joint].into_iter().zip(AMPLITUDES).enumerate() {
        let (sin, cos) = (w * t + phase * (1.0 + k as f64) + joint as f64).sin_cos();
        motion[0] += amplitude * sin;
        motion[1] += amplitude * w * cos;
        motion[2] -= amplitude * w * w * sin;
    }
    motion
}

/// The same, but the hip only goes forward, and stops for an instant every 3 s.
fn grazing(joint: usize, t: f64, phase: f64) -> [f64; 3] {
    let (w, amplitude) = (2.1, 0.09);
    let (sin, cos) = (w * t + phase).sin_cos();
    let hip = [amplitude * (w * t - sin) - 1.4, amplitude * w * (1.0 - cos), amplitude * w * w * sin];
    if joint == 0 { hip } else { swing(joint, t, phase) }
}

/// A joint's position, velocity and acceleration, by its number, the time and the log's phase.
type Motion = fn(usize, f64, f64) -> [f64; 3];

/// A lab with two logs of an arm with these drives and, in model language, what else its URDF lacks; its encoders have
/// this noise.
fn planted(drives: [[f64; 3]; 3], more: &str, encoder_rad: f64) -> Lab {
    planted_in(swing, drives, more, encoder_rad)
}

/// The same in another motion.
fn planted_in(motion: Motion, drives: [[f64; 3]; 3], more: &str, encoder_rad: f64) -> Lab {
    let lab = Lab::new();
    lab.write("arm.urdf", &urdf());
    lab.write("arm.toml", MODEL);
    lab.write("links.toml", &format!("{MODEL}{more}"));
    for (name, phase) in [("learn", 0.4), ("held_out", 2.9)] {
        write_log(&lab, name, |joint, t| motion(joint, t, phase), (phase, drives, encoder_rad));
    }
    lab
}

/// A log of what the links require, and on top what the drives take, with noise. Simulated torques are smoothed, and
/// friction's steps are not.
fn write_log(
    lab: &Lab,
    name: &str,
    at: impl Fn(usize, f64) -> [f64; 3],
    (phase, drives, encoder_rad): (f64, [[f64; 3]; 3], f64),
) {
    let mut motion = "t,q_hip,q_knee,q_ankle\n".to_owned();
    for t in (0..SAMPLES).map(|i| f64::from(i) / RATE_HZ) {
        let [hip, knee, ankle] = [0, 1, 2].map(|joint| at(joint, t)[0]);
        writeln!(motion, "{t},{hip},{knee},{ankle}").unwrap();
    }
    lab.write("motion.csv", &motion);
    lab.ok("simulate links.toml --log motion.csv -q --overwrite -o torque.csv");
    let required = lab.read("torque.csv");
    let header: Vec<&str> = required.lines().next().unwrap().split(',').collect();
    let columns = JOINTS.map(|joint| header.iter().position(|h| *h == format!("tau_{joint}")).unwrap());
    let mut log = "t,q_hip,q_knee,q_ankle,tau_hip,tau_knee,tau_ankle\n".to_owned();
    for (i, line) in (0..SAMPLES).zip(required.lines().skip(1)) {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
        let t = f64::from(i) / RATE_HZ;
        let noise = |k: usize, sigma: f64| sigma * noise(i, phase + 3.0 * k as f64);
        let motions = [0, 1, 2].map(|joint| at(joint, t));
        write!(log, "{t}").unwrap();
        (0..3).for_each(|j| write!(log, ",{}", motions[j][0] + noise(j, encoder_rad)).unwrap());
        for (j, ([_, dq, ddq], [dry, viscous, rotor])) in motions.into_iter().zip(drives).enumerate() {
            let drive = dry * dq.signum() + viscous * dq + rotor * ddq;
            write!(log, ",{}", cells[columns[j]] + drive + noise(3 + j, TORQUE_NM[j])).unwrap();
        }
        log.push('\n');
    }
    lab.write(&format!("{name}.csv"), &log);
}

fn diagnosis(lab: &Lab) -> Value {
    lab.json("diagnose arm.toml learn.csv --held-out held_out.csv -q")
}

/// Names of the frictions and rotors of some drives.
fn of_drives(drives: [[f64; 3]; 3]) -> Vec<String> {
    let mut names = Vec::new();
    for (k, law) in ["coulomb_friction", "viscous_friction", "armature"].iter().enumerate() {
        let has = |joint: &usize| drives[*joint][k] > 0.0;
        names.extend((0..3).filter(has).map(|joint| format!("{law}@{}", JOINTS[joint])));
    }
    names.sort();
    names
}

/// One after the other, a load that only bends the arm takes the place of friction, and friction that of a load.
#[test]
fn a_load_is_found_beside_friction_and_rotors_of_all_joints() {
    let lab = planted(DRIVES, LOAD, ENCODER_RAD);
    let answer = diagnosis(&lab);
    let mut truth = of_drives(DRIVES);
    truth.push("tool_load@ankle_link".to_owned());
    truth.sort();
    assert_eq!(named(&answer), truth, "{answer}");
    let effects = answer["effects"].as_array().unwrap().iter();
    let parameters: Vec<&Value> = effects.flat_map(|effect| effect["parameters"].as_array().unwrap()).collect();
    let value = |name: &str| parameters.iter().find(|p| p["name"] == name).unwrap()["value"].as_f64().unwrap();
    assert!((value("tool_load.mass@ankle_link") / 1.7 - 1.0).abs() < 0.02, "{answer}");
    assert!((value("tool_load.x@ankle_link") - 0.14).abs() < 0.005, "{answer}");
    assert!((value("armature.inertia@ankle") / 0.06 - 1.0).abs() < 0.05, "{answer}");
    let steps: Vec<&str> =
        answer["error_ladder"].as_array().unwrap().iter().map(|s| s["step"].as_str().unwrap()).collect();
    assert_eq!(steps[1], "+ tool_load@ankle_link", "what the links lack is told first: {steps:?}");
    // Nothing but the motion turns with the first joint: its rotor cannot be told from its link's inertia.
    let alike = |effect: &&Value| !effect["alike"].as_array().unwrap().is_empty();
    let doubtful: Vec<Value> =
        answer["effects"].as_array().unwrap().iter().filter(alike).map(|e| e["site"].clone()).collect();
    assert_eq!(doubtful, ["hip"], "{answer}");
}

/// What is taken for granted at first is not named where the logs do not need it.
#[test]
fn friction_that_is_not_there_is_not_named() {
    let lab = planted([[0.0; 3]; 3], LOAD, ENCODER_RAD);
    assert_eq!(named(&diagnosis(&lab)), ["tool_load@ankle_link"]);
    let only_dry = [[12.0, 0.0, 0.0], [0.0; 3], [0.0, 0.45, 0.0]];
    let lab = planted(only_dry, "", ENCODER_RAD);
    assert_eq!(named(&diagnosis(&lab)), of_drives(only_dry));
}

/// A search that is cut short still says what it cannot tell apart.
#[test]
fn what_was_not_compared_is_not_certain() {
    let spring = "\n[[effects]]\neffect = \"parallel_spring\"\nsite = \"ankle\"\nstiffness = 20.0\nrest = 0.1\n";
    let lab = planted(DRIVES, spring, ENCODER_RAD);
    let answer = lab.json("diagnose arm.toml learn.csv --held-out held_out.csv --max-rollouts 20 -q");
    assert_eq!(answer["cut_short"], true, "{answer}");
    let mut effects = answer["effects"].as_array().unwrap().iter();
    let rotor = effects.find(|effect| effect["effect"] == "armature" && effect["site"] == "hip").unwrap();
    let alike: Vec<&str> = rotor["alike"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    assert!(alike.contains(&"link_inertia@hip_link"), "{rotor}");
    assert!(rotor["probability"].as_f64().unwrap() <= 0.5, "{rotor}");
}

/// The noise of the motion becomes more torque in an arm that carries a load: its floors are those of the fitted model.
#[test]
fn noise_floors_are_those_of_the_model_that_was_found() {
    let lab = planted([[0.0; 3]; 3], LOAD, 4.0 * ENCODER_RAD);
    let floors = |answer: &Value, list: &str, name: &str, size: &str| -> Vec<f64> {
        let of = |joint: &str| {
            let channels = answer[list].as_array().unwrap().iter();
            let channel = channels.clone().find(|channel| channel[name] == format!("tau_{joint}"));
            channel.and_then(|channel| channel[size].as_f64()).unwrap()
        };
        JOINTS.iter().map(|joint| of(joint)).collect()
    };
    let diagnosed = diagnosis(&lab);
    assert_eq!(named(&diagnosed), ["tool_load@ankle_link"], "{diagnosed}");
    let found = floors(&diagnosed, "noise_floor", "channel", "sigma");
    let compared =
        |model: &str| floors(&lab.json(&format!("compare {model} learn.csv -q")), "channels", "name", "noise_floor");
    let (stated, true_floors) = (compared("arm.toml"), compared("links.toml"));
    for joint in 0..3 {
        assert!(found[joint] > 1.15 * stated[joint], "{found:?} beside {stated:?}");
        assert!((found[joint] / true_floors[joint] - 1.0).abs() < 0.02, "{found:?} beside {true_floors:?}");
    }
    let last = diagnosed["error_ladder"].as_array().unwrap().last().unwrap();
    assert_eq!(last["step"], "noise floors of this model", "{diagnosed}");
    assert!(last["held_out"].as_f64().unwrap() < 1.15, "{diagnosed}");
}

/// Where the noise is stated too high, friction that is the same in both directions explains all but noise; one that
/// depends on the direction explains far more, and is named.
#[test]
fn a_law_that_explains_far_more_than_its_parts_takes_their_place() {
    let friction = "coulomb_forward = 12.0\ncoulomb_backward = 12.0\nviscous_forward = 7.0\nviscous_backward = 12.0\n";
    let hidden = format!("\n[[effects]]\neffect = \"asymmetric_friction\"\nsite = \"hip\"\n{friction}");
    let lab = planted([[0.0; 3]; 3], &hidden, ENCODER_RAD);
    lab.write("arm.toml", &format!("{MODEL}\n[noise]\nchannels = {{ tau_hip = 4.0 }}\n"));
    let answer = diagnosis(&lab);
    let steps = answer["error_ladder"].as_array().unwrap();
    let error = |step: &Value| step["train"].as_f64().unwrap();
    let (last, before) = (&steps[steps.len() - 1], &steps[steps.len() - 2]);
    assert_eq!(named(&answer), ["asymmetric_friction@hip"], "{answer}");
    assert_eq!(last["step"], "asymmetric_friction@hip for coulomb_friction@hip + viscous_friction@hip", "{answer}");
    assert!(error(before) < 1.0 && error(last) < 0.93 * error(before), "{answer}");
}

/// Where a velocity grazes zero, the encoder's noise decides the sign of dry friction: what is explained must not look
/// unexplained, and no other friction must be found in its place.
#[test]
fn friction_of_uncertain_sign_is_no_error() {
    let drives = [[12.0, 0.0, 0.0], [0.0; 3], [0.0; 3]];
    let lab = planted_in(grazing, drives, "", 3.0 * ENCODER_RAD);
    let answer = lab.json("diagnose arm.toml learn.csv --held-out held_out.csv -q -o found.toml");
    assert_eq!(named(&answer), ["coulomb_friction@hip"], "{answer}");
    assert_eq!(answer["verdict"], "effect_missing", "{answer}");
    let last = answer["error_ladder"].as_array().unwrap().last().unwrap();
    let left = ["train", "held_out"].map(|logs| last[logs].as_f64().unwrap());
    assert!(left.iter().all(|error| *error < 1.1), "{answer}");
    // Such samples have larger noise floors, and their whole error in N·m.
    let rmse = |channels: &Value, key: &str| {
        let mut channels = channels.as_array().unwrap().iter();
        channels.find(|channel| channel[key] == "tau_hip").unwrap()["rmse"].as_f64().unwrap()
    };
    let compared = lab.json("compare found.toml held_out.csv -q");
    let (told, measured) = (rmse(&answer["remaining"], "channel"), rmse(&compared["channels"], "name"));
    assert!((told / measured - 1.0).abs() < 0.02, "{told} {measured}");
}

/// The clock of a simulation is even and may have fewer ticks than that of the log.
#[test]
fn a_log_whose_clock_no_simulation_shares_is_diagnosed() {
    let drives = [[12.0, 0.0, 0.0], [0.0; 3], [0.0; 3]];
    let lab = planted_in(grazing, drives, "", 3.0 * ENCODER_RAD);
    for log in ["learn.csv", "held_out.csv"] {
        let text = lab.read(log);
        let (header, rows) = text.split_once('\n').unwrap();
        let slower = |(i, row): (usize, &str)| {
            let (t, rest) = row.split_once(',').unwrap();
            let jitter = [0.0, 2e-5, -2e-5][i % 3];
            format!("{},{rest}\n", t.parse::<f64>().unwrap() * RATE_HZ / 199.7 + jitter)
        };
        let rows: String = rows.lines().enumerate().map(slower).collect();
        lab.write(log, &format!("{header}\n{rows}"));
    }
    let answer = diagnosis(&lab);
    assert!(named(&answer).contains(&"coulomb_friction@hip".to_owned()), "{answer}");
    let last = answer["error_ladder"].as_array().unwrap().last().unwrap();
    assert!(last["held_out"].as_f64().unwrap() < 1.2, "{answer}");
}

/// Noise is acceleration that requires no torque: by least squares alone, rotors beside coarse encoders are too small.
#[test]
fn noise_of_the_motion_makes_no_rotor_smaller() {
    let lab = planted(DRIVES, "", 12.0 * ENCODER_RAD);
    let rotors = |answer: &Value| -> Vec<(f64, [f64; 2])> {
        let effects = answer["effects"].as_array().into_iter().flatten();
        let named = effects.flat_map(|effect| effect["parameters"].as_array().unwrap());
        let all: Vec<&Value> = named.chain(answer["parameters"].as_array().into_iter().flatten()).collect();
        let of = |joint: &str| {
            let rotor = all.iter().find(|p| p["name"] == format!("armature.inertia@{joint}")).unwrap();
            (rotor["value"].as_f64().unwrap(), [0, 1].map(|end| rotor["ci95"][end].as_f64().unwrap()))
        };
        ["hip", "ankle"].map(of).to_vec()
    };
    let diagnosed = diagnosis(&lab);
    assert_eq!(named(&diagnosed), of_drives(DRIVES), "{diagnosed}");
    let adds = "--add coulomb_friction --add viscous_friction --add armature";
    let fitted = lab.json(&format!("fit arm.toml learn.csv --held-out held_out.csv {adds} -q"));
    for answer in [&diagnosed, &fitted] {
        for ((value, [least, most]), [_, _, truth]) in rotors(answer).into_iter().zip([DRIVES[0], DRIVES[2]]) {
            assert!(
                least < truth && truth < most && (value / truth - 1.0).abs() < 0.05,
                "{value} for {truth}: {answer}"
            );
        }
    }
}
