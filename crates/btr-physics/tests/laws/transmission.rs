//! Transmissions with elasticity or play.

use crate::scene::{G, Told, fast, fast_weightless, hold, last, placed, run, run_with, setup};
use btr_core::log::Log;
use btr_physics::effects::PlacedEffect;
use btr_physics::presets::pendulum::pendulum;
use btr_physics::robot::{Actuator, Robot};
use btr_physics::setup::Setup;
use std::f64::consts::TAU;

/// kg·m².
const INERTIA: f64 = 1.3 * 0.49;

fn driven(actuator: Actuator, rotor: f64) -> Robot {
    let mut robot = pendulum(1.3, 0.7, actuator);
    robot.links[1].joint.armature = rotor;
    robot
}

fn servo(kp: f64, kd: f64) -> Actuator {
    Actuator::Position { kp, ki: 0.0, kd, max_torque: f64::INFINITY }
}

fn torque() -> Actuator {
    Actuator::Torque { max_torque: f64::INFINITY }
}

/// Times at which the velocity changes its sign, in s.
fn turns(log: &Log) -> Vec<f64> {
    let dq = log.values("dq_hinge").unwrap().windows(2).zip(log.clock_s());
    dq.filter(|(pair, _)| pair[0] * pair[1] < 0.0).map(|(pair, t)| t + 1e-4 * pair[0] / (pair[0] - pair[1])).collect()
}

#[test]
fn a_link_on_a_held_motor_rings_at_its_own_frequency() {
    let spring = placed("joint_elasticity", "hinge", &[40.0, 0.0]);
    let held = driven(servo(1e7, 1e4), 0.01);
    let flicked = Setup { start_velocities: vec![0.5], ..fast_weightless(1e-4, 1.0) };
    let turns = turns(&run_with(&held, &[spring], &flicked, &hold(0.0)));
    let period = 2.0 * (turns[2] - turns[0]) / 2.0;
    let expected = TAU * (INERTIA / 40.0).sqrt();
    assert!((period / expected - 1.0).abs() < 2e-3, "{period} s, expected {expected} s");
}

#[test]
fn rotor_and_link_ring_against_each_other_at_their_resonance() {
    let spring = placed("joint_elasticity", "hinge", &[40.0, 0.0]);
    let rotor = 0.2;
    let push = Told(|t: f64| if t < 0.0015 { 100.0 } else { 0.0 });
    let log = run_with(&driven(torque(), rotor), &[spring], &fast_weightless(1e-4, 3.0), &push);
    // The two drift together at a constant speed, about which the link's velocity oscillates.
    let drift = 100.0 * 0.0015 / (INERTIA + rotor);
    let swing: Vec<f64> = log.values("dq_hinge").unwrap().iter().map(|dq| dq - drift).collect();
    let crossings: Vec<usize> = (1..swing.len()).filter(|&i| swing[i - 1] * swing[i] < 0.0).collect();
    let period = 1e-4 * (crossings[8] - crossings[0]) as f64 / 4.0;
    let expected = TAU / (40.0 * (1.0 / rotor + 1.0 / INERTIA)).sqrt();
    assert!((period / expected - 1.0).abs() < 0.01, "{period} s, expected {expected} s");
}

#[test]
fn a_loaded_spring_deflects_by_torque_over_stiffness() {
    let spring = placed("joint_elasticity", "hinge", &[30.0, 1.0]);
    let log = run_with(&driven(servo(60.0, 3.0), 0.02), &[spring], &fast(0.001, 30.0), &hold(0.6));
    let (q, torque) = (last(&log, "q_hinge"), last(&log, "tau_hinge"));
    let weight = 1.3 * G * 0.7 * q.sin();
    assert!((torque - weight).abs() < 1e-6, "the motor's torque carries the weight: {torque}, {weight} N·m");
    let motor = 0.6 - torque / 60.0;
    assert!((motor - q - torque / 30.0).abs() < 1e-6, "{q} rad");
}

#[test]
fn a_stiff_spring_or_a_tiny_gap_has_no_visible_effect() {
    let robot = driven(servo(30.0, 1.0), 0.02);
    let wave = Told(|t: f64| 0.5 * (6.0 * t).sin());
    for setup in [fast(0.001, 2.0), setup(0.001, 2.0)] {
        let plain = run(&robot, &setup, &wave);
        for (name, values) in [("joint_elasticity", vec![1e6, 0.0]), ("backlash", vec![1e-5])] {
            let log = run_with(&robot, &[placed(name, "hinge", &values)], &setup, &wave);
            let pairs = plain.values("q_hinge").unwrap().iter().zip(log.values("q_hinge").unwrap());
            let apart = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(apart < 3e-4, "`{name}`, {:?}: {apart} rad", setup.engine);
        }
    }
}

