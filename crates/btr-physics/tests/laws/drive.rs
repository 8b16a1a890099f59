//! Drives give the specified references.

use crate::scene::{hold, run, setup};
use btr_core::log::{Log, Role};
use btr_physics::drive::{Drive, Replay, Sine};
use btr_physics::presets::ant;
use btr_physics::presets::pendulum::pendulum;
use btr_physics::robot::Actuator;
use btr_physics::setup::Setup;

#[test]
fn sine_is_the_papers_formula() {
    let sine = Sine { centres: vec![0.1, -0.2], controller: vec![0.5, 0.3, 0.7, -1.0], omega_rad_s: 4.0 };
    let mut command = [0.0; 2];
    sine.command(0.25, &mut command);
    assert!((command[0] - (0.1 + 0.5 * 1.3_f64.sin())).abs() < 1e-15);
    assert!((command[1] - (-0.2 + 0.7 * 0.0_f64.sin())).abs() < 1e-15);
}

#[test]
fn replaying_a_log_repeats_it_bitwise() {
    let robot = ant::ant();
    let walking = Setup { dt_s: 0.005, duration_s: 1.1, ..Setup::default() };
    let log = run(&robot, &walking, &ant::tripod());
    let again = run(&robot, &Setup { control_s: 0.005, ..walking }, &Replay::new(&log, &robot));
    assert_eq!(log, again);
}

/// Commands of a replay of 1, then of `missing` missing commands, then of 3 and 4: at the start, amid the missing ones,
/// at the 3, and after the end.
fn replayed(missing: usize, torque_on: Option<[f64; 2]>) -> [f64; 4] {
    let robot = pendulum(1.0, 1.0, Actuator::Torque { max_torque: 1.0 });
    let mut log = Log::new((0..missing + 3).map(|i| 10.0 + 0.1 * i as f64).collect()).unwrap();
    let commands = [vec![1.0], vec![f64::NAN; missing], vec![3.0, 4.0]].concat();
    log.insert("cmd_hinge", "N·m", Role::Command, commands).unwrap();
    if let Some(on) = torque_on {
        log.insert("torque_on", "1", Role::Command, [vec![1.0; missing + 1], on.to_vec()].concat()).unwrap();
    }
    let replay = Replay::new(&log, &robot);
    let later = 0.1 * missing as f64;
    [0.0, 0.05 + later, 0.15 + later, 99.0].map(|time_s| {
        let mut command = [0.0];
        replay.command(time_s, &mut command);
        command[0]
    })
}

#[test]
fn replay_holds_and_switches_off() {
    let [start, missing, held, after] = replayed(4, None);
    assert!(missing.is_nan() && [start, held, after].map(|command| command as i32) == [1, 3, 4]);
    assert_eq!(replayed(1, None).map(|command| command as i32), [1, 1, 3, 4]);
    let gated = replayed(4, Some([0.0, 1.0]));
    assert!(gated[2].is_nan() && gated[3] > 3.5);
}

#[test]
fn references_are_held_or_interpolated() {
    let robot = pendulum(1.0, 1.0, Actuator::Torque { max_torque: 1.0 });
    let ramp = crate::scene::Told(|t: f64| t);
    let held = Setup { control_s: 0.04, ..setup(0.01, 0.1) };
    let led = Setup { interpolate: true, ..held.clone() };
    let commands = |setup: &Setup| run(&robot, setup, &ramp).values("cmd_hinge").unwrap().to_vec();
    for (i, (held, led)) in commands(&held).iter().zip(commands(&led)).enumerate() {
        assert!((held - (i / 4) as f64 * 0.04).abs() < 1e-12 && (led - i as f64 * 0.01).abs() < 1e-12);
    }
    assert_eq!(commands(&held).len(), run(&robot, &held, &hold(0.0)).len());
}
