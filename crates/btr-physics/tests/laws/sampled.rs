//! Digital servos sample, compute and hold.

use crate::scene::{Told, fast, placed, run, run_with};
use btr_core::log::Log;
use btr_core::world::WorldError;
use btr_physics::presets::pendulum::pendulum;
use btr_physics::robot::{Actuator, DutyLoop, Robot, Sampling};
use btr_physics::rollout::{RolloutRequest, simulate};
use btr_physics::setup::Setup;

const KP: f64 = 80.0;
const KD: f64 = 8.0;
const LIMIT: f64 = 30.0;
const DT_S: f64 = 0.0005;

fn wave() -> Told<impl Fn(f64) -> f64 + Send + Sync> {
    Told(|t: f64| 0.5 * (7.0 * t).sin())
}

fn with(actuator: Actuator, sampling: Option<Sampling>) -> Robot {
    let mut robot = pendulum(1.3, 0.7, actuator);
    robot.links[1].joint.sampling = sampling;
    robot
}

fn servo(period_s: f64, velocity_over: u32) -> Robot {
    let actuator = Actuator::Position { kp: KP, ki: 0.0, kd: KD, max_torque: LIMIT };
    with(actuator, (period_s > 0.0).then_some(Sampling { period_s, velocity_over }))
}

/// The largest difference between the motions of two runs.
fn apart(a: &Log, b: &Log) -> f64 {
    let pairs = a.values("q_hinge").unwrap().iter().zip(b.values("q_hinge").unwrap());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn a_digital_servo_becomes_a_continuous_one_as_its_period_falls() {
    let continuous = run(&servo(0.0, 1), &fast(DT_S, 2.0), &wave());
    let error = |period_s: f64| apart(&continuous, &run(&servo(period_s, 1), &fast(DT_S, 2.0), &wave()));
    let (coarse, middle, fine) = (error(8.0 * DT_S), error(4.0 * DT_S), error(2.0 * DT_S));
    assert!(coarse > 1e-3, "{coarse}");
    // The delay is half a period on average, hence a first-order error.
    assert!(
        (1.6..2.6).contains(&(coarse / middle)) && (1.5..2.6).contains(&(middle / fine)),
        "{coarse} {middle} {fine}"
    );
}

#[test]
fn a_duty_loop_can_be_digital_as_well() {
    let duty = Actuator::Voltage {
        kt: 1.5,
        resistance: 2.0,
        servo: Some(DutyLoop { gain: 10.0, max_duty: 0.9, supply: 12.0 }),
    };
    let run = |steps: f64| {
        let sampling = (steps > 0.0).then_some(Sampling { period_s: steps * DT_S, velocity_over: 1 });
        run(&with(duty.clone(), sampling), &fast(DT_S, 2.0), &wave())
    };
    let (coarse, fine) = (apart(&run(0.0), &run(8.0)), apart(&run(0.0), &run(4.0)));
    assert!(coarse > 1e-3 && (1.5..2.8).contains(&(coarse / fine)), "{coarse} {fine}");
}

#[test]
fn the_output_is_held_until_the_next_instant() {
    let log = run(&servo(5.0 * DT_S, 1), &fast(DT_S, 1.0), &wave());
    let tau = log.values("tau_hinge").unwrap();
    for held in tau.chunks_exact(5) {
        assert!(held.iter().all(|x| x.to_bits() == held[0].to_bits()), "{held:?}");
    }
    let changes =
        tau.chunks_exact(5).zip(tau.chunks_exact(5).skip(1)).filter(|(a, b)| a[0].to_bits() != b[0].to_bits()).count();
    assert!(changes > 350, "{changes}");
}

#[test]
fn the_log_at_an_instant_has_the_output_computed_at_it() {
    for every in [1, 4] {
        let setup = Setup { sample_s: Some(0.002), ..fast(0.002 / f64::from(every), 1.0) };
        let log = run(&servo(0.002, 2), &setup, &wave());
        let values = |name: &str| log.values(name).unwrap().to_vec();
        let (cmd, q, tau) = (values("cmd_hinge"), values("q_hinge"), values("tau_hinge"));
        let mut limited = 0;
        for i in 2..tau.len() {
            let output = KP * (cmd[i] - q[i]) - KD * (q[i] - q[i - 2]) / (2.0 * 0.002);
            limited += usize::from(output.abs() > LIMIT);
            assert!((tau[i] - output.clamp(-LIMIT, LIMIT)).abs() < 1e-9, "sample {i}: {} {output}", tau[i]);
        }
        assert!(limited < tau.len() / 2);
    }
}

#[test]
fn effects_on_commands_and_motors_act_on_digital_servos() {
    let robot = servo(4.0 * DT_S, 1);
    let plain = run(&robot, &fast(DT_S, 1.0), &wave());
    for (effect, value) in [("command_delay", 0.01), ("torque_limit", 3.0), ("motor_lag", 0.01)] {
        let with = run_with(&robot, &[placed(effect, "hinge", &[value])], &fast(DT_S, 1.0), &wave());
        assert!(plain.values("tau_hinge").unwrap() != with.values("tau_hinge").unwrap(), "{effect}");
    }
}

#[test]
fn instants_between_steps_are_refused() {
    let result = simulate(RolloutRequest::new(&servo(1.5 * DT_S, 1), &wave()).setup(&fast(DT_S, 0.1)));
    assert!(matches!(result, Err(WorldError::Setup { .. })), "{result:?}");
}
