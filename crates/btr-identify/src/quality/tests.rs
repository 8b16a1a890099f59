#![allow(clippy::unwrap_used)]
use super::*;

fn check(log: &Log) -> Quality {
    super::check(log, find_glitches(log))
}

fn motion(t: f64) -> f64 {
    0.6 * (4.0 * t).sin() + 0.3 * (9.0 * t).sin()
}

/// Hip and knee at 200 Hz; the knee follows 40 ms late.
fn healthy() -> Log {
    let clock: Vec<f64> = (0..2000).map(|i| 0.005 * f64::from(i)).collect();
    let step = 1e-3;
    let read = |late: f64| clock.iter().map(|t| (motion(t - late) / step).round() * step).collect::<Vec<_>>();
    let commands: Vec<f64> = clock.iter().map(|t| motion(*t)).collect();
    let mut log = Log::new(clock.clone()).unwrap();
    for (joint, late) in [("hip", 0.02), ("knee", 0.04)] {
        log.insert(format!("cmd_{joint}"), "rad", Role::Command, commands.clone()).unwrap();
        log.insert(format!("q_{joint}"), "rad", Role::Measured, read(late)).unwrap();
    }
    log
}

fn severity(quality: &Quality, topic: Topic, channel: &str) -> Option<Severity> {
    quality.findings.iter().find(|f| f.topic == topic && f.channel == channel).map(|f| f.severity)
}

#[test]
fn a_healthy_log_is_fine_and_its_lags_are_measured() {
    let quality = check(&healthy());
    assert_eq!(quality.worst(), Severity::Fine, "{:?}", quality.findings);
    assert!((quality.clock.rate_hz - 200.0).abs() < 1e-6 && quality.clock.jitter_s < 1e-9);
    let lag = quality.joints[1].lag.unwrap();
    assert!((lag.seconds - 0.04).abs() < 5e-4 && lag.correlation > 0.99, "{lag:?}");
    assert!((quality.sensors[1].quantum.unwrap() - 1e-3).abs() < 1e-9);
}

#[test]
fn degrees_are_recognised_by_comparison_with_the_command() {
    for (scaled, factor) in [("q_hip", 50.0), ("cmd_hip", 60.0), ("q_hip", 10.0)] {
        let mut log = healthy();
        log.values_mut(scaled).unwrap().iter_mut().for_each(|x| *x *= factor);
        let found = check(&log).findings.iter().any(|f| f.sentence.contains(&format!("is {scaled} in degrees?")));
        assert_eq!(found, factor > 10.0, "{scaled} times {factor}: {:?}", check(&log).findings);
    }
}

#[test]
fn every_fault_is_reported_for_its_channel() {
    let mut log = healthy();
    let n = log.len();
    log.values_mut("q_hip").unwrap()[..1200].fill(f64::NAN);
    log.insert("tau_knee", "N·m", Role::Measured, (0..n).map(|i| (0.01 * i as f64).sin().min(0.5)).collect()).unwrap();
    log.values_mut("q_knee").unwrap()[700] = f64::INFINITY;
    log.insert("imu_gyro_x", "rad/s", Role::Measured, vec![0.0; n]).unwrap();
    log.insert("cmd_toe", "rad", Role::Command, vec![0.1; n]).unwrap();
    log.insert("q_toe", "rad", Role::Measured, vec![0.1; n]).unwrap();
    log.insert("q_far", "rad", Role::Measured, (0..n).map(|i| 90.0 * motion(0.005 * i as f64)).collect()).unwrap();
    let quality = check(&log);
    for (topic, channel, expected) in [
        (Topic::Missing, "q_hip", Severity::Bad),
        (Topic::Missing, "q_knee", Severity::Bad),
        (Topic::Saturation, "tau_knee", Severity::Doubtful),
        (Topic::Dead, "imu_gyro_x", Severity::Doubtful),
        (Topic::Excitation, "toe", Severity::Doubtful),
        (Topic::Unit, "q_far", Severity::Doubtful),
        (Topic::CommandLag, "knee", Severity::Fine),
    ] {
        assert_eq!(severity(&quality, topic, channel), Some(expected), "{topic:?} {:?}", quality.findings);
    }
    assert_eq!(quality.findings[0].severity, Severity::Bad);
}

#[test]
fn clock_gaps_and_commands_after_the_motion_are_reported() {
    let clock = (0..1000).map(|i| 0.01 * f64::from(i) + if i >= 400 { 0.3 } else { 0.0 }).collect();
    let mut log = Log::new(clock).unwrap();
    let at = |late: f64| log.clock_s().iter().map(|t| motion(t - late)).collect::<Vec<_>>();
    let (commands, positions) = (at(0.05), at(0.0));
    log.insert("cmd_knee", "rad", Role::Command, commands).unwrap();
    log.insert("q_knee", "rad", Role::Measured, positions).unwrap();
    let quality = check(&log);
    assert!(quality.clock.gaps.len() == 1 && (quality.clock.gaps[0].1 - 0.31).abs() < 1e-9);
    assert_eq!(severity(&quality, Topic::Gaps, ""), Some(Severity::Doubtful));
    assert_eq!(severity(&quality, Topic::CommandLag, "knee"), Some(Severity::Bad));
    assert_eq!(check(&Log::default()).worst(), Severity::Bad);
}

