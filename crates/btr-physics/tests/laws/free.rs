//! Free bodies on both engines: btr's own is of second order, the reference of first.

use crate::scene::{ENGINES, G, Told, brick, centre_of_mass, hold, last, on, poses, run, setup, swimmer, weightless};
use btr_core::log::Log;
use btr_physics::robot::{Actuator, Base, Robot};
use btr_physics::setup::{EngineName, Setup};
use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};

fn servo() -> Actuator {
    Actuator::Position { kp: 5.0, ki: 0.0, kd: 0.2, max_torque: 10.0 }
}

/// The same setup with an IMU.
fn with_imu(mut setup: Setup) -> Setup {
    setup.sensors.imu = true;
    setup
}

/// Factor to which an error falls at least when the step is halved.
fn falls(engine: EngineName) -> f64 {
    if engine == EngineName::Auto { 0.3 } else { 0.6 }
}

#[test]
fn falls_by_half_g_t_squared() {
    let (dt, t) = (0.002, 1.0);
    let stone = brick(Vector3::new(0.1, 0.2, 0.3), 2.0, Vector3::new(0.05, 0.0, 0.1));
    // Semi-implicit Euler falls by g·t·(t + dt)/2 exactly.
    for (engine, late) in [(EngineName::Auto, 0.0), (EngineName::Rapier, dt)] {
        let fallen = 0.5 * G * t * (t + late);
        for robot in [&stone, &swimmer(Actuator::Passive)] {
            let z = last(&run(robot, &on(engine, &setup(dt, t)), &hold(0.0)), "base_z");
            assert!((z + fallen).abs() < 1e-9, "{engine:?}: {} fell to {z}", robot.name);
        }
    }
}

#[test]
fn centre_of_mass_stays_under_internal_forces() {
    let robot = swimmer(servo());
    let wave = Told(|t: f64| (6.0 * t).sin());
    for (engine, most) in [(EngineName::Auto, 3e-4), (EngineName::Rapier, 2e-3)] {
        let drift = |dt: f64| {
            let log = run(&robot, &on(engine, &weightless(dt, 2.0)), &wave);
            let moved: f64 = log.values("q_shoulder").unwrap().iter().map(|q| q.abs()).fold(0.0, f64::max);
            assert!(moved > 0.5, "the arm must swing, not {moved} rad");
            let start = centre_of_mass(&robot, &log, 0);
            (0..log.len()).map(|i| (centre_of_mass(&robot, &log, i) - start).norm()).fold(0.0, f64::max)
        };
        let (coarse, fine) = (drift(0.002), drift(0.001));
        assert!(coarse < most, "{engine:?}: drift of {coarse} m");
        assert!(fine < falls(engine) * coarse, "{engine:?}: {coarse} m, then {fine} m");
    }
}

/// Angular momentum about the centre of mass, in the world, and kinetic energy of the motion relative to it.
fn spin(robot: &Robot, log: &Log, i: usize) -> (Vector3<f64>, f64) {
    let at = |name: &str| log.values(name).unwrap()[i];
    let turned =
        UnitQuaternion::from_quaternion(Quaternion::new(at("base_qw"), at("base_qx"), at("base_qy"), at("base_qz")));
    let base = Isometry3::from_parts(nalgebra::Translation3::identity(), turned);
    let poses = poses(robot, base, &[at("q_shoulder")]);
    let root = turned * Vector3::new(at("imu_gyro_x"), at("imu_gyro_y"), at("imu_gyro_z"));
    let arm = root + poses[1].rotation * robot.links[1].joint.axis * at("dq_shoulder");
    let (shoulder, turning) = (poses[1].translation.vector, [root, arm]);
    let coms = [0, 1].map(|k| (poses[k] * robot.links[k].com_m).coords);
    let speeds = [root.cross(&coms[0]), root.cross(&shoulder) + arm.cross(&(coms[1] - shoulder))];
    let masses = [0, 1].map(|k| robot.links[k].mass_kg);
    let mean = |of: &[Vector3<f64>; 2]| (of[0] * masses[0] + of[1] * masses[1]) / (masses[0] + masses[1]);
    let (centre, drift) = (mean(&coms), mean(&speeds));
    let mut sum = (Vector3::zeros(), 0.0);
    for k in 0..2 {
        let rotation = poses[k].rotation.to_rotation_matrix();
        let own = rotation * robot.links[k].inertia_kg_m2 * rotation.transpose() * turning[k];
        let (place, speed) = (coms[k] - centre, speeds[k] - drift);
        sum.0 += own + place.cross(&speed) * masses[k];
        sum.1 += 0.5 * turning[k].dot(&own) + 0.5 * masses[k] * speed.norm_squared();
    }
    sum
}

