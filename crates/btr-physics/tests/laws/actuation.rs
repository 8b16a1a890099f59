//! Effects on commands and motors obey their laws.

use crate::scene::{G, Told, fast, fast_weightless, hold, last, placed, run, run_with};
use btr_core::log::Log;
use btr_physics::drive::Drive;
use btr_physics::effects::{PlacedEffect, commanded};
use btr_physics::presets::pendulum::pendulum;
use btr_physics::robot::Actuator;

/// kg·m².
const INERTIA: f64 = 1.3 * 0.49;

/// Log of a torque motor without gravity; its logged torque is the command that reached it.
fn driven(effect: PlacedEffect, drive: &dyn Drive, duration_s: f64) -> Log {
    let robot = pendulum(1.3, 0.7, Actuator::Torque { max_torque: f64::INFINITY });
    run_with(&robot, &[effect], &fast_weightless(0.0005, duration_s), drive)
}

/// A step of size 1 at 0.1 s.
fn step() -> Told<impl Fn(f64) -> f64 + Send + Sync> {
    Told(|t: f64| if t < 0.1 - 1e-9 { 0.0 } else { 1.0 })
}

/// The motor's torque in the step that ends at `time_s`.
fn torque_at(log: &Log, time_s: f64) -> f64 {
    log.values("tau_hinge").unwrap()[(time_s / 0.0005).round() as usize]
}

#[test]
fn a_lag_responds_to_a_step_exponentially() {
    let log = driven(placed("motor_lag", "hinge", &[0.04]), &step(), 0.4);
    for time_s in [0.12, 0.14, 0.2] {
        // The mean over the step that ends at `time_s`.
        let (from, to) = (f64::exp(-(time_s - 0.0005 - 0.1) / 0.04), f64::exp(-(time_s - 0.1) / 0.04));
        let expected = 1.0 - 0.04 / 0.0005 * (from - to);
        assert!((torque_at(&log, time_s) - expected).abs() < 1e-9, "{} at {time_s} s", torque_at(&log, time_s));
    }
    assert!(torque_at(&log, 0.1) == 0.0);
}

#[test]
fn a_lag_starts_at_its_first_command_and_resets_while_the_motor_is_off() {
    let commands = Told(|t: f64| if (0.1..0.2).contains(&t) { f64::NAN } else { 2.0 + (t > 0.15) as u8 as f64 });
    let log = driven(placed("motor_lag", "hinge", &[0.5]), &commands, 0.3);
    assert!((torque_at(&log, 0.01) - 2.0).abs() < 1e-12, "it does not start from zero");
    assert!(
        torque_at(&log, 0.15) == 0.0 && (torque_at(&log, 0.25) - 3.0).abs() < 1e-12,
        "it restarts at the first command"
    );
}

#[test]
fn a_rate_limit_turns_a_step_into_a_ramp() {
    let log = driven(placed("command_rate_limit", "hinge", &[4.0]), &step(), 0.5);
    // The mean over the step that ends at that time.
    for (time_s, expected) in [(0.15, 0.199), (0.3, 0.799), (0.36, 1.0)] {
        assert!((torque_at(&log, time_s) - expected).abs() < 1e-9, "{} at {time_s} s", torque_at(&log, time_s));
    }
}

#[test]
fn a_dead_band_adds_its_size_to_the_static_error() {
    let robot = pendulum(1.3, 0.7, Actuator::Position { kp: 60.0, ki: 0.0, kd: 6.0, max_torque: f64::INFINITY });
    let band = placed("command_deadband", "hinge", &[0.05]);
    let q = last(&run_with(&robot, &[band], &fast(0.001, 5.0), &hold(0.5)), "q_hinge");
    let weight = 1.3 * G * 0.7 * q.sin();
    assert!((60.0 * (0.5 - 0.05 - q) - weight).abs() < 1e-6, "{q} rad");
}

/// The commands that reach the motor after these, which it is told for 0.1 s each.
fn reached(effect: PlacedEffect, told: &'static [f64]) -> Vec<f64> {
    let at = |t: f64| told[((t + 1e-9) / 0.1).floor().min(told.len() as f64 - 1.0) as usize];
    let log = driven(effect, &Told(at), 0.1 * told.len() as f64);
    (0..told.len()).map(|k| torque_at(&log, 0.1 * k as f64 + 0.05)).collect()
}

