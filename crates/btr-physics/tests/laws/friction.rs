//! Frictions and springs obey their laws.

use crate::scene::{G, fast, fast_weightless, hold, last, placed, run_with};
use btr_core::log::Log;
use btr_physics::effects::PlacedEffect;
use btr_physics::presets::pendulum::pendulum;
use btr_physics::robot::{Actuator, Robot};
use btr_physics::rollout::{RolloutRequest, simulate};
use btr_physics::setup::{EngineName, Setup};

/// kg·m².
const INERTIA: f64 = 1.3 * 0.49;

fn hanging(start_rad: f64) -> Robot {
    let mut robot = pendulum(1.3, 0.7, Actuator::Passive);
    robot.links[1].joint.start = start_rad;
    robot
}

/// A pendulum without gravity that coasts from a speed for half a second.
fn coast(effect: PlacedEffect, speed: f64) -> Log {
    let setup = Setup { start_velocities: vec![speed], ..fast_weightless(0.0005, 0.5) };
    run_with(&hanging(0.0), &[effect], &setup, &hold(0.0))
}

/// A pendulum without gravity that a constant torque drives.
fn pushed(effects: &[PlacedEffect], torque: f64, duration_s: f64) -> Log {
    let mut robot = hanging(0.0);
    robot.links[1].joint.actuator = Actuator::Torque { max_torque: f64::INFINITY };
    run_with(&robot, effects, &fast_weightless(0.0005, duration_s), &hold(torque))
}

#[test]
fn stribeck_breaks_away_at_its_static_torque() {
    let weight = 1.3 * G * 0.7 * 1.0_f64.sin();
    let moved = |stiction: f64| {
        let effect = placed("stribeck_friction", "*", &[0.2 * weight, stiction * weight, 0.1]);
        (last(&run_with(&hanging(1.0), &[effect], &fast(0.001, 4.0), &hold(0.0)), "q_hinge") - 1.0).abs()
    };
    assert!(moved(1.01) < 1e-12, "it crept by {} rad", moved(1.01));
    assert!(moved(0.99) > 0.1, "it must slip");
}

#[test]
fn stribeck_equals_coulomb_at_speed() {
    let end = last(&coast(placed("stribeck_friction", "hinge", &[1.0, 3.0, 0.05]), 3.0), "dq_hinge");
    assert!((end - (3.0 - 0.5 / INERTIA)).abs() < 1e-6, "{end} rad/s");
}

#[test]
fn asymmetric_friction_brakes_each_direction_with_its_own_torque_and_holds() {
    let friction = |viscous: f64| placed("asymmetric_friction", "hinge", &[1.0, 0.4, viscous, 0.0]);
    let forward = last(&coast(friction(0.0), 3.0), "dq_hinge");
    let backward = last(&coast(friction(0.0), -3.0), "dq_hinge");
    assert!((forward - (3.0 - 0.5 / INERTIA)).abs() < 1e-9, "{forward} rad/s");
    assert!((backward + (3.0 - 0.2 / INERTIA)).abs() < 1e-9, "{backward} rad/s");
    assert!(last(&coast(friction(0.5), 3.0), "dq_hinge") < forward - 0.1, "viscous only forward");
    assert!((last(&coast(friction(0.5), -3.0), "dq_hinge") - backward).abs() < 1e-9);
    assert!(last(&coast(friction(0.0), 0.0), "q_hinge").abs() < 1e-12, "it must not start by itself");
    let stands = |torque: f64| last(&pushed(&[friction(0.0)], torque, 0.5), "q_hinge").abs() < 1e-12;
    assert!(stands(0.99) && !stands(1.01) && stands(-0.39) && !stands(-0.41));
}

#[test]
fn load_dependent_friction_takes_its_share_of_the_torque() {
    let speed = last(&pushed(&[placed("load_dependent_friction", "hinge", &[0.25])], 2.0, 0.5), "dq_hinge");
    assert!((speed / (0.75 * 2.0 * 0.5 / INERTIA) - 1.0).abs() < 2e-3, "{speed} rad/s");
}

#[test]
fn under_quadratic_drag_the_inverse_speed_grows_linearly() {
    let speed = last(&coast(placed("quadratic_drag", "hinge", &[0.3]), 3.0), "dq_hinge");
    let expected = 1.0 / (1.0 / 3.0 + 0.3 * 0.5 / INERTIA);
    assert!((speed / expected - 1.0).abs() < 1e-3, "{speed} rad/s, expected {expected}");
}