#[test]
fn a_free_body_keeps_its_angular_momentum_and_energy() {
    let robot = swimmer(Actuator::Passive);
    for (engine, most) in [(EngineName::Auto, [5e-4, 4e-4]), (EngineName::Rapier, [0.12, 0.2])] {
        let drift = |dt: f64| {
            let flicked = Setup { start_velocities: vec![8.0], ..with_imu(weightless(dt, 2.0)) };
            let log = run(&robot, &on(engine, &flicked), &hold(0.0));
            let (momentum, energy) = spin(&robot, &log, 0);
            let ends: Vec<_> = (0..log.len()).map(|i| spin(&robot, &log, i)).collect();
            let turned = ends.iter().map(|(now, _)| (now - momentum).norm() / momentum.norm()).fold(0.0, f64::max);
            let lost = ends.iter().map(|(_, now)| (now / energy - 1.0).abs()).fold(0.0, f64::max);
            [turned, lost]
        };
        let (coarse, fine) = (drift(0.002), drift(0.001));
        for k in 0..2 {
            assert!(
                coarse[k] < most[k] && fine[k] < falls(engine) * coarse[k],
                "{engine:?}: {coarse:?}, then {fine:?}"
            );
        }
    }
}

#[test]
fn a_falling_robot_moves_as_if_it_were_weightless() {
    let robot = swimmer(servo());
    let wave = Told(|t: f64| (6.0 * t).sin());
    for (engine, most) in [(EngineName::Auto, 1e-12), (EngineName::Rapier, 1e-8)] {
        let [falling, floating] =
            [setup(0.002, 1.0), weightless(0.002, 1.0)].map(|setup| run(&robot, &on(engine, &setup), &wave));
        let apart = (last(&falling, "q_shoulder") - last(&floating, "q_shoulder")).abs();
        assert!(apart < most, "{engine:?}: {apart} rad");
    }
}

#[test]
fn resting_accelerometer_reads_g_upwards() {
    let mut robot = brick(Vector3::new(0.1, 0.1, 0.05), 2.0, Vector3::zeros());
    robot.base = Base::Fixed;
    for engine in ENGINES {
        let log = run(&robot, &on(engine, &with_imu(setup(0.002, 0.1))), &hold(0.0));
        assert!((last(&log, "imu_acc_z") - G).abs() < 1e-12 && last(&log, "imu_acc_x").abs() < 1e-12);
    }
}

#[test]
fn falling_accelerometer_reads_zero() {
    let robot = brick(Vector3::new(0.1, 0.1, 0.05), 2.0, Vector3::new(0.2, 0.0, 0.0));
    for engine in ENGINES {
        let log = run(&robot, &on(engine, &with_imu(setup(0.002, 0.1))), &hold(0.0));
        assert!(last(&log, "imu_acc_z").abs() < 1e-9, "{engine:?}");
    }
}

/// A free body with a reaction wheel about z.
fn wheel() -> Robot {
    let mut robot = swimmer(servo());
    robot.links[1].joint.axis = Vector3::z();
    robot.links[1].joint.origin = Isometry3::identity();
    robot
}

#[test]
fn gyroscope_integrates_to_the_pose() {
    // The wheel rotates the body the opposite way; the gyroscope must measure how far.
    for engine in ENGINES {
        let log = run(&wheel(), &on(engine, &with_imu(weightless(0.001, 1.0))), &Told(|t: f64| t));
        let turned: f64 = log.values("imu_gyro_z").unwrap().iter().skip(1).map(|w| w * 0.001).sum();
        let yaw = 2.0 * last(&log, "base_qz").atan2(last(&log, "base_qw"));
        assert!(yaw.abs() > 0.05 && (turned - yaw).abs() < 1e-3, "{engine:?}: gyro {turned} rad, pose {yaw} rad");
    }
}

#[test]
fn angular_momentum_stays() {
    // A wheel spins up and then runs at constant speed: the body counter-rotates by the ratio of their inertias,
    // undamped.
    let mut robot = wheel();
    for link in &mut robot.links {
        link.com_m = nalgebra::Point3::origin();
    }
    let [body, wheel] = [0, 1].map(|i| robot.links[i].inertia_kg_m2[(2, 2)]);
    for engine in ENGINES {
        let log = run(&robot, &on(engine, &with_imu(weightless(0.001, 8.0))), &Told(|t: f64| t));
        let expected = -wheel / (body + wheel) * last(&log, "dq_shoulder");
        let turning = last(&log, "imu_gyro_z");
        assert!((turning / expected - 1.0).abs() < 1e-6, "{engine:?}: {turning} rad/s, expected {expected} rad/s");
    }
}
