//! Robots on the floor, on both engines. Tests with different tolerances per engine state them.

use crate::scene::{ENGINES, G, Told, brick, hold, last, on, placed, run, run_with, setup};
use btr_physics::presets::ant;
use btr_physics::presets::nao::{CONTROL_S, STEPS_PER_CONTROL, nao};
use btr_physics::robot::{Geometry, Robot};
use btr_physics::setup::{Ball, EngineName, Ground, Setup};
use nalgebra::{Point3, Vector3};

/// A floor of friction 0.5, tilted by this angle.
fn slope(angle_rad: f64) -> Setup {
    Setup {
        ground: Some(Ground::hard(0.5)),
        gravity_m_s2: Vector3::new(G * angle_rad.sin(), 0.0, -G * angle_rad.cos()),
        ..setup(0.002, 1.0)
    }
}

fn slab() -> Robot {
    let mut slab = brick(Vector3::new(0.1, 0.1, 0.02), 1.0, Vector3::zeros());
    slab.start.translation.z = 0.02;
    slab
}

#[test]
fn slides_just_above_the_friction_angle() {
    let critical = 0.5_f64.atan();
    // The first steps press it into the floor. Rapier's few solver iterations leave a residual.
    for (engine, creeps) in [(EngineName::Auto, 5e-5), (EngineName::Rapier, 1e-3)] {
        let slid = |angle: f64| last(&run(&slab(), &on(engine, &slope(angle)), &hold(0.0)), "base_x");
        let (below, above) = (slid(0.99 * critical), slid(1.01 * critical));
        assert!(below.abs() < creeps, "{engine:?}: it crept by {below} m");
        assert!(above > 5e-3, "{engine:?}: it must slide, not {above} m");
    }
}

#[test]
fn slides_with_the_acceleration_of_gravity_minus_friction() {
    let angle: f64 = 0.7;
    let expected = 0.5 * G * (angle.sin() - 0.5 * angle.cos());
    for (engine, most) in [(EngineName::Auto, 1e-4), (EngineName::Rapier, 0.01)] {
        let slid = last(&run(&slab(), &on(engine, &slope(angle)), &hold(0.0)), "base_x");
        assert!((slid / expected - 1.0).abs() < most, "{engine:?}: {slid} m, expected {expected} m");
    }
}

#[test]
fn ground_friction_replaces_the_models() {
    for engine in ENGINES {
        let tilted = on(engine, &slope(0.4));
        let slippery = run_with(&slab(), &[placed("ground_friction", "*", &[0.2])], &tilted, &hold(0.0));
        let same = Setup { ground: Some(Ground::hard(0.2)), ..tilted };
        assert_eq!(slippery, run(&slab(), &same, &hold(0.0)));
        assert!(last(&slippery, "base_x") > 0.5);
    }
}

fn standing(engine: EngineName, substeps: usize) -> Setup {
    let dt_s = CONTROL_S / STEPS_PER_CONTROL as f64;
    let mut setup = Setup { dt_s, substeps, duration_s: 10.0, engine, ..Setup::default() };
    setup.sensors.imu = true;
    setup
}

#[test]
fn nao_stands_and_its_feet_carry_its_weight() {
    let robot = nao();
    for (engine, substeps) in ENGINES.into_iter().flat_map(|engine| [(engine, 1), (engine, 3)]) {
        let log = run(&robot, &standing(engine, substeps), &hold(0.0));
        let joints = log.channels().filter(|(name, _)| name.starts_with("q_"));
        let worst = joints.flat_map(|(_, c)| &c.values).fold(0.0_f64, |worst, q| worst.max(q.abs()));
        assert!(worst < 0.01, "{engine:?}: a joint deflected by {worst} rad");
        let z = last(&log, "base_z");
        assert!((z - 0.35).abs() < 1e-3, "{engine:?}: the torso is at {z} m");
        let feet = last(&log, "foot_RAnkleRoll") + last(&log, "foot_LAnkleRoll");
        let acc = ["x", "y", "z"].map(|axis| last(&log, &format!("imu_acc_{axis}")));
        assert!((feet / (robot.mass_kg() * G) - 1.0).abs() < 1e-4, "{engine:?}: the feet carry {feet} N");
        assert!((Vector3::from(acc).norm() - G).abs() < 1e-3, "{engine:?}: {acc:?}");
    }
}

#[test]
fn resting_bodies_stay_active() {
    let late = Told(|t: f64| if t < 4.0 { 0.0 } else { 0.1 });
    for engine in ENGINES {
        let log = run(&nao(), &Setup { duration_s: 5.0, ..standing(engine, 1) }, &late);
        assert!(last(&log, "q_HeadYaw") > 0.09, "{engine:?}: the head must turn after four still seconds");
    }
}

