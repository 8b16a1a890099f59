//! Btr's own engine on the floor: standing, rolling, sliding and bouncing.

use crate::scene::{G, brick, hold, last, on, placed, run, run_with};
use btr_core::log::Log;
use btr_physics::presets::ant;
use btr_physics::presets::nao::nao;
use btr_physics::robot::{Actuator, Geometry, JointKind, Robot};
use btr_physics::setup::{Ball, EngineName, Ground, Setup};
use nalgebra::{Isometry3, Point3, Vector3};
use std::f64::consts::FRAC_PI_2;

fn tilted(friction: f64, angle_rad: f64) -> Setup {
    Setup {
        ground: Some(Ground::hard(friction)),
        gravity_m_s2: Vector3::new(G * angle_rad.sin(), 0.0, -G * angle_rad.cos()),
        duration_s: 1.0,
        ..Setup::default()
    }
}

/// Largest distance of the base from its first sample, in m.
fn moved(log: &Log) -> f64 {
    let axes = ["base_x", "base_y", "base_z"].map(|axis| log.values(axis).unwrap());
    let at = |i: usize| Vector3::from(axes.map(|axis| axis[i]));
    (0..log.len()).map(|i| (at(i) - at(0)).norm()).fold(0.0, f64::max)
}

/// A body of 1 kg of this shape on the floor, its axis rotated by `turn` from the vertical about x.
fn body(geometry: Geometry, turn: f64, height_m: f64) -> Robot {
    let mut robot = brick(Vector3::repeat(0.1), 1.0, Vector3::zeros());
    let link = &mut robot.links[0];
    link.inertia_kg_m2 = geometry.inertia_kg_m2(1.0);
    link.shapes[0].geometry = geometry;
    robot.start = Isometry3::new(Vector3::new(0.0, 0.0, height_m), Vector3::x() * turn);
    robot
}

const SPHERE: Geometry = Geometry::Sphere { radius_m: 0.05 };
const CYLINDER: Geometry = Geometry::Cylinder { radius_m: 0.05, half_length_m: 0.08 };
const CAPSULE: Geometry = Geometry::Capsule { radius_m: 0.05, half_length_m: 0.08 };

#[test]
fn nao_stands_still_on_level_and_sloped_floors() {
    // The servos hold it on a slope as on a level floor.
    for angle in [0.0, 0.9 * 0.15_f64.atan()] {
        let still = Setup { dt_s: 0.005, rest_s: 6.0, duration_s: 10.0, ..tilted(0.15, angle) };
        let crept = moved(&run(&nao(), &still, &hold(0.0)));
        assert!(crept < 5e-7, "{crept} m in 10 s at {angle} rad");
    }
}

#[test]
fn nao_sinks_in_by_less_than_half_a_millimetre() {
    let mut stiff = nao();
    // Stiff servos, so that their deflection does not count as the floor's.
    stiff.links.iter_mut().for_each(|link| link.joint.kind = JointKind::Fixed);
    let log = run(&stiff, &Setup { duration_s: 3.0, ..Setup::default() }, &hold(0.0));
    let sunk = stiff.start.translation.z - last(&log, "base_z");
    assert!(sunk > 0.0 && sunk < 5e-4, "{sunk} m");
}

#[test]
fn every_point_of_contact_is_a_spring() {
    let mut slab = brick(Vector3::new(0.1, 0.1, 0.02), 2.0, Vector3::zeros());
    slab.start.translation.z = 0.02;
    let soft = placed("contact_compliance", "*", &[5000.0, 100.0]);
    let log = run_with(&slab, &[soft], &tilted(0.5, 0.0), &hold(0.0));
    let sunk = 0.02 - last(&log, "base_z");
    assert!((sunk - 2.0 * G / 20_000.0).abs() < 1e-6, "{sunk} m on four corners");
}

#[test]
fn round_shapes_rest() {
    for (name, geometry, turn, height) in [
        ("sphere", SPHERE, 0.0, 0.05),
        ("cylinder on its end", CYLINDER, 0.0, 0.08),
        ("cylinder on its side", CYLINDER, FRAC_PI_2, 0.05),
        ("capsule on its side", CAPSULE, FRAC_PI_2, 0.05),
    ] {
        let still = Setup { rest_s: 1.0, duration_s: 5.0, ..tilted(0.5, 0.0) };
        let log = run(&body(geometry, turn, height), &still, &hold(0.0));
        let (crept, sunk, force) = (moved(&log), height - last(&log, "base_z"), last(&log, "foot_brick"));
        assert!(crept < 1e-9 && (0.0..5e-4).contains(&sunk), "{name}: crept {crept} m, sunk {sunk} m");
        assert!((force - G).abs() < 1e-6, "{name}: {force} N");
    }
}