#[test]
fn no_stiffness_and_no_step_is_unstable() {
    let robot = driven(servo(40.0, 1.0), 1e-5);
    for (stiffness, dt_s) in [(1e-3, 0.01), (10.0, 0.01), (1e5, 0.01), (1e9, 0.001)] {
        let spring = placed("joint_elasticity", "hinge", &[stiffness, 0.0]);
        let log = run_with(&robot, &[spring], &fast(dt_s, 4.0), &hold(0.5));
        let fastest = log.values("dq_hinge").unwrap().iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        assert!(fastest < 20.0, "{fastest} rad/s at {stiffness} N·m/rad and {dt_s} s");
    }
}

/// Rest position of a link without gravity after its servo approached 0.3 rad from this side.
fn approached(effect: &[PlacedEffect], side: f64) -> f64 {
    // The approach ends so slowly that friction holds the link back.
    let ramp = Told(move |t: f64| 0.3 + side * 0.4 * f64::exp(-t));
    let rub = placed("coulomb_friction", "hinge", &[0.3]);
    let effects: Vec<PlacedEffect> = effect.iter().cloned().chain([rub]).collect();
    let mut robot = driven(servo(300.0, 12.0), 0.02);
    robot.links[1].joint.start = 0.3 + side * 0.4;
    last(&run_with(&robot, &effects, &fast_weightless(0.001, 10.0), &ramp), "q_hinge")
}

#[test]
fn backlash_loses_its_gap_between_two_directions() {
    let rigid = approached(&[], 1.0) - approached(&[], -1.0);
    let gap = placed("backlash", "hinge", &[0.08]);
    let lost = approached(std::slice::from_ref(&gap), 1.0) - approached(std::slice::from_ref(&gap), -1.0) - rigid;
    assert!((lost - 0.08).abs() < 1e-3, "{lost} rad");
}

#[test]
fn a_link_rests_on_the_flank_that_carries_it_and_does_not_chatter() {
    for dt_s in [0.004, 0.001, 0.00025] {
        let gap = placed("backlash", "hinge", &[0.1]);
        let log = run_with(&driven(servo(80.0, 4.0), 0.01), &[gap], &fast(dt_s, 12.0), &hold(0.7));
        let (q, torque) = (last(&log, "q_hinge"), last(&log, "tau_hinge"));
        let weight = 1.3 * G * 0.7 * q.sin();
        let motor = 0.7 - torque / 80.0;
        assert!((torque - weight).abs() < 1e-6 && last(&log, "dq_hinge").abs() < 1e-9, "{torque}, {weight} N·m");
        assert!((motor - q - 0.05).abs() < 1e-3, "{} rad between motor and link", motor - q);
    }
}

#[test]
fn within_the_gap_the_link_is_free() {
    let gap = placed("backlash", "hinge", &[0.1]);
    let drift = Setup { start_velocities: vec![0.1], ..fast_weightless(0.001, 0.4) };
    let mut robot = driven(servo(1e6, 1e4), 0.01);
    robot.links[1].joint.start = 0.0;
    let log = run_with(&robot, &[gap], &drift, &hold(0.0));
    let dq = log.values("dq_hinge").unwrap();
    assert!(dq[..390].iter().all(|dq| (dq - 0.1).abs() < 1e-12), "nothing touches it");
    let log = run_with(&robot, &[placed("backlash", "hinge", &[0.1])], &Setup { duration_s: 0.8, ..drift }, &hold(0.0));
    assert!((last(&log, "q_hinge") - 0.05).abs() < 1e-3, "it stops at the flank: {}", last(&log, "q_hinge"));
}

#[test]
fn a_spring_and_a_gap_in_series_add_up() {
    let both = [placed("joint_elasticity", "hinge", &[50.0, 1.0]), placed("backlash", "hinge", &[0.06])];
    let log = run_with(&driven(servo(80.0, 4.0), 0.01), &both, &fast(0.001, 30.0), &hold(0.7));
    let (q, torque) = (last(&log, "q_hinge"), last(&log, "tau_hinge"));
    assert!((torque - 1.3 * G * 0.7 * q.sin()).abs() < 1e-6, "{torque} N·m at {q} rad");
    assert!((0.7 - torque / 80.0 - torque / 50.0 - 0.03 - q).abs() < 1e-3, "{q} rad");
}
