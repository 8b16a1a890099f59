#![allow(clippy::panic)]
use super::*;
use crate::random::stream;
use proptest::prelude::*;
use rand::RngExt;

/// A joint on a servo that follows steps.
#[derive(Clone, Copy, Debug)]
struct Joint {
    clock_step_s: f64,
    dead_s: f64,
    /// Natural frequency, in rad/s, and damping ratio; a velocity servo of that gain without damping ratio.
    omega: f64,
    damping: Option<f64>,
    /// Time constant of the motor's torque, in s.
    torque_s: f64,
    noise: f64,
    quantum: f64,
    /// Onsets come later by this many s·rad divided by the step.
    small_later: f64,
}

const JOINT: Joint = Joint {
    clock_step_s: 0.01,
    dead_s: 0.04,
    omega: 12.0,
    damping: Some(1.0),
    torque_s: 0.0,
    noise: 5e-4,
    quantum: 1.5e-3,
    small_later: 0.0,
};

/// Clock, command and readings: twelve steps of 0.1 to 0.4 rad to and fro, each held for 1.5 s.
fn record(joint: Joint) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    const HELD_S: f64 = 1.5;
    const LEVELS: [f64; 13] = [0.0, 0.1, -0.3, -0.1, 0.2, 0.05, 0.4, 0.0, 0.25, 0.1, 0.3, -0.1, 0.05];
    let level = |t: f64| LEVELS[((t / HELD_S + 1e-9).max(0.0) as usize).min(12)];
    let late = |t: f64| {
        let jump = (level(t) - level(t - HELD_S)).abs().max(0.1);
        level(t - joint.dead_s - joint.small_later / jump)
    };
    let (fine_s, mut q, mut dq, mut torque) = (1e-4, 0.0, 0.0, 0.0);
    let every = (joint.clock_step_s / fine_s).round() as usize;
    let mut rng = stream(5, &[3]);
    let mut log = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..(13.0 * HELD_S / fine_s) as usize {
        let t = fine_s * k as f64;
        if k % every == 0 {
            let gaussian = (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
            let read = q + joint.noise * gaussian;
            log.0.push(t);
            log.1.push(level(t));
            log.2.push(if joint.quantum > 0.0 { (read / joint.quantum).round() * joint.quantum } else { read });
        }
        let error = late(t) - q;
        match joint.damping {
            Some(damping) => {
                let wanted = joint.omega * (joint.omega * error - 2.0 * damping * dq);
                torque += (wanted - torque) * fine_s / joint.torque_s.max(fine_s);
                dq += fine_s * torque;
            }
            None => dq = joint.omega * error,
        }
        q += fine_s * dq;
    }
    log
}

fn found(joint: Joint) -> DeadTime {
    let (clock, command, position) = record(joint);
    dead_time(&clock, &command, &position)
}

/// The dead time is recovered to half a sample and 2 ms, and lies in its interval.
fn assert_recovered(joint: Joint) {
    let DeadTime::Known { seconds, ci95_s: [low, high], onsets } = found(joint) else {
        panic!("{joint:?}: {:?}", found(joint));
    };
    let tolerance_s = 0.5 * joint.clock_step_s + 0.002;
    assert!((seconds - joint.dead_s).abs() < tolerance_s, "{joint:?}: {seconds}");
    assert!(low <= joint.dead_s && joint.dead_s <= high && onsets >= 8, "{joint:?}: {low} {high} {onsets}");
    assert!(high - low < 2.0 * joint.clock_step_s + 0.01, "{joint:?}: {low} {high}");
}

#[test]
fn the_dead_time_is_found_whatever_the_gain_the_clock_and_the_noise() {
    for (clock_step_s, noise, quantum) in
        [(0.01, 5e-4, 1.5e-3), (0.002, 5e-4, 1.5e-3), (0.04, 5e-4, 0.0), (0.01, 0.0, 0.0), (0.002, 2e-3, 0.0)]
    {
        for dead_s in [0.0, 0.01, 0.04] {
            for (omega, damping) in [(10.0, Some(1.0)), (25.0, Some(0.7)), (50.0, Some(1.0)), (8.0, None), (25.0, None)]
            {
                assert_recovered(Joint { clock_step_s, dead_s, omega, damping, noise, quantum, ..JOINT });
            }
        }
    }
}

