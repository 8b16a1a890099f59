//! What a log is worth before anything is fitted to it: clock, sensors, and how the joints follow their commands.

use crate::lag::{Lag, lag};
use crate::log::{Channel, Log, Role};
use crate::noise::Noise;
use serde::{Deserialize, Serialize};

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// As it should be.
    Fine,
    /// Results may suffer.
    Doubtful,
    /// Nothing that uses it can be trusted.
    Bad,
}

/// What a finding is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Topic {
    /// Rate, jitter.
    Clock,
    /// Holes in the clock.
    Gaps,
    /// Samples that are not there.
    Missing,
    /// A channel that never changes.
    Dead,
    /// A channel that stands at its end.
    Saturation,
    /// Noise or steps that are large beside the motion.
    Noise,
    /// Numbers that look like another unit.
    Unit,
    /// How late a joint follows its command.
    CommandLag,
    /// A command that tells little.
    Excitation,
}

/// One thing that was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What it is about.
    pub topic: Topic,
    /// How bad it is.
    pub severity: Severity,
    /// The channel or joint; empty for the clock.
    pub channel: String,
    /// In one sentence.
    pub sentence: String,
}

/// The clock of a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Clock {
    /// Samples.
    pub samples: usize,
    /// From the first to the last, in s.
    pub duration_s: f64,
    /// Usual rate, in 1/s; 0 with fewer than two samples.
    pub rate_hz: f64,
    /// Standard deviation of the usual steps, in s.
    pub jitter_s: f64,
    /// Steps longer than three usual ones: when they begin and how long they are, in s.
    pub gaps: Vec<(f64, f64)>,
    /// Steps shorter than a tenth of the usual one: the same sample twice, most likely.
    pub duplicates: usize,
}

/// A channel of a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sensor {
    /// Its name.
    pub name: String,
    /// SI unit as text.
    pub unit: String,
    /// Share of the samples that are not there.
    pub missing: f64,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Standard deviation of the readings' errors, steps included; `None` for commands and with too few readings.
    pub noise: Option<f64>,
    /// The readings' step; `None` where there is none.
    pub quantum: Option<f64>,
    /// Share of the samples that stand at the smallest or the largest value.
    pub at_ends: f64,
}

/// How a joint follows its command.
#[derive(Clone, Debug, PartialEq)]
pub struct Follows {
    /// The joint.
    pub joint: String,
    /// How late; `None` where it does not follow at all.
    pub lag: Option<Lag>,
}

/// All that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Quality {
    /// The clock.
    pub clock: Clock,
    /// Commands and sensors.
    pub sensors: Vec<Sensor>,
    /// Joints with a command and a position.
    pub joints: Vec<Follows>,
    /// What is to be said about all of them, worst first.
    pub findings: Vec<Finding>,
}

impl Quality {
    /// The worst that was found.
    pub fn worst(&self) -> Severity {
        self.findings.iter().map(|finding| finding.severity).max().unwrap_or(Severity::Fine)
    }
}

/// How late a joint is looked for, in s.
const MOST_LAG_S: f64 = 0.5;
/// A lag that is less certain than this, in s, is not told.
const MOST_DOUBT_S: f64 = 0.05;

/// Looks at a log.
pub fn check(log: &Log) -> Quality {
    let clock = clock(log);
    let known = || log.channels().filter(|(_, channel)| channel.role != Role::Truth);
    let sensors: Vec<Sensor> = known().map(|(name, channel)| sensor(name, channel)).collect();
    let mut findings = about_clock(&clock);
    known().zip(&sensors).for_each(|((_, channel), sensor)| findings.extend(about_sensor(sensor, channel.role)));
    let mut joints = Vec::new();
    for (name, position) in known() {
        let Some(joint) = name.strip_prefix("q_") else { continue };
        let Some(command) = log.channel(&format!("cmd_{joint}")) else { continue };
        findings.extend(about_limits(joint, command, position));
        let lag = lag(log.clock_s(), &command.values, &position.values, MOST_LAG_S);
        findings.push(about_command(joint, command, position, lag));
        joints.push(Follows { joint: joint.to_owned(), lag });
    }
    findings.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
    Quality { clock, sensors, joints, findings }
}

