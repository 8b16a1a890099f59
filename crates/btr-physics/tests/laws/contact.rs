//! Robots on the floor.

use crate::scene::{G, Told, brick, hold, last, placed, run, run_with, setup};
use btr_physics::ant;
use btr_physics::nao::{CONTROL_S, STEPS_PER_CONTROL, nao};
use btr_physics::robot::Geometry;
use btr_physics::sim::{Ball, Ground, Setup};
use nalgebra::{Point3, Vector3};

/// A floor of friction 0.5, tilted by this angle.
fn slope(angle_rad: f64) -> Setup {
    Setup {
        ground: Some(Ground::hard(0.5)),
        gravity_m_s2: Vector3::new(G * angle_rad.sin(), 0.0, -G * angle_rad.cos()),
        ..setup(0.002, 1.0)
    }
}

fn slab() -> btr_physics::robot::Robot {
    let mut slab = brick(Vector3::new(0.1, 0.1, 0.02), 1.0, Vector3::zeros());
    slab.start.translation.z = 0.02;
    slab
}

#[test]
fn slides_just_above_the_friction_angle() {
    let critical = 0.5_f64.atan();
    let slid = |angle: f64| last(&run(&slab(), &slope(angle), &hold(0.0)), "base_x");
    assert!(slid(0.99 * critical) < 1e-3, "it crept by {} m", slid(0.99 * critical));
    let above = slid(1.01 * critical);
    assert!(above > 5e-3, "it must slide, not {above} m");
}

#[test]
fn slides_with_the_acceleration_that_is_left() {
    let angle: f64 = 0.7;
    let slid = last(&run(&slab(), &slope(angle), &hold(0.0)), "base_x");
    let expected = 0.5 * G * (angle.sin() - 0.5 * angle.cos());
    assert!((slid / expected - 1.0).abs() < 0.01, "{slid} m, expected {expected} m");
}

#[test]
fn ground_friction_replaces_the_models() {
    let slippery = run_with(&slab(), &[placed("ground_friction", "*", &[0.2])], &slope(0.4), &hold(0.0));
    let same = Setup { ground: Some(Ground::hard(0.2)), ..slope(0.4) };
    assert_eq!(slippery, run(&slab(), &same, &hold(0.0)));
    assert!(last(&slippery, "base_x") > 0.5);
}

fn standing(substeps: usize) -> Setup {
    let dt_s = CONTROL_S / STEPS_PER_CONTROL as f64;
    let mut setup = Setup { dt_s, substeps, duration_s: 10.0, ..Setup::default() };
    setup.sensors.imu = true;
    setup
}

#[test]
fn nao_stands_and_its_feet_carry_its_weight() {
    let robot = nao();
    for substeps in [1, 3] {
        let log = run(&robot, &standing(substeps), &hold(0.0));
        let joints = log.channels().filter(|(name, _)| name.starts_with("q_"));
        let worst = joints.flat_map(|(_, c)| &c.values).fold(0.0_f64, |worst, q| worst.max(q.abs()));
        assert!(worst < 0.01, "a joint gave way by {worst} rad");
        assert!((last(&log, "base_z") - 0.35).abs() < 1e-3, "the torso is at {} m", last(&log, "base_z"));
        let feet = last(&log, "foot_RAnkleRoll") + last(&log, "foot_LAnkleRoll");
        assert!((feet / (robot.mass_kg() * G) - 1.0).abs() < 1e-4, "the feet carry {feet} N");
        let acc = ["x", "y", "z"].map(|axis| last(&log, &format!("imu_acc_{axis}")));
        assert!((Vector3::from(acc).norm() - G).abs() < 1e-3, "{acc:?}");
    }
}

#[test]
fn nothing_falls_asleep() {
    let late = Told(|t: f64| if t < 4.0 { 0.0 } else { 0.1 });
    let log = run(&nao(), &Setup { duration_s: 5.0, ..standing(1) }, &late);
    assert!(last(&log, "q_HeadYaw") > 0.09, "the head must turn after four still seconds");
}

