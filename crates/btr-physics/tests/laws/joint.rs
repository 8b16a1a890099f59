//! Passive joints: swinging, friction, inertia and limits.

use crate::scene::{G, hold, last, placed, run, run_with, setup, weightless};
use btr_physics::effects::PlacedEffect;
use btr_physics::presets::pendulum::pendulum;
use btr_physics::robot::{Actuator, Base, Joint, JointKind, Robot};
use btr_physics::setup::Setup;
use nalgebra::{Isometry3, Point3, Vector3};
use std::f64::consts::TAU;

fn hanging(start_rad: f64) -> Robot {
    let mut robot = pendulum(1.3, 0.7, Actuator::Passive);
    robot.links[1].joint.start = start_rad;
    robot
}

/// Twice the time between the first two zero crossings.
fn period_s(robot: &Robot, dt_s: f64) -> f64 {
    let log = run(robot, &setup(dt_s, 4.0), &hold(0.0));
    let q = log.values("q_hinge").unwrap();
    let crossings = q.windows(2).enumerate().filter(|(_, w)| w[0].signum() != w[1].signum());
    let times: Vec<f64> = crossings.map(|(i, w)| dt_s * (i as f64 + w[0] / (w[0] - w[1]))).collect();
    2.0 * (times[1] - times[0])
}

/// The period of a pendulum of any amplitude, by the arithmetic-geometric mean (Gauss).
fn exact_period_s(length_m: f64, amplitude_rad: f64) -> f64 {
    let (mut a, mut b) = (1.0, (amplitude_rad / 2.0).cos());
    for _ in 0..20 {
        (a, b) = (0.5 * (a + b), f64::sqrt(a * b));
    }
    TAU * (length_m / G).sqrt() / a
}

#[test]
fn pendulum_has_its_period_at_every_amplitude() {
    for amplitude in [0.05, 1.0, 2.5] {
        let (measured, exact) = (period_s(&hanging(amplitude), 0.0005), exact_period_s(0.7, amplitude));
        assert!((measured / exact - 1.0).abs() < 2e-3, "amplitude {amplitude}: {measured} s, exact {exact} s");
    }
}

#[test]
fn error_is_of_first_order() {
    let end = |dt: f64| last(&run(&hanging(1.0), &setup(dt, 1.5), &hold(0.0)), "q_hinge");
    let truth = 2.0 * end(0.00025) - end(0.0005);
    let ratio = (end(0.004) - truth) / (end(0.002) - truth);
    assert!((1.8..2.2).contains(&ratio), "halving the step divides the error by {ratio}");
}

#[test]
fn energy_stays_within_first_order() {
    let drift = |dt: f64| {
        let log = run(&hanging(1.5), &setup(dt, 5.0), &hold(0.0));
        let (q, dq) = (log.values("q_hinge").unwrap(), log.values("dq_hinge").unwrap());
        let energy = |i: usize| 1.3 * (0.5 * (0.7 * dq[i]).powi(2) - G * 0.7 * q[i].cos());
        let scale = 1.3 * G * 0.7;
        (0..q.len()).map(|i| (energy(i) - energy(0)).abs() / scale).fold(0.0, f64::max)
    };
    let (coarse, fine) = (drift(0.002), drift(0.001));
    assert!(coarse < 0.05 && fine < 0.6 * coarse, "{coarse} of m·g·l, then {fine}");
}

#[test]
fn no_hidden_damping() {
    let mut free = weightless(0.002, 5.0);
    free.start_velocities = vec![2.0];
    let log = run(&hanging(0.0), &free, &hold(0.0));
    assert!((last(&log, "dq_hinge") - 2.0).abs() < 1e-9);
}

#[test]
fn viscous_friction_decays_exponentially() {
    let mut free = weightless(0.0005, 1.0);
    free.start_velocities = vec![2.0];
    let log = run_with(&hanging(0.0), &[placed("viscous_friction", "hinge", &[0.5])], &free, &hold(0.0));
    let expected = 2.0 * f64::exp(-0.5 / (1.3 * 0.49));
    assert!((last(&log, "dq_hinge") / expected - 1.0).abs() < 1e-3);
}

#[test]
fn coulomb_friction_decelerates_constantly_and_then_holds() {
    let mut free = weightless(0.001, 2.0);
    free.start_velocities = vec![2.0];
    let friction = [placed("coulomb_friction", "hinge", &[1.0])];
    let log = run_with(&hanging(0.0), &friction, &free, &hold(0.0));
    let braking = 1.0 / (1.3 * 0.49);
    let (dq, q) = (log.values("dq_hinge").unwrap(), log.values("q_hinge").unwrap());
    assert!((dq[500] - (2.0 - braking * 0.5)).abs() < 1e-3, "after 0.5 s: {} rad/s", dq[500]);
    assert!(dq[1900].abs() < 1e-9 && (q[2000] - q[1800]).abs() < 1e-9, "it must stand");
}

