//! Actuators obey their formulas.

use crate::scene::{G, Told, hold, last, placed, run, run_with, setup, weightless};
use btr_physics::presets::pendulum::pendulum;
use btr_physics::robot::{Actuator, DutyLoop, Robot};
use proptest::prelude::{ProptestConfig, prop_assert, proptest};

const MASS: f64 = 1.3;
const LENGTH: f64 = 0.7;
const INERTIA: f64 = MASS * LENGTH * LENGTH;

fn with(actuator: Actuator) -> Robot {
    pendulum(MASS, LENGTH, actuator)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn servo_deflects_by_gravity_over_kp(
        mass in 0.05..3.0, length in 0.05..1.0, kp in 30.0..200.0, target in -2.0..2.0,
    ) {
        let inertia: f64 = mass * length * length;
        let kd = 2.0 * f64::sqrt(kp * inertia);
        let robot = pendulum(mass, length, Actuator::Position { kp, ki: 0.0, kd, max_torque: 1000.0 });
        let log = run(&robot, &setup(0.055 / 7.0, 8.0), &hold(target));
        let q = last(&log, "q_hinge");
        let weight = mass * G * length * q.sin();
        prop_assert!((kp * (target - q) - weight).abs() < 1e-6, "{} rad", q);
        prop_assert!((last(&log, "tau_hinge") - weight).abs() < 1e-6);
    }
}

#[test]
fn integral_gain_removes_the_static_error() {
    let robot = with(Actuator::Position { kp: 80.0, ki: 100.0, kd: 8.0, max_torque: 100.0 });
    let q = last(&run(&robot, &setup(0.002, 20.0), &hold(1.0)), "q_hinge");
    assert!((q - 1.0).abs() < 1e-4, "{q} rad");
}

#[test]
fn saturated_servo_pushes_with_its_limit() {
    let limited = with(Actuator::Position { kp: 80.0, ki: 0.0, kd: 1.0, max_torque: 1.0 });
    let mut strong = limited.clone();
    strong.links[1].joint.actuator = Actuator::Position { kp: 80.0, ki: 0.0, kd: 1.0, max_torque: f64::INFINITY };
    let quarter = weightless(0.001, 0.25);
    let by_motor = run(&limited, &quarter, &hold(1.5));
    assert!((last(&by_motor, "dq_hinge") - 0.25 / INERTIA).abs() < 1e-6);
    assert!((last(&by_motor, "tau_hinge") - 1.0).abs() < 1e-12);
    let by_effect = run_with(&strong, &[placed("torque_limit", "hinge", &[1.0])], &quarter, &hold(1.5));
    assert_eq!(by_motor, by_effect);
}

#[test]
fn torque_motor_delivers_its_command() {
    let log = run(&with(Actuator::Torque { max_torque: 3.0 }), &weightless(0.001, 0.5), &hold(2.0));
    assert!((last(&log, "dq_hinge") - 0.5 * 2.0 / INERTIA).abs() < 1e-6);
    let log = run(&with(Actuator::Torque { max_torque: 3.0 }), &weightless(0.001, 0.5), &hold(-7.0));
    assert!((last(&log, "dq_hinge") + 0.5 * 3.0 / INERTIA).abs() < 1e-6);
    assert_eq!(log.channel("cmd_hinge").unwrap().unit, "N·m");
}

#[test]
fn voltage_motor_runs_up_to_voltage_over_kt() {
    let robot = with(Actuator::Voltage { kt: 1.5, resistance: 2.0, servo: None });
    let log = run(&robot, &weightless(0.001, 5.0), &hold(6.0));
    assert!((log.values("tau_hinge").unwrap()[0] - 1.5 * 6.0 / 2.0).abs() < 0.01, "stall torque");
    assert!((last(&log, "dq_hinge") - 4.0).abs() < 0.01, "{} rad/s", last(&log, "dq_hinge"));
}

#[test]
fn duty_loop_holds_with_its_stiffness() {
    let servo = Some(DutyLoop { gain: 10.0, max_duty: 0.9, supply: 12.0 });
    let robot = with(Actuator::Voltage { kt: 1.5, resistance: 2.0, servo });
    let q = last(&run(&robot, &setup(0.002, 20.0), &hold(1.0)), "q_hinge");
    let stiffness = 1.5 / 2.0 * 12.0 * 10.0;
    assert!((stiffness * (1.0 - q) - MASS * G * LENGTH * q.sin()).abs() < 1e-6, "{q} rad");
    let push = run(&robot, &weightless(0.001, 0.01), &hold(3.0));
    assert!((push.values("tau_hinge").unwrap()[0] - 1.5 / 2.0 * 12.0 * 0.9).abs() < 0.05, "duty is clamped");
}