fn clock(log: &Log) -> Clock {
    let usual_s = log.usual_step_s().unwrap_or(0.0);
    let steps = || log.clock_s().windows(2).map(|pair| (pair[0], pair[1] - pair[0]));
    let usual: Vec<f64> = steps().map(|(_, step)| step).filter(|step| *step <= 1.5 * usual_s).collect();
    let variance = usual.iter().map(|step| (step - usual_s).powi(2)).sum::<f64>() / usual.len().max(1) as f64;
    Clock {
        samples: log.len(),
        duration_s: log.duration_s(),
        rate_hz: if usual_s > 0.0 { usual_s.recip() } else { 0.0 },
        jitter_s: variance.sqrt(),
        gaps: steps().filter(|(_, step)| *step > 3.0 * usual_s).collect(),
        duplicates: steps().filter(|(_, step)| *step < 0.1 * usual_s).count(),
    }
}

fn sensor(name: &str, channel: &Channel) -> Sensor {
    let there: Vec<f64> = channel.values.iter().copied().filter(|x| x.is_finite()).collect();
    let (min, max) = there.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    let at_end = |x: &&f64| **x <= min || **x >= max;
    let noise = Noise::of(&channel.values).filter(|_| channel.role == Role::Measured);
    Sensor {
        name: name.to_owned(),
        unit: channel.unit.clone(),
        missing: 1.0 - there.len() as f64 / channel.values.len().max(1) as f64,
        min,
        max,
        noise: noise.map(|noise| noise.sigma()),
        quantum: noise.map(|noise| noise.quantum).filter(|quantum| *quantum > 0.0),
        at_ends: there.iter().filter(at_end).count() as f64 / there.len().max(1) as f64,
    }
}

fn finding(topic: Topic, severity: Severity, channel: &str, sentence: String) -> Finding {
    Finding { topic, severity, channel: channel.to_owned(), sentence }
}

fn about_clock(clock: &Clock) -> Vec<Finding> {
    let mut found = Vec::new();
    let jitter = clock.jitter_s * clock.rate_hz;
    let severity = match () {
        () if clock.samples < 20 => Severity::Bad,
        () if jitter > 0.2 || clock.rate_hz < 20.0 => Severity::Doubtful,
        () => Severity::Fine,
    };
    let Clock { samples, duration_s, rate_hz, jitter_s, .. } = clock;
    let sentence =
        format!("{samples} samples in {duration_s:.2} s, {rate_hz:.1} per second, jitter {:.2} ms", 1e3 * jitter_s);
    found.push(finding(Topic::Clock, severity, "", sentence));
    if let Some(longest) = clock.gaps.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)) {
        let bad = longest.1 > 0.1 * clock.duration_s;
        let severity = if bad { Severity::Bad } else { Severity::Doubtful };
        let count = clock.gaps.len();
        let sentence = format!("{count} gaps, the longest {:.3} s at {:.3} s", longest.1, longest.0);
        found.push(finding(Topic::Gaps, severity, "", sentence));
    }
    if clock.duplicates > 0 {
        let sentence = format!("{} samples follow another at once: the same sample twice?", clock.duplicates);
        found.push(finding(Topic::Clock, Severity::Doubtful, "", sentence));
    }
    found
}