#[test]
fn round_shapes_roll_and_slide() {
    // Cylinder and capsule lie across the slope.
    for (name, geometry, turn) in
        [("sphere", SPHERE, 0.0), ("cylinder", CYLINDER, FRAC_PI_2), ("capsule", CAPSULE, FRAC_PI_2)]
    {
        let robot = body(geometry, turn, 0.05);
        // Rotational inertia as an equivalent mass at the surface.
        let drag = robot.links[0].inertia_kg_m2[(2, 2)] / 0.05_f64.powi(2);
        for (angle, friction) in [(0.2_f64, 0.5), (0.6, 0.1)] {
            let slides = friction < angle.tan() * drag / (1.0 + drag);
            let (down, normal) = (G * angle.sin(), G * angle.cos());
            let acceleration = if slides { down - friction * normal } else { down / (1.0 + drag) };
            for (engine, most) in [(EngineName::Auto, 3e-5), (EngineName::Rapier, 3e-3)] {
                let log = run(&robot, &on(engine, &tilted(friction, angle)), &hold(0.0));
                let went = last(&log, "base_x") / (0.5 * acceleration);
                assert!((went - 1.0).abs() < most, "{engine:?}, {name}: {went} of the expected distance");
            }
        }
    }
}

#[test]
fn a_dropped_ball_rebounds_by_its_restitution() {
    let mut aside = brick(Vector3::repeat(0.02), 1.0, Vector3::zeros());
    aside.start.translation = Vector3::new(1.0, 0.0, 0.02).into();
    for restitution in [0.0, 0.6, 1.0] {
        let ball = Ball {
            radius_m: 0.03,
            mass_kg: 0.05,
            start_m: Point3::new(0.0, 0.0, 0.53),
            friction: 0.5,
            restitution,
            rolling_damping_per_s: 0.0,
        };
        let log = run(&aside, &Setup { ball: Some(ball), ..tilted(0.5, 0.0) }, &hold(0.0));
        let z = log.values("ball_z").unwrap();
        let hit = z.iter().position(|z| *z < 0.0305).unwrap();
        let highest = z[hit + 20..].iter().copied().fold(0.0, f64::max) - 0.03;
        // Restitution is averaged with that of the floor, which is zero.
        let kept = (highest.max(0.0) / 0.5).sqrt();
        assert!((kept - 0.5 * restitution).abs() < 3e-3, "{kept} of the speed, restitution {restitution}");
    }
}

#[test]
fn a_rest_phase_puts_the_robot_on_the_floor_at_standstill() {
    let mut aloft = ant::ant();
    aloft.start.translation.z += 0.02;
    let still = Setup { rest_s: 2.0, ..Setup::default() };
    for link in &mut aloft.links {
        if let Actuator::Position { ki, .. } = &mut link.joint.actuator {
            // The integral settles much more slowly.
            *ki = 0.0;
        }
    }
    let log = run(&aloft, &still, &ant::drive(vec![0.0; 36]));
    let (crept, down) = (moved(&log), aloft.start.translation.z - log.values("base_z").unwrap()[0]);
    let fastest = ant::ant()
        .movable()
        .map(|(_, link)| log.values(&format!("dq_{}", link.joint.name)).unwrap()[0].abs())
        .fold(0.0, f64::max);
    assert!((0.02..0.03).contains(&down), "put down by {down} m");
    assert!(crept < 1e-9 && fastest < 1e-9, "{crept} m, {fastest} rad/s");
    let falls = run(&aloft, &Setup { rest_s: 0.0, ..still }, &ant::drive(vec![0.0; 36]));
    assert!(moved(&falls) > 0.015, "without rest it falls");
}

#[test]
fn a_foot_in_the_air_reports_no_force() {
    let springy = placed("contact_compliance", "*", &[1000.0, 2.0]);
    let log = run_with(&body(SPHERE, 0.0, 0.1), &[springy], &tilted(0.5, 0.0), &hold(0.0));
    let (z, force) = (log.values("base_z").unwrap(), log.values("foot_brick").unwrap());
    let aloft: Vec<usize> = (1..z.len()).filter(|&i| z[i - 1].min(z[i]) > 0.052).collect();
    let pressed = (0..z.len()).find(|&i| force[i] > 0.0).unwrap();
    assert!(aloft.iter().any(|&i| i > pressed), "it bounces");
    assert!(aloft.iter().all(|&i| force[i] <= 0.0));
}