#[test]
fn a_parallel_spring_deflects_by_torque_over_stiffness() {
    let effects = [placed("parallel_spring", "hinge", &[4.0, -0.5]), placed("viscous_friction", "hinge", &[4.0])];
    let mut robot = hanging(0.0);
    robot.links[1].joint.actuator = Actuator::Torque { max_torque: f64::INFINITY };
    let log = run_with(&robot, &effects, &fast_weightless(0.001, 12.0), &hold(1.2));
    assert!((last(&log, "q_hinge") - (1.2 / 4.0 - 0.5)).abs() < 1e-4, "{}", last(&log, "q_hinge"));
}

#[test]
fn cogging_deflects_a_servo_by_its_sine() {
    let mut robot = hanging(0.0);
    robot.links[1].joint.actuator = Actuator::Position { kp: 20.0, ki: 0.0, kd: 4.0, max_torque: f64::INFINITY };
    let effect = placed("cogging", "hinge", &[0.8, 5.0, 0.7]);
    let log = run_with(&robot, &[effect], &fast_weightless(0.001, 6.0), &hold(0.3));
    let q = last(&log, "q_hinge");
    let balance = 20.0 * (0.3 - q) + 0.8 * (5.0 * q + 0.7).sin();
    assert!(balance.abs() < 1e-6 && (q - 0.3).abs() > 0.01, "{q} rad leaves {balance} N·m");
}

#[test]
fn presliding_is_a_spring_until_the_contacts_slide() {
    let moved = |stiffness: f64, torque: f64| {
        last(&pushed(&[placed("presliding_friction", "*", &[1.0, stiffness])], torque, 3.0), "q_hinge")
    };
    // Half the torque at which they slide bends the contacts by about torque/stiffness; as they swing, they ratchet on.
    for stiffness in [50.0, 500.0] {
        let bent = moved(stiffness, 0.5) * stiffness;
        assert!((0.3..5.0).contains(&bent), "{bent}");
    }
    assert!(moved(500.0, 1.05) > 0.1, "it must slide");
    let end = last(&coast(placed("presliding_friction", "hinge", &[1.0, 2000.0]), 3.0), "dq_hinge");
    assert!((end - (3.0 - 0.5 / INERTIA)).abs() < 2e-3, "{end} rad/s: Coulomb's law in motion");
}

#[test]
fn a_static_torque_below_coulombs_is_coulombs() {
    let [below, equal] =
        [0.2, 1.0].map(|rest| last(&coast(placed("stribeck_friction", "hinge", &[1.0, rest, 0.5]), 1.0), "q_hinge"));
    assert_eq!(below.to_bits(), equal.to_bits());
}

/// What dry friction and its creep leave of a torque: the law's solution while friction holds.
#[test]
fn a_held_joint_creeps_by_its_law() {
    let (creep, time_s, torque) = (0.02, 0.05, 0.6);
    let effects = [placed("coulomb_friction", "hinge", &[1.0]), placed("friction_creep", "hinge", &[creep, time_s])];
    let log = pushed(&effects, torque, 0.4);
    // Friction takes up dq + time·ddq = creep·friction, and the inertia the rest: dq grows towards creep·torque.
    let rate = (INERTIA + time_s / creep) * creep;
    for (t, dq) in log.clock_s().iter().zip(log.values("dq_hinge").unwrap()) {
        let expected = creep * torque * (1.0 - (-t / rate).exp());
        assert!((dq - expected).abs() < 2e-6, "{t} s: {dq} rad/s, expected {expected}");
    }
}

#[test]
fn beyond_its_torque_creeping_friction_slides_as_any_other() {
    let effects =
        |creep: f64| [placed("coulomb_friction", "hinge", &[1.0]), placed("friction_creep", "hinge", &[creep, 0.0])];
    let speed = |creep: f64| last(&pushed(&effects(creep), 2.0, 0.5), "dq_hinge");
    let slides = 0.5 / INERTIA;
    assert!((speed(1e-5) - slides).abs() < 1e-3, "{} rad/s", speed(1e-5));
    // Without a time constant, friction grows with speed over a width of creep·torque.
    assert!(speed(0.5) > slides + 0.1, "{} rad/s", speed(0.5));
}

#[test]
fn creep_needs_dry_friction() {
    let creep = placed("friction_creep", "hinge", &[0.5, 0.01]);
    assert_eq!(pushed(&[creep], 0.6, 0.2), pushed(&[], 0.6, 0.2));
}

/// The reference engine cannot do it, and says so.
#[test]
fn the_reference_engine_refuses_creep() {
    let effects = [placed("coulomb_friction", "hinge", &[1.0]), placed("friction_creep", "hinge", &[0.02, 0.05])];
    let setup = Setup { engine: EngineName::Rapier, ..fast_weightless(0.001, 0.1) };
    let (robot, drive) = (hanging(0.0), hold(0.0));
    let request = RolloutRequest::new(&robot, &drive).setup(&setup).effects(&effects);
    let error = simulate(request).unwrap_err().to_string();
    assert!(error.contains("friction_creep") && error.contains("engine"), "{error}");
}
