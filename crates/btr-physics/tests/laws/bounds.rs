//! No motor exceeds its bound, neither in the logged nor in the acting torque.

use crate::scene::{ENGINES, Told, arm, fast, fast_weightless, last, on, placed, run, swimmer};
use btr_core::log::Log;
use btr_physics::effects::PlacedEffect;
use btr_physics::presets::ant;
use btr_physics::presets::nao::nao;
use btr_physics::presets::pendulum::pendulum;
use btr_physics::robot::{Actuator, Robot, Sampling};
use btr_physics::rollout::{RolloutRequest, simulate};
use btr_physics::setup::Setup;
use proptest::prelude::{Just, ProptestConfig, Strategy, prop_assert, prop_oneof, proptest};

/// A robot by name, and whether it is in the air.
fn robots() -> impl Strategy<Value = (&'static str, bool)> {
    prop_oneof![Just("pendulum"), Just("arm"), Just("swimmer"), Just("ant"), Just("nao")]
        .prop_flat_map(|name| (Just(name), prop_oneof![Just(false), Just(true)]))
}

fn robot(name: &str) -> Robot {
    match name {
        "pendulum" => pendulum(1.3, 0.7, Actuator::Passive),
        "arm" => arm(),
        "swimmer" => swimmer(Actuator::Passive),
        "ant" => ant::ant(),
        _ => nao(),
    }
}

/// Bound of a motor at all speeds, and its torque-speed line.
#[derive(Clone, Copy, Debug)]
struct Limits {
    torque: f64,
    line: Option<(f64, f64)>,
}

impl Limits {
    fn at(&self, speed: f64) -> f64 {
        let line = self.line.map(|(stall, no_load)| stall * (1.0 - speed.max(0.0) / no_load).max(0.0));
        self.torque.min(line.unwrap_or(f64::INFINITY))
    }
}

/// The first sample in which a motor exceeds its bound.
fn exceeded(log: &Log, limits: Limits) -> Option<String> {
    let joints = log.channels().filter_map(|(name, _)| name.strip_prefix("tau_"));
    joints.map(str::to_owned).find_map(|joint| {
        let [tau, dq] = ["tau", "dq"].map(|kind| log.values(&format!("{kind}_{joint}")).unwrap());
        let bound = |i: usize| limits.at(dq[i].copysign(dq[i] * tau[i]));
        let sample = (0..tau.len()).find(|&i| tau[i].abs() > bound(i) + 1e-12)?;
        let (torque, bound) = (tau[sample], bound(sample));
        Some(format!("{joint} in sample {sample}: {torque} N·m, at most {bound}"))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn no_logged_torque_exceeds_its_bound(
        (name, in_the_air) in robots(),
        (kp, ki, kd) in (1.0..300.0, 0.0..50.0, 0.0..5.0),
        torque in 0.02..4.0,
        line in prop_oneof![Just(None), (0.02..4.0, 0.5..20.0).prop_map(Some)],
        (omega, size) in (1.0..30.0f64, 0.1..2.0f64),
        dt_s in prop_oneof![Just(0.055 / 7.0), Just(0.002), Just(0.0005)],
        period in prop_oneof![Just(None), Just(Some(2)), Just(Some(7))],
        engine in 0..2usize,
    ) {
        let mut robot = robot(name);
        for link in &mut robot.links {
            link.joint.actuator = Actuator::Position { kp, ki, kd, max_torque: torque };
            link.joint.sampling = period.map(|steps| Sampling { period_s: dt_s * steps as f64, velocity_over: 1 });
        }
        let drive = Told(move |t: f64| size * (omega * t).sin());
        let ground = (!in_the_air).then_some(()).and(Setup::default().ground);
        let setup = on(ENGINES[engine], &Setup { ground, control_s: 2.0 * dt_s, ..fast(dt_s, 60.0 * dt_s) });
        let line_of = |(stall, no_load): (f64, f64)| placed("speed_torque_limit", "*", &[stall, no_load]);
        let effects: Vec<PlacedEffect> = line.map(line_of).into_iter().collect();
        // A diverging run has no log.
        if let Ok(log) = simulate(RolloutRequest::new(&robot, &drive).setup(&setup).effects(&effects)) {
            let found = exceeded(&log, Limits { torque, line });
            prop_assert!(found.is_none(), "{}", found.unwrap_or_default());
        }
    }

    /// The bound holds for the acting torque too: a motor that is weaker than the friction in its joint moves nothing,
    /// even a light link with stiff gains. If the joint moved freely, the first step would far exceed the bound.
    #[test]
    fn a_motor_does_not_overcome_friction_above_its_bound(
        mass in 0.02..2.0, length in 0.01..0.5, kp in 1.0..300.0, kd in 0.0..5.0, torque in 0.05..2.0,
        rate in 0.1..100.0,
        dt_s in prop_oneof![Just(0.055 / 7.0), Just(0.002)],
    ) {
        let mut robot = pendulum(mass, length, Actuator::Position { kp, ki: 0.0, kd, max_torque: torque });
        robot.links[1].joint.dry_friction = 1.001 * torque;
        let log = run(&robot, &fast_weightless(dt_s, 100.0 * dt_s), &Told(move |t: f64| rate * t));
        prop_assert!(last(&log, "q_hinge").abs() < 1e-9, "{} rad", last(&log, "q_hinge"));
        let stands = kp * rate * 100.0 * dt_s > torque;
        prop_assert!(!stands || (last(&log, "tau_hinge") - torque).abs() < 1e-12);
    }
}

/// The engine locates the switches between law and bound within the step, so a bounded motor is of second order too.
#[test]
fn a_bounded_motor_is_of_second_order() {
    let robot = pendulum(1.3, 0.7, Actuator::Position { kp: 80.0, ki: 0.0, kd: 6.0, max_torque: 5.0 });
    let end = |dt_s: f64| last(&run(&robot, &fast(dt_s, 0.8), &Told(|_| 1.0)), "q_hinge");
    let truth = end(0.00005);
    let (coarse, fine) = ((end(0.008) - truth).abs(), (end(0.002) - truth).abs());
    assert!(coarse < 1e-3 && fine < 0.2 * coarse, "{coarse} rad, then {fine} rad");
}
