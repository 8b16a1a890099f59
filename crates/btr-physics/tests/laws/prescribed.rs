//! A joint that follows its measured motion logs the required torque.

use crate::scene::{G, Told, arm, fast, fast_weightless, placed, run, run_with};
use btr_core::log::{Log, Role};
use btr_physics::drive::Replay;
use btr_physics::effects::PlacedEffect;
use btr_physics::presets::pendulum::pendulum;
use btr_physics::robot::{Actuator, Robot};

const MASS: f64 = 1.3;
const LENGTH: f64 = 0.7;
/// Angular frequency of the swing, in rad/s.
const RATE: f64 = 4.0;
const DT_S: f64 = 0.001;

/// A log whose only channel is a measured swing of 1 rad amplitude.
fn swing() -> Log {
    let clock: Vec<f64> = (0..=2000).map(|i| DT_S * f64::from(i)).collect();
    let q = clock.iter().map(|t| (RATE * t).sin()).collect();
    let mut log = Log::new(clock).unwrap();
    log.insert("q_hinge", "rad", Role::Measured, q).unwrap();
    log
}

/// Largest error of the swing's torque against inverse dynamics, away from the ends, where smoothing is less accurate.
fn needed(effects: &[PlacedEffect], steps: usize, extra: impl Fn(f64, f64, f64) -> f64) -> f64 {
    let robot = pendulum(MASS, LENGTH, Actuator::Prescribed);
    let setup = btr_physics::setup::Setup { sample_s: Some(DT_S), ..fast(DT_S / steps as f64, 1.9) };
    let log = run_with(&robot, effects, &setup, &Replay::new(&swing(), &robot));
    let tau = log.values("tau_hinge").unwrap();
    let error = |(i, tau): (usize, &f64)| {
        let t = i as f64 * DT_S;
        let (q, dq, ddq) = ((RATE * t).sin(), RATE * (RATE * t).cos(), -RATE * RATE * (RATE * t).sin());
        // At reversals the sign of the velocity depends on rounding.
        let turns = dq.abs() < 0.01;
        let rigid = MASS * LENGTH * LENGTH * ddq + MASS * G * LENGTH * q.sin();
        if turns { 0.0 } else { (tau - rigid - extra(q, dq, ddq)).abs() }
    };
    tau.iter().enumerate().skip(10).map(error).fold(0.0, f64::max)
}

#[test]
fn the_torque_is_inverse_dynamics_of_the_measured_motion() {
    assert!(needed(&[], 1, |_, _, _| 0.0) < 2e-3);
    assert!(needed(&[], 3, |_, _, _| 0.0) < 2e-3, "also with finer steps than the log's");
}

#[test]
fn friction_and_rotors_add_to_the_torque() {
    let effects = [
        placed("coulomb_friction", "hinge", &[0.4]),
        placed("viscous_friction", "hinge", &[0.3]),
        placed("armature", "hinge", &[0.2]),
    ];
    assert!(needed(&effects, 1, |_, dq, ddq| 0.4 * dq.signum() + 0.3 * dq + 0.2 * ddq) < 2e-3);
    let creeping = [effects[0].clone(), placed("friction_creep", "hinge", &[5.0, 0.1])];
    let held = |_, dq: f64, ddq: f64| ((dq + 0.1 * ddq) / 5.0).clamp(-0.4, 0.4);
    assert!(needed(&creeping, 1, held) < 2e-3);
    let asymmetric = [placed("asymmetric_friction", "hinge", &[0.4, 0.1, 0.3, 0.2])];
    let law = |_, dq: f64, _| if dq > 0.0 { 0.4 + 0.3 * dq } else { -0.1 + 0.2 * dq };
    assert!(needed(&asymmetric, 1, law) < 2e-3);
}

/// The arm driven by torques, its log, and the torque over time.
fn pushed() -> (Robot, Log, impl Fn(f64) -> f64 + Copy) {
    let mut robot = arm();
    robot.links.iter_mut().for_each(|link| link.joint.actuator = Actuator::Torque { max_torque: f64::INFINITY });
    let push = |t: f64| 0.02 * (6.0 * t).sin();
    let log = run(&robot, &fast_weightless(DT_S, 1.5), &Told(push));
    (robot, log, push)
}

#[test]
fn the_torques_that_moved_an_arm_are_recovered() {
    let (mut robot, log, push) = pushed();
    robot.links.iter_mut().for_each(|link| link.joint.actuator = Actuator::Prescribed);
    let again = run(&robot, &fast_weightless(DT_S, 1.4), &Replay::new(&log, &robot));
    for joint in ["waist", "shoulder", "elbow"] {
        let tau = again.values(&format!("tau_{joint}")).unwrap();
        // A torque that is held over a step acts half a step late.
        let error = |i: usize| (tau[i] - push((i as f64 - 0.5) * DT_S)).abs();
        let worst = (10..tau.len()).map(error).fold(0.0, f64::max);
        assert!(worst < 2e-4, "{joint}: {worst} of 0.02 N·m");
    }
}

#[test]
fn free_joints_react_to_prescribed_ones() {
    let (mut robot, log, push) = pushed();
    for link in robot.links.iter_mut().filter(|link| link.name != "shoulder") {
        link.joint.actuator = Actuator::Prescribed;
    }
    let again = run(&robot, &fast_weightless(DT_S, 1.4), &Replay::new(&log, &robot));
    let (was, is) = (log.values("q_shoulder").unwrap(), again.values("q_shoulder").unwrap());
    let travel = was.iter().fold(0.0, |most: f64, q| most.max((q - was[0]).abs()));
    let worst = is.iter().zip(was).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(travel > 0.1 && worst < 2e-3, "{worst} of {travel} rad");
    let tau = again.values("tau_elbow").unwrap();
    let error = |i: usize| (tau[i] - push((i as f64 - 0.5) * DT_S)).abs();
    let worst = (10..tau.len()).map(error).fold(0.0, f64::max);
    assert!(worst < 5e-4, "{worst} of 0.02 N·m");
}

#[test]
fn missing_samples_are_interpolated() {
    let robot = pendulum(MASS, LENGTH, Actuator::Prescribed);
    let mut log = swing();
    log.values_mut("q_hinge").unwrap()[500..520].fill(f64::NAN);
    let again = run(&robot, &fast(DT_S, 1.0), &Replay::new(&log, &robot));
    let q = again.values("q_hinge").unwrap();
    let worst = q.iter().enumerate().map(|(i, q)| (q - (RATE * DT_S * i as f64).sin()).abs()).fold(0.0, f64::max);
    assert!(worst < 5e-3, "{worst} rad");
}