#[test]
fn ant_walks_along_x() {
    let dt_s = 0.002;
    for engine in ENGINES {
        let walking = Setup { dt_s, control_s: dt_s, engine, ..Setup::default() };
        let log = run(&ant::ant(), &walking, &ant::tripod());
        let (x, y) = (last(&log, "base_x"), last(&log, "base_y"));
        assert!(x > 0.2 && y.abs() < 0.1, "{engine:?}: it went ({x}, {y}) m");
        let upright = last(&log, "base_qw").hypot(last(&log, "base_qz"));
        assert!(upright > 0.98, "{engine:?}: it must stay upright");
    }
}

#[test]
fn longer_legs_start_on_the_floor() {
    let mut robot = ant::ant();
    robot.start.translation.z -= 0.03;
    for engine in ENGINES {
        let still = Setup { duration_s: 0.5, engine, ..Setup::default() };
        let log = run(&robot, &still, &ant::drive(vec![0.0; 36]));
        let z = log.values("base_z").unwrap();
        assert!((z[0] - ant::ant().start.translation.z).abs() < 1e-9);
        assert!(z.iter().all(|now| (now - z[0]).abs() < 0.01), "{engine:?}: nothing pushes it up");
    }
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
    for engine in ENGINES {
        let still = Setup { ball: Some(ball), engine, ..slope(0.0) };
        let log = run(&slab(), &still, &hold(0.0));
        let [x, z] = ["ball_x", "ball_z"].map(|channel| last(&log, channel));
        assert!((x - 0.2).abs() < 1e-3 && (z - 0.03).abs() < 1e-3, "{engine:?}: {x} m, {z} m");
        // A slab that slides into it pushes it ahead.
        let sliding = Setup { ball: Some(ball), engine, ..slope(0.7) };
        let log = run(&slab(), &sliding, &hold(0.0));
        assert!(last(&log, "ball_x") > last(&log, "base_x") + 0.1, "{engine:?}");
    }
}

/// A ball of 1 kg released at first contact with a floor of 1000 N/m.
fn on_a_soft_floor(engine: EngineName, damping: f64) -> btr_core::log::Log {
    let mut ball = brick(Vector3::repeat(0.1), 1.0, Vector3::zeros());
    ball.links[0].shapes[0].geometry = Geometry::Sphere { radius_m: 0.1 };
    ball.start.translation.z = 0.1;
    let soft = placed("contact_compliance", "*", &[1000.0, damping]);
    let floor = Setup { ground: Some(Ground::hard(0.5)), engine, ..setup(0.0005, 2.0) };
    run_with(&ball, &[soft], &floor, &hold(0.0))
}

#[test]
fn a_soft_floor_deflects_by_weight_over_stiffness() {
    for engine in ENGINES {
        let log = on_a_soft_floor(engine, 30.0);
        let (sunk, force) = (0.1 - last(&log, "base_z"), last(&log, "foot_brick"));
        assert!((sunk - G / 1000.0).abs() < 1e-6, "{engine:?}: {sunk} m");
        assert!((force - G).abs() < 1e-3, "{engine:?}: {force} N");
    }
}

#[test]
fn a_floor_without_stiffness_does_not_carry() {
    for engine in ENGINES {
        let floor = Setup { ground: Some(Ground::hard(0.5)), engine, ..setup(0.002, 0.5) };
        let log = run_with(&slab(), &[placed("contact_compliance", "*", &[0.0, 0.0])], &floor, &hold(0.0));
        let z = last(&log, "base_z");
        assert!((z - 0.02 + 0.5 * G * 0.25).abs() < 0.02, "{engine:?}: {z} m");
    }
}

#[test]
fn a_soft_floor_bounces_at_its_frequency_and_damps() {
    let expected = std::f64::consts::PI / 1000.0_f64.sqrt();
    for engine in ENGINES {
        let z = |damping: f64| on_a_soft_floor(engine, damping).values("base_z").unwrap().to_vec();
        let soft = z(2.0);
        let lowest = soft.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1)).map(|(i, _)| i as f64 * 0.0005).unwrap();
        assert!((lowest / expected - 1.0).abs() < 0.15, "{engine:?}: lowest after {lowest} s, expected {expected} s");
        let deepest = |z: &[f64]| 0.1 - z.iter().copied().fold(f64::INFINITY, f64::min);
        let (deep, damped) = (deepest(&soft), deepest(&z(100.0)));
        assert!(deep > 1.7 * G / 1000.0 && damped < 1.15 * G / 1000.0, "{engine:?}: {deep} m, {damped} m");
    }
}