#[test]
fn a_slow_torque_is_no_dead_time() {
    for (clock_step_s, omega) in [(0.01, 10.0), (0.01, 25.0), (0.002, 10.0), (0.002, 25.0)] {
        assert_recovered(Joint { clock_step_s, omega, torque_s: 0.02, ..JOINT });
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn any_dead_time_is_found(dead_s in 0.0..0.12f64, omega in 8.0..40.0f64, damping in 0.7..1.2f64) {
        assert_recovered(Joint { dead_s, omega, damping: Some(damping), ..JOINT });
    }

    #[test]
    fn units_and_the_clock_s_origin_do_not_matter(scale in 0.01..100.0f64, start_s in -50.0..50.0f64) {
        let (clock, command, position) = record(JOINT);
        let times = |values: &[f64], by: f64| values.iter().map(|x| x * by).collect::<Vec<_>>();
        let later: Vec<f64> = clock.iter().map(|t| t + start_s).collect();
        let scaled = dead_time(&later, &times(&command, -3.0 * scale), &times(&position, -scale));
        let (DeadTime::Known { seconds: a, .. }, DeadTime::Known { seconds: b, .. }) = (scaled, found(JOINT)) else {
            panic!("{scaled:?}");
        };
        prop_assert!((a - b).abs() < 1e-3);
    }
}

#[test]
fn missing_readings_leave_the_dead_time_alone_and_gaps_only_cost_onsets() {
    let (mut clock, command, mut position) = record(JOINT);
    position.iter_mut().skip(3).step_by(7).for_each(|x| *x = f64::NAN);
    clock[605..].iter_mut().for_each(|t| *t += 3.0);
    let DeadTime::Known { seconds, onsets, .. } = dead_time(&clock, &command, &position) else { panic!() };
    assert!((seconds - 0.04).abs() < 0.007 && onsets == 11, "{seconds} {onsets}");
}

#[test]
fn without_steps_from_rest_nothing_is_claimed() {
    let clock: Vec<f64> = (0..2000).map(|i| 0.01 * f64::from(i)).collect();
    let at = |motion: &dyn Fn(f64) -> f64, late_s: f64| clock.iter().map(|t| motion(t - late_s)).collect::<Vec<_>>();
    let ramps = |t: f64| 0.3 * ((t % 6.0 - 3.0).abs() - 1.0).clamp(0.0, 1.0);
    for motion in [&|t: f64| 0.5 * (3.0 * t).sin(), &ramps as &dyn Fn(f64) -> f64, &|_| 0.2] {
        assert_eq!(dead_time(&clock, &at(motion, 0.0), &at(motion, 0.05)), DeadTime::TooFew { onsets: 0 });
    }
    assert_eq!(dead_time(&[], &[], &[]), DeadTime::TooFew { onsets: 0 });
}

#[test]
fn a_joint_that_something_else_moves_is_at_rest_only_where_it_turns_round() {
    let (clock, command, mut position) = record(JOINT);
    position.iter_mut().zip(&clock).for_each(|(q, t)| *q += 0.03 * (8.0 * t).sin());
    let found = dead_time(&clock, &command, &position);
    assert!(matches!(found, DeadTime::TooFew { onsets: 0..=1 }), "{found:?}");
}

#[test]
fn onsets_that_depend_on_the_step_are_told_apart_from_a_dead_time() {
    let DeadTime::Scattered { range_s, small_late, .. } = found(Joint { small_later: 0.008, ..JOINT }) else {
        panic!()
    };
    assert!(small_late && range_s[0] < 0.07 && range_s[1] > 0.1, "{range_s:?}");
}
