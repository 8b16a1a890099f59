//! Laws that refer to the neighbouring joints.

use crate::scene::{Told, arm, fast, fast_weightless, hold, run_with};
use btr_core::log::{Log, Role};
use btr_core::world::WorldError;
use btr_physics::drive::Replay;
use btr_physics::effects::{FormulaError, FormulaTarget, PlacedEffect, formula};
use btr_physics::robot::{Actuator, Joint, Robot};
use btr_physics::rollout::{RolloutRequest, simulate};
use std::iter::zip;

fn law(site: &str, on: FormulaTarget, text: &str) -> PlacedEffect {
    PlacedEffect { effect: formula(on, text, &[]).unwrap(), site: site.to_owned(), values: Vec::new() }
}

fn torque(site: &str, text: &str) -> PlacedEffect {
    law(site, FormulaTarget::Torque, text)
}

/// The arm with this actuator on each joint.
fn arm_with(actuator: &Actuator) -> Robot {
    let mut robot = arm();
    robot.links.iter_mut().for_each(|link| link.joint.actuator = actuator.clone());
    robot
}

fn apart(a: &Log, b: &Log, channel: &str) -> f64 {
    zip(a.values(channel).unwrap(), b.values(channel).unwrap()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The arm whose shoulder follows 0.5 - 0.5·cos(4·t) while the waist and the elbow have servos.
fn led(effect: PlacedEffect) -> Log {
    let mut robot = arm();
    robot.links[2].joint = Joint { actuator: Actuator::Prescribed, start: 0.0, ..robot.links[2].joint.clone() };
    let clock: Vec<f64> = (0..=1500).map(|i| 0.001 * f64::from(i)).collect();
    let mut told = Log::new(clock.clone()).unwrap();
    told.insert("q_shoulder", "rad", Role::Measured, clock.iter().map(|t| 0.5 - 0.5 * (4.0 * t).cos()).collect())
        .unwrap();
    for joint in ["waist", "elbow"] {
        let wave = clock.iter().map(|t| 0.3 * (7.0 * t).sin()).collect();
        told.insert(format!("cmd_{joint}"), "rad", Role::Command, wave).unwrap();
    }
    run_with(&robot, &[effect], &fast(0.001, 1.4), &Replay::new(&told, &robot))
}

#[test]
fn a_neighbour_with_a_known_motion_acts_as_that_function_of_time() {
    use FormulaTarget::{Command, Torque};
    let same = [
        ("elbow", Torque, "-3*(q - q_parent)", "-3*(q - 0.5 + 0.5*cos(4*t))"),
        ("elbow", Torque, "0.4*dq_parent - 0.1*dq", "0.8*sin(4*t) - 0.1*dq"),
        ("elbow", Command, "cmd + 0.3*q_parent", "cmd + 0.15 - 0.15*cos(4*t)"),
        ("waist", Torque, "2*q_child", "1 - cos(4*t)"),
        ("waist", Command, "cmd - 0.05*dq_child", "cmd - 0.1*sin(4*t)"),
    ];
    for (joint, on, text, in_time) in same {
        let channel = format!("q_{joint}");
        let idle = if on == Command { "cmd" } else { "0" };
        let [with, known, without] = [text, in_time, idle].map(|text| led(law(joint, on, text)));
        let (visible, error) = (apart(&known, &without, &channel), apart(&with, &known, &channel));
        assert!(visible > 0.02 && error < 0.01 * visible, "{text}: {error} of {visible} rad");
    }
}

/// Motors that get the same command give the same torque, so that a neighbour's torque of the last step must be the
/// joint's own, whichever joint acts first.
#[test]
fn torques_are_those_of_the_last_step_for_parents_and_children() {
    let robot = arm_with(&Actuator::Torque { max_torque: f64::INFINITY });
    let run = |effect| run_with(&robot, &[effect], &fast(0.001, 1.0), &Told(|t: f64| 0.1 * (9.0 * t).sin()));
    for (joint, text) in [("elbow", "0.5*tau_parent"), ("waist", "0.5*tau_child"), ("shoulder", "0.5*tau_child")] {
        assert_eq!(run(torque(joint, text)), run(torque(joint, "0.5*tau")), "{text}");
        assert_ne!(run(torque(joint, text)), run(torque(joint, "0")), "{text}");
    }
}

/// A spring between two frictionless joints, whose laws refer to each other, keeps the energy: its potential is
/// 0.01·(q - q_child)² J.
#[test]
fn a_spring_between_two_joints_pulls_both_and_gives_nothing_away() {
    let mut robot = arm_with(&Actuator::Passive);
    // The last two joints turn about one axis through their centres of mass: two flywheels.
    for link in &mut robot.links[2..] {
        (link.com_m, link.joint.origin) = (nalgebra::Point3::origin(), nalgebra::Isometry3::identity());
        link.joint.start = 0.0;
    }
    robot.links[2].joint.start = 0.2;
    let spring = [torque("shoulder", "-0.02*(q - q_child)"), torque("elbow", "-0.02*(q - q_parent)")];
    let log = run_with(&robot, &spring, &fast_weightless(0.00005, 1.0), &hold(0.0));
    let [inner, outer] = [2, 3].map(|i: usize| robot.links[i].inertia_kg_m2[(1, 1)]);
    let values = |name: &str| log.values(name).unwrap();
    let states = (0..log.clock_s().len())
        .map(|i| ["q_shoulder", "q_elbow", "dq_shoulder", "dq_elbow"].map(|name| values(name)[i]));
    // Joint velocities are relative: the elbow's flywheel turns with the sum of both.
    let energy = |[q, outer_q, dq, outer_dq]: [f64; 4]| {
        let turning = 0.5 * inner * dq.powi(2) + 0.5 * outer * (dq + outer_dq).powi(2);
        turning + 0.01 * (q - outer_q).powi(2)
    };
    let energies: Vec<f64> = states.map(energy).collect();
    let worst = energies.iter().map(|energy| (energy / energies[0] - 1.0).abs()).fold(0.0, f64::max);
    let reached = values("q_elbow").iter().fold(0.0, |most: f64, q| most.max(q.abs()));
    assert!(worst < 0.02 && reached > 0.1, "{worst} of the energy, {reached} rad");
}

fn error_of(effect: PlacedEffect) -> WorldError {
    simulate(RolloutRequest::new(&arm(), &hold(0.2)).setup(&fast(0.001, 0.1)).effects(&[effect])).unwrap_err()
}

#[test]
fn a_neighbour_that_does_not_exist_is_an_error() {
    let without = error_of(torque("waist", "-q_parent"));
    assert!(matches!(without, WorldError::Setup { .. }));
    assert!(without.to_string().contains("`waist` has no movable joint towards the base"), "{without}");
    let without = error_of(torque("*", "-dq_child")).to_string();
    assert!(without.contains("`elbow` has no movable joint further out, which `dq_child` refers to"), "{without}");
}

#[test]
fn readings_and_parameters_have_no_neighbours() {
    let refused = formula(FormulaTarget::Reading, "q + 0.1*q_child", &[]).err();
    assert_eq!(refused, Some(FormulaError::NotInReading("q_child".to_owned())));
    let taken = formula(FormulaTarget::Torque, "-q_child*q", &["q_child"]).err();
    assert_eq!(taken, Some(FormulaError::Taken("q_child".to_owned())));
    let unknown = formula(FormulaTarget::Reading, "q + a", &[]).err().unwrap().to_string();
    assert!(!unknown.contains("child"), "{unknown}");
}

#[test]
fn a_failure_names_the_neighbours_that_the_law_uses() {
    let text = "1/(q_child - q_child)";
    let what = error_of(torque("shoulder", text)).to_string();
    assert!(what.starts_with(&format!("the law `{text}` on the torque of `shoulder` gave inf at q=0.3, ")), "{what}");
    assert!(what.ends_with(", t=0, q_child=0.3"), "{what}");
}