fn about_sensor(sensor: &Sensor, role: Role) -> Vec<Finding> {
    let mut found = Vec::new();
    let Sensor { name, unit, missing, min, max, .. } = sensor;
    let mut say = |topic, severity, sentence| found.push(finding(topic, severity, name, sentence));
    if *missing > 0.01 {
        let severity = if *missing > 0.5 { Severity::Bad } else { Severity::Doubtful };
        // A command that is missing is torque switched off, which is no fault.
        let severity = if role == Role::Command && *missing < 1.0 { Severity::Fine } else { severity };
        let why = if role == Role::Command { " (torque off)" } else { "" };
        say(Topic::Missing, severity, format!("{name} lacks {:.1} % of its samples{why}", 100.0 * missing));
    }
    if *missing >= 1.0 {
        return found;
    }
    if min >= max {
        say(Topic::Dead, Severity::Doubtful, format!("{name} never changes: it is {min} {unit} all the time"));
    }
    if unit == "rad" && min.abs().max(max.abs()) > 20.0 {
        let sentence = format!("{name} reaches {:.0} rad: is it in degrees?", min.abs().max(max.abs()));
        say(Topic::Unit, Severity::Doubtful, sentence);
    }
    if let Some(noise) = sensor.noise.filter(|noise| max > min && *noise > 0.1 * (max - min)) {
        let sentence = format!("{name} errs by {noise:.2e} {unit} while it changes by {:.2e} {unit}", max - min);
        say(Topic::Noise, Severity::Doubtful, sentence);
    }
    if name.starts_with("tau_") && max > min && sensor.at_ends > 0.05 {
        let sentence =
            format!("{name} stands at its end {:.0} % of the time: the motor is at its limit", 100.0 * sensor.at_ends);
        say(Topic::Saturation, Severity::Doubtful, sentence);
    }
    found
}

/// A joint that stands at its very end while its command asks for more.
fn about_limits(joint: &str, command: &Channel, position: &Channel) -> Option<Finding> {
    if command.unit != position.unit {
        return None;
    }
    let there = || position.values.iter().zip(&command.values).filter(|(q, c)| q.is_finite() && c.is_finite());
    let (min, max) = there().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (q, _)| (l.min(*q), h.max(*q)));
    let beyond = 0.1 * (max - min);
    let pinned = |(q, told): &(&f64, &f64)| **q >= max && **told > max + beyond || **q <= min && **told < min - beyond;
    let share = there().filter(pinned).count() as f64 / there().count().max(1) as f64;
    (share > 0.02).then(|| {
        let sentence =
            format!("{joint} stands at its end {:.0} % of the time while its command asks for more", 100.0 * share);
        finding(Topic::Saturation, Severity::Doubtful, joint, sentence)
    })
}

