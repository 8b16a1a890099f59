//! Error of btr's own engine with steps of 2 ms, against the first-order reference engine with steps of 0.5 ms.

use crate::engines::{link, servo, tree};
use crate::scene::{Told, hold, run_with};
use btr_core::log::Log;
use btr_physics::drive::Drive;
use btr_physics::effects::PlacedEffect;
use btr_physics::presets::pendulum::pendulum;
use btr_physics::robot::{Actuator, Base, Joint, JointKind, Robot};
use btr_physics::setup::{EngineName, Setup};
use nalgebra::{Isometry3, Vector3};

const DURATION_S: f64 = 2.2;

/// Largest difference of a joint's position between two logs.
fn largest_difference(robot: &Robot, a: &Log, b: &Log) -> f64 {
    let values = |log: &Log, joint: &str| log.values(&format!("q_{joint}")).unwrap().to_vec();
    let of = |joint: &str| {
        values(a, joint).into_iter().zip(values(b, joint)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    robot.movable().map(|(_, link)| of(&link.joint.name)).fold(0.0, f64::max)
}

/// Checks that steps of 2 ms err less than the reference's of 0.5 ms, which converges to the same truth.
fn holds(what: &str, robot: &Robot, drive: &dyn Drive, dq: &[f64]) {
    let log = |engine, dt_s: f64| {
        let setup = Setup {
            dt_s,
            duration_s: DURATION_S,
            control_s: 0.004,
            sample_s: Some(0.004),
            ground: None,
            start_velocities: dq.to_vec(),
            engine,
            ..Setup::default()
        };
        run_with(robot, &[] as &[PlacedEffect], &setup, drive)
    };
    let truth = log(EngineName::Auto, 0.000_031_25);
    let [coarse, first_order] =
        [0.001, 0.0005].map(|dt| largest_difference(robot, &log(EngineName::Rapier, dt), &truth));
    let own = largest_difference(robot, &log(EngineName::Auto, 0.002), &truth);
    println!("{what}: own 2 ms {own:.1e} rad, reference 0.5 ms {first_order:.1e} rad");
    assert!(own < first_order, "{what}: {own} rad, and the reference {first_order} rad");
    assert!((1.6..2.4).contains(&(coarse / first_order)), "{what}: {coarse}, then {first_order} rad");
}

#[test]
fn a_pendulum() {
    let mut robot = pendulum(1.0, 0.5, Actuator::Passive);
    robot.links[1].joint.start = 2.0;
    holds("pendulum", &robot, &hold(f64::NAN), &[]);
}

#[test]
fn a_double_pendulum() {
    let hinge = |name: &str, start| Joint {
        start,
        ..Joint::new(name, JointKind::Revolute, Isometry3::translation(0.0, 0.0, -0.4), Vector3::y())
    };
    let root = Joint::new("root", JointKind::Fixed, Isometry3::identity(), Vector3::z());
    let links = vec![
        link("base", None, root, 1.0, [0.0; 3]),
        link("upper", Some(0), hinge("a", 1.0), 1.0, [0.0, 0.0, -0.2]),
        link("lower", Some(1), hinge("b", 0.5), 0.7, [0.0, 0.0, -0.2]),
    ];
    let start = Isometry3::identity();
    holds(
        "double pendulum",
        &Robot { name: "double".to_owned(), base: Base::Fixed, start, links },
        &hold(f64::NAN),
        &[],
    );
}

#[test]
fn a_driven_damped_arm() {
    holds("driven arm", &tree(&servo()), &Told(|t: f64| 0.4 * (9.0 * t).sin()), &[]);
}

#[test]
fn an_arm_that_tumbles_freely() {
    let robot = Robot { base: Base::Floating, ..tree(&Actuator::Passive) };
    holds("tumbling arm", &robot, &hold(f64::NAN), &[2.0, -1.5, 0.0, 1.0]);
}