#[test]
fn stiction_holds_against_gravity_up_to_its_bound() {
    let weight = 1.3 * G * 0.7 * 1.0_f64.sin();
    let moved = |torque: f64, effects: fn(f64) -> Vec<PlacedEffect>| {
        (last(&run_with(&hanging(1.0), &effects(torque), &setup(0.002, 10.0), &hold(0.0)), "q_hinge") - 1.0).abs()
    };
    let rub = |torque: f64| vec![placed("coulomb_friction", "*", &[torque])];
    assert!(moved(1.02 * weight, rub) < 1e-6, "it crept by {} rad", moved(1.02 * weight, rub));
    assert!(moved(0.98 * weight, rub) > 0.05, "it must slip");
}

#[test]
fn armature_adds_to_the_inertia() {
    let mut robot = hanging(0.0);
    robot.links[1].joint.actuator = Actuator::Torque { max_torque: 100.0 };
    let end =
        |effects: &[PlacedEffect]| last(&run_with(&robot, effects, &weightless(0.001, 0.5), &hold(2.0)), "dq_hinge");
    let inertia = 1.3 * 0.49;
    assert!((end(&[]) - 0.5 * 2.0 / inertia).abs() < 1e-6);
    let geared = end(&[placed("armature", "hinge", &[0.3])]);
    assert!((geared - 0.5 * 2.0 / (inertia + 0.3)).abs() < 1e-6, "{geared} rad/s");
}

#[test]
fn links_joined_by_fixed_joints_move_as_one() {
    let whole = hanging(0.8);
    let mut parts = whole.clone();
    parts.links[1].mass_kg = 0.0;
    parts.links[1].com_m = Point3::origin();
    for (name, share) in [("left", 0.4), ("right", 0.9)] {
        let origin = Isometry3::new(Vector3::new(0.0, 0.0, -0.7), Vector3::new(0.0, 0.7, 0.0));
        let mut half = parts.links[1].clone();
        half.name = name.to_owned();
        half.parent = Some(1);
        half.joint = Joint::new(name, JointKind::Fixed, origin, Vector3::z());
        half.mass_kg = share;
        parts.links.push(half);
    }
    let end = |robot: &Robot| last(&run(robot, &setup(0.002, 2.0), &hold(0.0)), "q_hinge");
    assert!((end(&whole) - end(&parts)).abs() < 1e-6, "{} {}", end(&whole), end(&parts));
}

#[test]
fn a_slide_falls_along_its_axis() {
    let mut robot = hanging(0.0);
    let joint = &mut robot.links[1].joint;
    *joint = Joint::new("slide", JointKind::Prismatic, Isometry3::identity(), Vector3::new(0.6, 0.0, -0.8));
    let log = run(&robot, &setup(0.001, 1.0), &hold(0.0));
    let expected = 0.5 * 0.8 * G * 1.0 * 1.001;
    assert!((last(&log, "q_slide") - expected).abs() < 1e-9, "{}", last(&log, "q_slide"));
    assert_eq!(log.channel("q_slide").unwrap().unit, "m");
}

#[test]
fn payload_is_extra_mass() {
    let mut heavier = hanging(1.0);
    heavier.links[1].mass_kg += 0.4;
    let servo = Actuator::Position { kp: 20.0, ki: 0.0, kd: 1.0, max_torque: 50.0 };
    let mut robot = hanging(1.0);
    for robot in [&mut heavier, &mut robot] {
        robot.links[1].joint.actuator = servo.clone();
    }
    let loaded = run_with(&robot, &[placed("payload", "bob", &[0.4])], &setup(0.002, 1.0), &hold(0.5));
    assert_eq!(loaded, run(&heavier, &setup(0.002, 1.0), &hold(0.5)));
}

#[test]
fn limits_hold() {
    let mut robot = hanging(0.5);
    robot.links[1].joint.limits = (0.2, f64::INFINITY);
    let long = Setup { duration_s: 3.0, ..setup(0.001, 3.0) };
    let log = run(&robot, &long, &hold(0.0));
    assert!((last(&log, "q_hinge") - 0.2).abs() < 0.01, "{}", last(&log, "q_hinge"));
    assert_eq!(robot.base, Base::Fixed);
}