/// An inertia of 0.1 kg·m² on a servo of 10 N·m/rad, whose command is a sine above its resonance.
fn swinging() -> Log {
    let clock: Vec<f64> = (0..400).map(|i| 0.01 * f64::from(i)).collect();
    let commands: Vec<f64> = clock.iter().map(|t| 0.6 * (14.0 * t).sin()).collect();
    let (mut q, mut dq, mut positions) = (0.0, 0.0, Vec::new());
    for command in &commands {
        positions.push(q);
        for _ in 0..10 {
            dq += 1e-3 * (10.0 * (command - q) - 0.1 * dq) / 0.1;
            q += 1e-3 * dq;
        }
    }
    let mut log = Log::new(clock).unwrap();
    log.insert("cmd_hip", "rad", Role::Command, commands).unwrap();
    log.insert("q_hip", "rad", Role::Measured, positions).unwrap();
    log
}

#[test]
fn a_motion_above_resonance_counts_as_reversed_only_if_it_is() {
    let mut log = swinging();
    assert_eq!(severity(&check(&log), Topic::Sign, "hip"), None, "{:?}", check(&log).findings);
    log.values_mut("q_hip").unwrap().iter_mut().for_each(|q| *q = -*q);
    assert_eq!(severity(&check(&log), Topic::Sign, "hip"), Some(Severity::Bad), "{:?}", check(&log).findings);
}

#[test]
fn frozen_readings_are_reported_and_a_resting_joint_is_not() {
    let frozen = |log: &Log| severity(&check(log), Topic::Dead, "q_hip");
    let mut log = healthy();
    assert_eq!(frozen(&log), None);
    let held = log.channel("q_hip").unwrap().values[700];
    log.values_mut("q_hip").unwrap()[700..].fill(held);
    assert_eq!(frozen(&log), Some(Severity::Bad));
    // Now the command does not move either.
    let held = log.channel("cmd_hip").unwrap().values[650];
    log.values_mut("cmd_hip").unwrap()[650..].fill(held);
    assert_eq!(frozen(&log), None, "{:?}", check(&log).findings);
    log.values_mut("q_hip").unwrap().fill(0.3);
    assert_eq!(frozen(&log), Some(Severity::Bad));
}

#[test]
fn commands_are_compared_with_the_requested_ones() {
    let requested = swinging();
    let shifted = |by: f64| {
        let clock: Vec<f64> = (0..1500).map(|i| 0.002 * f64::from(i)).collect();
        let earlier: Vec<f64> = clock.iter().map(|t| t - by).collect();
        let commands =
            btr_core::log::hold(requested.clock_s(), &requested.channel("cmd_hip").unwrap().values, &earlier);
        let mut log = Log::new(clock).unwrap();
        log.insert("cmd_hip", "rad", Role::Command, commands).unwrap();
        log
    };
    let say = |log: &Log| check_references(&requested, log).map(|found| found.sentence).unwrap_or_default();
    assert_eq!(say(&shifted(0.0)), "");
    assert!(say(&shifted(-0.02)).starts_with("its commands come 20 ms before"), "{}", say(&shifted(-0.02)));
    assert!(say(&shifted(0.1)).starts_with("its commands come 100 ms after"), "{}", say(&shifted(0.1)));
    let mut other = shifted(0.0);
    other.values_mut("cmd_hip").unwrap().iter_mut().enumerate().for_each(|(k, c)| *c = (0.01 * k as f64).sin());
    assert!(say(&other).starts_with("its cmd_hip is not what was requested"), "{}", say(&other));
}

#[test]
fn a_sensor_that_is_stuck_for_long_is_left_out_as_a_whole() {
    let mut log = Log::new((0..400).map(|i| 0.005 * f64::from(i)).collect()).unwrap();
    let mut readings: Vec<f64> = (0..400).map(|i| 0.5 * (0.005 * f64::from(i)).sin()).collect();
    // More than 5 % of the readings.
    let last = readings[99];
    readings[100..160].fill(last);
    log.insert("q_hip", "rad", Role::Measured, readings).unwrap();
    let found = leave_out_glitches(&mut log);
    let told: Vec<(usize, usize, bool)> = found.iter().map(|it| (it.sample, it.samples, it.left_out)).collect();
    assert_eq!(told, [(100, 60, true)]);
    assert!(log.values("q_hip").unwrap()[100..160].iter().all(|x| x.is_nan()));
}
