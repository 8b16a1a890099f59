//! The two engines on robots with a free root, in the air and on the floor.

use crate::scene::{ENGINES, G, Told, hold, last, on, run, setup, swimmer};
use btr_core::log::Log;
use btr_physics::drive::Drive;
use btr_physics::presets::ant;
use btr_physics::presets::nao::nao;
use btr_physics::robot::{Actuator, Robot};
use btr_physics::setup::{EngineName, Setup};
use nalgebra::{DVector, UnitQuaternion, Vector3};
use proptest::prelude::*;

const EVERY_S: f64 = 0.01;

/// Samples at fixed times for any step; commands are interpolated, so that they do not depend on the step either.
fn sampled(dt_s: f64, duration_s: f64) -> Setup {
    Setup { control_s: EVERY_S, interpolate: true, sample_s: Some(EVERY_S), ..setup(dt_s, duration_s) }
}

fn on_the_floor(dt_s: f64, duration_s: f64) -> Setup {
    Setup { ground: Setup::default().ground, ..sampled(dt_s, duration_s) }
}

/// Largest difference of joint positions, in rad.
fn apart(robot: &Robot, a: &Log, b: &Log) -> f64 {
    let far = |name: &str| {
        let pairs = a.values(name).unwrap().iter().zip(b.values(name).unwrap());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    robot.movable().map(|(_, link)| far(&format!("q_{}", link.joint.name))).fold(0.0, f64::max)
}

fn between(robot: &Robot, setup: &Setup, drive: &dyn Drive) -> f64 {
    let [own, rapier] = ENGINES.map(|engine| run(robot, &on(engine, setup), drive));
    apart(robot, &own, &rapier)
}

/// The ant without the integral gain of its servos.
fn walker() -> Robot {
    let mut robot = ant::ant();
    for link in &mut robot.links {
        if let Actuator::Position { ki, .. } = &mut link.joint.actuator {
            *ki = 0.0;
        }
    }
    robot
}

#[test]
fn in_the_air_they_converge() {
    let wave = Told(|t: f64| 0.4 * (9.0 * t).sin());
    let servo = Actuator::Position { kp: 5.0, ki: 0.0, kd: 0.2, max_torque: 10.0 };
    for (robot, most) in [(swimmer(servo), 4e-3), (nao(), 5e-3), (ant::ant(), 3e-2)] {
        let [coarse, fine] = [0.001, 0.0005].map(|dt| between(&robot, &sampled(dt, 0.3), &wave));
        assert!(fine < most && fine < 0.6 * coarse, "{}: {coarse}, then {fine} rad", robot.name);
    }
}

#[test]
fn on_the_floor_they_converge_except_for_its_stiffness() {
    // Contacts are springs of different stiffness in the two engines: 0.003 rad remain for any step.
    let robot = walker();
    let [coarse, fine] = [0.0025, 0.000_625].map(|dt| between(&robot, &on_the_floor(dt, 0.3), &ant::tripod()));
    assert!(fine < 7e-3 && fine < 0.4 * coarse, "{coarse}, then {fine} rad");
}

#[test]
fn on_the_floor_the_own_engine_errs_less_and_converges() {
    let (robot, drive) = (walker(), ant::tripod());
    let errors = |engine, steps: [f64; 3]| {
        let walk = |dt: f64| run(&robot, &on(engine, &on_the_floor(dt, 0.4)), &drive);
        let truth = walk(0.000_039_062_5);
        steps.map(|dt| apart(&robot, &walk(dt), &truth))
    };
    let steps = [0.0025, 0.00125, 0.000_625];
    let [own, rapier] = ENGINES.map(|engine| errors(engine, steps));
    assert!(own[2] < 0.25 * own[0], "at least first order: {own:?} rad");
    assert!(own[1] < rapier[1] / 3.0, "{own:?} rad, Rapier {rapier:?} rad");
}

#[test]
fn a_robot_on_the_floor_responds_smoothly() {
    // Rapier does not: there, a trunk heavier by 1e-8 changes the motion as much as one heavier by 1e-6.
    let (robot, drive) = (walker(), ant::tripod());
    let walk = |heavier: f64| {
        let mut robot = robot.clone();
        robot.links[0].mass_kg *= 1.0 + heavier;
        let setup = Setup { rest_s: 1.0, control_s: 0.055, ..on_the_floor(0.00125, 1.5) };
        let log = run(&robot, &on(EngineName::Auto, &setup), &drive);
        let joints = robot.movable().map(|(_, link)| log.values(&format!("q_{}", link.joint.name)).unwrap().to_vec());
        DVector::from_vec(joints.flatten().collect())
    };
    let nominal = walk(0.0);
    let response = |heavier: f64| (walk(heavier) - &nominal) / heavier;
    let reference = response(1e-8);
    // A change of 1 % shifts footfalls by whole steps.
    for (heavier, most) in [(1e-4, 0.02), (1e-2, 0.2)] {
        let difference = (response(heavier) - &reference).norm() / reference.norm();
        assert!(difference < most, "{heavier}: differs by {difference}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn the_first_step_in_the_air_is_the_same(
        which in 0..3usize,
        turn in prop::array::uniform3(-2.0..2.0f64),
        states in prop::collection::vec((-1.0..1.0f64, -8.0..8.0f64), 22),
    ) {
        let mut robot = [swimmer(Actuator::Passive), ant::ant(), nao()][which].clone();
        robot.start.rotation = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
        for (link, (q, _)) in robot.links.iter_mut().skip(1).zip(&states) {
            (link.joint.start, link.joint.actuator) = (*q, Actuator::Passive);
            // A joint outside its range would be pushed back by its limit.
            link.joint.limits = (f64::NEG_INFINITY, f64::INFINITY);
        }
        let dt_s = 1e-6;
        let mut start = Setup { start_velocities: states.iter().map(|(_, dq)| *dq).collect(), ..setup(dt_s, dt_s) };
        start.start_velocities.truncate(robot.movable().count());
        start.sensors.imu = true;
        let names: Vec<String> = robot.movable().map(|(_, link)| format!("dq_{}", link.joint.name)).collect();
        let accelerations = |engine| {
            let log = run(&robot, &on(engine, &start), &hold(0.0));
            let gained = |name: &str| (last(&log, name) - log.values(name).unwrap()[0]) / dt_s;
            let gyro = ["x", "y", "z"].map(|axis| gained(&format!("imu_gyro_{axis}")));
            let acc = ["x", "y", "z"].map(|axis| last(&log, &format!("imu_acc_{axis}")));
            names.iter().map(|name| gained(name)).chain(gyro).chain(acc).collect::<Vec<f64>>()
        };
        let [own, rapier] = ENGINES.map(accelerations);
        let largest = own.iter().fold(G, |most, a| most.max(a.abs()));
        let worst = own.iter().zip(&rapier).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // They differ by the error of a step of one microsecond.
        prop_assert!(worst < 5e-5 * largest, "{}: {:?} {:?}", robot.name, own, rapier);
    }
}