#[test]
fn a_goal_is_kept_within_the_band_and_then_given_up_whole() {
    let told = &[0.3, 0.33, 0.35, 0.36, 0.32, 0.30, 0.5, f64::NAN, 0.49];
    let reached = reached(placed("command_hysteresis", "hinge", &[0.055]), told);
    // The first command is the goal whatever the band, also after the motor was off.
    assert_eq!(reached, [0.3, 0.3, 0.3, 0.36, 0.36, 0.3, 0.5, 0.0, 0.49]);
}

#[test]
fn a_resolution_rounds_commands_to_whole_steps() {
    let told = &[0.31, 0.33, -0.34, 0.024, -0.026, f64::NAN];
    let reached = reached(placed("command_resolution", "hinge", &[0.05]), told);
    for (reached, expected) in reached.iter().zip([0.3, 0.35, -0.35, 0.0, -0.05, 0.0]) {
        assert!((reached - expected).abs() < 1e-12, "{reached}, expected {expected}");
    }
}

#[test]
fn what_effects_make_of_commands_alone_is_what_a_rollout_makes_of_them() {
    let told = &[0.3, 0.33, 0.35, 0.36, 0.32, 0.30, 0.5, 0.49];
    for (name, size) in [("command_hysteresis", 0.055), ("command_resolution", 0.05)] {
        let placed = placed(name, "hinge", &[size]);
        assert_eq!(commanded(placed.effect, &[size], told, 0.1), reached(placed, told), "{name}");
    }
}

#[test]
fn a_speed_torque_line_leads_to_the_no_load_speed() {
    let log = driven(placed("speed_torque_limit", "hinge", &[2.0, 5.0]), &hold(100.0), 2.0);
    let dq = log.values("dq_hinge").unwrap();
    for time_s in [0.5, 1.0, 2.0] {
        let expected = 5.0 * (1.0 - f64::exp(-2.0 * time_s / (5.0 * INERTIA)));
        let speed = dq[(time_s / 0.0005).round() as usize];
        assert!((speed / expected - 1.0).abs() < 2e-3, "{speed} rad/s after {time_s} s, expected {expected}");
    }
    let both_ways = Told(|t: f64| if t < 1.0 { 100.0 } else { -100.0 });
    let log = driven(placed("speed_torque_limit", "hinge", &[2.0, 5.0]), &both_ways, 1.5);
    assert!((torque_at(&log, 1.2) + 2.0).abs() < 1e-12, "it brakes with all its torque");
}

#[test]
fn a_sagging_supply_settles_where_load_and_torque_balance() {
    let torque = last(&driven(placed("voltage_sag", "*", &[0.3]), &hold(4.0), 0.1), "tau_hinge");
    assert!((torque * (1.0 + 0.3 * torque) - 4.0).abs() < 1e-9, "{torque} N·m");
}

#[test]
fn a_motor_fades_with_the_energy_it_has_delivered() {
    let log = driven(placed("thermal_fade", "hinge", &[0.2]), &hold(2.0), 1.5);
    let energy = 0.5 * INERTIA * last(&log, "dq_hinge").powi(2);
    let expected = 2.0 * f64::exp(-0.2 * energy);
    let torque = last(&log, "tau_hinge");
    assert!(energy > 2.0 && (torque / expected - 1.0).abs() < 2e-3, "{torque} N·m after {energy} J");
}

#[test]
fn command_effects_do_not_change_a_steady_command() {
    let servo = Actuator::Position { kp: 60.0, ki: 0.0, kd: 6.0, max_torque: f64::INFINITY };
    let robot = pendulum(1.3, 0.7, servo);
    let plain = run(&robot, &fast(0.001, 1.0), &hold(0.5));
    for name in ["command_delay", "motor_lag", "command_rate_limit", "command_hysteresis"] {
        let effect = PlacedEffect::hinted(btr_physics::effects::find(name).unwrap(), "hinge");
        let log = run_with(&robot, &[effect], &fast(0.001, 1.0), &hold(0.5));
        assert!((last(&log, "q_hinge") - last(&plain, "q_hinge")).abs() < 1e-12, "{name}");
    }
}