/// Whether a joint follows its command, and how late.
fn about_command(joint: &str, command: &Channel, position: &Channel, lag: Option<Lag>) -> Finding {
    let range = |channel: &Channel| {
        let there = channel.values.iter().filter(|x| x.is_finite());
        let (low, high) = there.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
        (high - low).max(0.0)
    };
    let noise = Noise::of(&position.values).map_or(0.0, |noise| noise.sigma());
    if range(command) <= 0.0 || range(position) < 20.0 * noise {
        let sentence = format!("{joint} is hardly moved: it tells next to nothing about itself");
        return finding(Topic::Excitation, Severity::Doubtful, joint, sentence);
    }
    // A torque or a voltage is followed by the acceleration, not by the position.
    if command.unit != position.unit {
        let sentence = format!("{joint} is told in {}; its lag cannot be seen from positions", command.unit);
        return finding(Topic::CommandLag, Severity::Fine, joint, sentence);
    }
    let (severity, sentence) = match lag {
        Some(lag) if lag.likeness >= 0.5 && lag.sd_s > MOST_DOUBT_S => {
            (Severity::Doubtful, format!("{joint} follows its command, but its motion does not tell how late"))
        }
        Some(lag) if lag.likeness >= 0.5 => {
            let severity = if lag.seconds < -3.0 * lag.sd_s - 1e-3 { Severity::Bad } else { Severity::Fine };
            let why = if severity == Severity::Bad { ": clocks or channels are mixed up" } else { "" };
            let (ms, sd) = (1e3 * lag.seconds, 1e3 * lag.sd_s);
            (
                severity,
                format!("{joint} follows its command after {ms:.1} ± {sd:.1} ms (likeness {:.2}){why}", lag.likeness),
            )
        }
        _ => (Severity::Doubtful, format!("{joint} does not follow its command")),
    };
    finding(Topic::CommandLag, severity, joint, sentence)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn motion(t: f64) -> f64 {
        0.6 * (4.0 * t).sin() + 0.3 * (9.0 * t).sin()
    }

    /// Hip and knee at 200 Hz; the knee follows 40 ms late.
    fn healthy() -> Log {
        let clock: Vec<f64> = (0..2000).map(|i| 0.005 * f64::from(i)).collect();
        let step = 1e-3;
        let read = |late: f64| clock.iter().map(|t| (motion(t - late) / step).round() * step).collect::<Vec<_>>();
        let told: Vec<f64> = clock.iter().map(|t| motion(*t)).collect();
        let mut log = Log::new(clock.clone()).unwrap();
        for (joint, late) in [("hip", 0.02), ("knee", 0.04)] {
            log.insert(format!("cmd_{joint}"), "rad", Role::Command, told.clone()).unwrap();
            log.insert(format!("q_{joint}"), "rad", Role::Measured, read(late)).unwrap();
        }
        log
    }

    fn severity(quality: &Quality, topic: Topic, channel: &str) -> Option<Severity> {
        quality.findings.iter().find(|f| f.topic == topic && f.channel == channel).map(|f| f.severity)
    }

    #[test]
    fn a_healthy_log_is_fine_and_its_lags_are_told() {
        let quality = check(&healthy());
        assert_eq!(quality.worst(), Severity::Fine, "{:?}", quality.findings);
        assert!((quality.clock.rate_hz - 200.0).abs() < 1e-6 && quality.clock.jitter_s < 1e-9);
        let lag = quality.joints[1].lag.unwrap();
        assert!((lag.seconds - 0.04).abs() < 5e-4 && lag.likeness > 0.99, "{lag:?}");
        assert!((quality.sensors[1].quantum.unwrap() - 1e-3).abs() < 1e-9);
    }

    #[test]
    fn every_fault_is_found_where_it_is() {
        let mut log = healthy();
        let n = log.len();
        log.values_mut("q_hip").unwrap()[..1200].fill(f64::NAN);
        log.insert("tau_knee", "N·m", Role::Measured, (0..n).map(|i| (0.01 * i as f64).sin().min(0.5)).collect())
            .unwrap();
        log.insert("imu_gyro_x", "rad/s", Role::Measured, vec![0.0; n]).unwrap();
        log.insert("cmd_toe", "rad", Role::Command, vec![0.1; n]).unwrap();
        log.insert("q_toe", "rad", Role::Measured, vec![0.1; n]).unwrap();
        log.insert("q_far", "rad", Role::Measured, (0..n).map(|i| 90.0 * motion(0.005 * i as f64)).collect()).unwrap();
        let quality = check(&log);
        for (topic, channel, expected) in [
            (Topic::Missing, "q_hip", Severity::Bad),
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
    fn clocks_with_holes_and_commands_from_the_future_are_told() {
        let clock = (0..1000).map(|i| 0.01 * f64::from(i) + if i >= 400 { 0.3 } else { 0.0 }).collect();
        let mut log = Log::new(clock).unwrap();
        let at = |late: f64| log.clock_s().iter().map(|t| motion(t - late)).collect::<Vec<_>>();
        let (told, did) = (at(0.05), at(0.0));
        log.insert("cmd_knee", "rad", Role::Command, told).unwrap();
        log.insert("q_knee", "rad", Role::Measured, did).unwrap();
        let quality = check(&log);
        assert!(quality.clock.gaps.len() == 1 && (quality.clock.gaps[0].1 - 0.31).abs() < 1e-9);
        assert_eq!(severity(&quality, Topic::Gaps, ""), Some(Severity::Doubtful));
        assert_eq!(severity(&quality, Topic::CommandLag, "knee"), Some(Severity::Bad));
        assert_eq!(check(&Log::default()).worst(), Severity::Bad);
    }
}