#[test]
fn nan_switches_the_torque_off() {
    let mut robot = with(Actuator::Position { kp: 80.0, ki: 5.0, kd: 8.0, max_torque: 100.0 });
    robot.links[1].joint.start = 1.0;
    let mut free = robot.clone();
    free.links[1].joint.actuator = Actuator::Passive;
    let off = run(&robot, &setup(0.002, 1.0), &hold(f64::NAN));
    let swinging = run(&free, &setup(0.002, 1.0), &hold(0.0));
    assert_eq!(off.values("q_hinge").unwrap(), swinging.values("q_hinge").unwrap());
}

#[test]
fn prescribed_joint_follows_and_logs_the_required_torque() {
    let robot = with(Actuator::Prescribed);
    let (dt, w) = (0.001, 4.0);
    let log = run(&robot, &setup(dt, 2.0), &Told(move |t: f64| 0.5 * (w * t).sin()));
    let (q, tau) = (log.values("q_hinge").unwrap(), log.values("tau_hinge").unwrap());
    for i in (100..2000).step_by(50) {
        let t = i as f64 * dt;
        assert!((q[i] - 0.5 * (w * t).sin()).abs() < 1e-5);
        // The acceleration is a backward difference, half a step late.
        let needed =
            -INERTIA * w * w * 0.5 * (w * (t - dt)).sin() + MASS * G * LENGTH * (0.5 * (w * (t - dt)).sin()).sin();
        assert!((tau[i] - needed).abs() < 5e-3, "t = {t}: {} N·m, needed {needed}", tau[i]);
    }
}

#[test]
fn delay_shifts_by_exactly_its_time() {
    let robot = with(Actuator::Position { kp: 80.0, ki: 0.0, kd: 8.0, max_torque: 100.0 });
    let wave = Told(|t: f64| (5.0 * t).sin());
    let still = weightless(0.002, 1.0);
    let prompt = run(&robot, &still, &wave);
    let late = run_with(&robot, &[placed("command_delay", "hinge", &[0.02])], &still, &wave);
    let (prompt, late) = (prompt.values("q_hinge").unwrap(), late.values("q_hinge").unwrap());
    for i in 10..late.len() {
        assert!((late[i] - prompt[i - 10]).abs() < 1e-9, "sample {i}: {} {}", late[i], prompt[i - 10]);
    }
}

#[test]
fn fractional_delay_lies_between_its_neighbours() {
    let robot = with(Actuator::Position { kp: 80.0, ki: 0.0, kd: 8.0, max_torque: 100.0 });
    let wave = Told(|t: f64| (5.0 * t).sin());
    let end = |delay: f64| {
        let effect = [placed("command_delay", "hinge", &[delay])];
        last(&run_with(&robot, &effect, &weightless(0.002, 1.0), &wave), "q_hinge")
    };
    let (early, between, late) = (end(0.008), end(0.0085), end(0.010));
    assert!((between - (0.75 * early + 0.25 * late)).abs() < 1e-6, "{early} {between} {late}");
}

#[test]
fn stiff_servo_on_a_light_link_settles_at_the_papers_step() {
    // It must not chatter with or without the bound, although kd·dt is a thousand times the inertia.
    for max_torque in [f64::INFINITY, 2.0] {
        let robot = pendulum(0.06, 0.01, Actuator::Position { kp: 200.0, ki: 0.0, kd: 1.0, max_torque });
        let log = run(&robot, &setup(0.055 / 7.0, 2.0), &hold(0.5));
        let tail = &log.values("q_hinge").unwrap()[200..];
        assert!(tail.iter().all(|q| (q - 0.5).abs() < 1e-4), "limit {max_torque}: {tail:?}");
    }
}

#[test]
fn saturation_converges_with_the_step() {
    let robot = with(Actuator::Position { kp: 80.0, ki: 0.0, kd: 6.0, max_torque: 5.0 });
    let end = |dt: f64| last(&run(&robot, &setup(dt, 0.8), &hold(1.0)), "q_hinge");
    let truth = 2.0 * end(0.00025) - end(0.0005);
    let (coarse, fine) = ((end(0.004) - truth).abs(), (end(0.002) - truth).abs());
    assert!(coarse < 0.02 && fine < 0.7 * coarse, "{coarse} rad, then {fine} rad");
}
