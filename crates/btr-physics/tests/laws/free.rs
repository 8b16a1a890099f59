//! Bodies that nothing holds.

use crate::scene::{G, Told, brick, centre_of_mass, hold, last, run, setup, swimmer, weightless};
use btr_physics::robot::Actuator;
use nalgebra::Vector3;

fn servo() -> Actuator {
    Actuator::Position { kp: 5.0, ki: 0.0, kd: 0.2, max_torque: 10.0 }
}

#[test]
fn falls_by_half_g_t_squared() {
    // Semi-implicit Euler falls by g·t·(t + dt)/2 exactly.
    let (dt, t) = (0.002, 1.0);
    let fallen = 0.5 * G * t * (t + dt);
    let stone = brick(Vector3::new(0.1, 0.2, 0.3), 2.0, Vector3::new(0.05, 0.0, 0.1));
    for robot in [stone, swimmer(Actuator::Passive)] {
        let log = run(&robot, &setup(dt, t), &hold(0.0));
        assert!((last(&log, "base_z") + fallen).abs() < 1e-9, "{} fell to {}", robot.name, last(&log, "base_z"));
    }
}

#[test]
fn centre_of_mass_stays_when_only_joints_push() {
    let robot = swimmer(servo());
    let wave = Told(|t: f64| (6.0 * t).sin());
    let drift = |dt: f64| {
        let log = run(&robot, &weightless(dt, 2.0), &wave);
        let moved: f64 = log.values("q_shoulder").unwrap().iter().map(|q| q.abs()).fold(0.0, f64::max);
        assert!(moved > 0.5, "the arm must swing, not {moved} rad");
        let start = centre_of_mass(&robot, &log, 0);
        (0..log.len()).map(|i| (centre_of_mass(&robot, &log, i) - start).norm()).fold(0.0, f64::max)
    };
    let (coarse, fine) = (drift(0.002), drift(0.001));
    assert!(coarse < 2e-3, "drift of {coarse} m");
    assert!(fine < 0.6 * coarse, "first order: {coarse} m, then {fine} m");
}

#[test]
fn resting_accelerometer_reads_g_upwards() {
    let mut robot = brick(Vector3::new(0.1, 0.1, 0.05), 2.0, Vector3::zeros());
    robot.base = btr_physics::robot::Base::Fixed;
    let mut still = setup(0.002, 0.1);
    still.sensors.imu = true;
    let log = run(&robot, &still, &hold(0.0));
    assert!((last(&log, "imu_acc_z") - G).abs() < 1e-12 && last(&log, "imu_acc_x").abs() < 1e-12);
}

#[test]
fn falling_accelerometer_reads_nothing() {
    let robot = brick(Vector3::new(0.1, 0.1, 0.05), 2.0, Vector3::new(0.2, 0.0, 0.0));
    let mut falling = setup(0.002, 0.1);
    falling.sensors.imu = true;
    let log = run(&robot, &falling, &hold(0.0));
    assert!(last(&log, "imu_acc_z").abs() < 1e-9);
}

#[test]
fn gyroscope_integrates_to_the_pose() {
    // A reaction wheel about z turns the body the other way; the gyroscope must say how far.
    let mut robot = swimmer(servo());
    robot.links[1].joint.axis = Vector3::z();
    robot.links[1].joint.origin = nalgebra::Isometry3::identity();
    let mut spinning = weightless(0.001, 1.0);
    spinning.sensors.imu = true;
    let log = run(&robot, &spinning, &Told(|t: f64| t));
    let turned: f64 = log.values("imu_gyro_z").unwrap().iter().skip(1).map(|w| w * 0.001).sum();
    let yaw = 2.0 * last(&log, "base_qz").atan2(last(&log, "base_qw"));
    assert!(yaw.abs() > 0.05 && (turned - yaw).abs() < 1e-3, "gyro {turned} rad, pose {yaw} rad");
}