#[test]
fn ant_walks_along_x() {
    let dt_s = 0.002;
    let log = run(&ant::ant(), &Setup { dt_s, control_s: dt_s, ..Setup::default() }, &ant::tripod());
    let (x, y) = (last(&log, "base_x"), last(&log, "base_y"));
    assert!(x > 0.2 && y.abs() < 0.1, "it went ({x}, {y}) m");
    let upright = last(&log, "base_qw").hypot(last(&log, "base_qz"));
    assert!(upright > 0.98, "it must stay upright");
}

#[test]
fn longer_legs_start_on_the_floor() {
    let mut robot = ant::ant();
    robot.start.translation.z -= 0.03;
    let log = run(&robot, &Setup { duration_s: 0.5, ..Setup::default() }, &ant::drive(vec![0.0; 36]));
    let z = log.values("base_z").unwrap();
    assert!((z[0] - ant::ant().start.translation.z).abs() < 1e-9);
    assert!(z.iter().all(|now| (now - z[0]).abs() < 0.01), "nothing throws it up");
}

#[test]
fn ball_rests_on_the_floor_and_is_pushed() {
    let ball = Ball {
        radius_m: 0.03,
        mass_kg: 0.05,
        start_m: Point3::new(0.2, 0.0, 0.03),
        friction: 0.5,
        restitution: 0.3,
        rolling_damping_per_s: 0.5,
    };
    let still = Setup { ball: Some(ball), ..slope(0.0) };
    let log = run(&slab(), &still, &hold(0.0));
    assert!((last(&log, "ball_x") - 0.2).abs() < 1e-3 && (last(&log, "ball_z") - 0.03).abs() < 1e-3);
    // A slab that slides into it drives it ahead.
    let sliding = Setup { ball: Some(ball), ..slope(0.7) };
    let log = run(&slab(), &sliding, &hold(0.0));
    assert!(last(&log, "ball_x") > last(&log, "base_x") + 0.1);
}

/// A ball of 1 kg dropped from where it just touches a floor of 1000 N/m.
fn on_a_soft_floor(damping: f64) -> btr_core::log::Log {
    let mut ball = brick(Vector3::repeat(0.1), 1.0, Vector3::zeros());
    ball.links[0].shapes[0].geometry = Geometry::Sphere { radius_m: 0.1 };
    ball.start.translation.z = 0.1;
    let soft = placed("contact_compliance", "*", &[1000.0, damping]);
    let floor = Setup { ground: Some(Ground::hard(0.5)), ..setup(0.0005, 2.0) };
    run_with(&ball, &[soft], &floor, &hold(0.0))
}

#[test]
fn a_soft_floor_gives_way_by_weight_over_stiffness() {
    let log = on_a_soft_floor(30.0);
    let sunk = 0.1 - last(&log, "base_z");
    assert!((sunk - G / 1000.0).abs() < 1e-6, "{sunk} m");
    assert!((last(&log, "foot_brick") - G).abs() < 1e-3, "{} N", last(&log, "foot_brick"));
}

#[test]
fn a_floor_without_stiffness_does_not_carry() {
    let floor = Setup { ground: Some(Ground::hard(0.5)), ..setup(0.002, 0.5) };
    let log = run_with(&slab(), &[placed("contact_compliance", "*", &[0.0, 0.0])], &floor, &hold(0.0));
    assert!((last(&log, "base_z") - 0.02 + 0.5 * G * 0.25).abs() < 0.02, "{} m", last(&log, "base_z"));
}

#[test]
fn a_soft_floor_bounces_at_its_frequency_and_damps() {
    let z = |damping: f64| on_a_soft_floor(damping).values("base_z").unwrap().to_vec();
    let lowest = z(2.0).iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1)).map(|(i, _)| i as f64 * 0.0005).unwrap();
    let expected = std::f64::consts::PI / 1000.0_f64.sqrt();
    assert!((lowest / expected - 1.0).abs() < 0.15, "lowest after {lowest} s, expected {expected} s");
    let deepest = |damping: f64| 0.1 - z(damping).iter().copied().fold(f64::INFINITY, f64::min);
    assert!(
        deepest(2.0) > 1.7 * G / 1000.0 && deepest(100.0) < 1.15 * G / 1000.0,
        "{} {}",
        deepest(2.0),
        deepest(100.0)
    );
}
