//! Checks of a single channel: missing samples, dead or saturated signals, noise, units.

use super::report::{Finding, SensorReport, Severity, Topic};
use btr_core::log::{Channel, Log, Role};
use btr_core::signal::missing::{Gap, spells};
use btr_core::signal::noise::NoiseEstimate;

/// Number of torque-off intervals that a finding lists one by one.
const LISTED: usize = 3;
/// Most torque-off intervals of a command that is plausibly recorded at every sample. With more, its cells are most
/// likely filled only when a command was sent.
const SPARSE: usize = 10;

/// The statistics of a channel, of which `left_out` samples were left out as glitches.
pub(super) fn sensor(name: &str, channel: &Channel, left_out: usize) -> SensorReport {
    let present: Vec<f64> = channel.values.iter().copied().filter(|x| x.is_finite()).collect();
    let (min, max) = present.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    let at_end = |x: &&f64| **x <= min || **x >= max;
    let noise = NoiseEstimate::of(&channel.values).filter(|_| channel.role == Role::Measured);
    SensorReport {
        name: name.to_owned(),
        unit: channel.unit.clone(),
        missing: 1.0 - (present.len() + left_out) as f64 / channel.values.len().max(1) as f64,
        min,
        max,
        noise: noise.map(|noise| noise.sigma()),
        quantum: noise.map(|noise| noise.quantum).filter(|quantum| *quantum > 0.0),
        at_ends: present.iter().filter(at_end).count() as f64 / present.len().max(1) as f64,
    }
}

/// Findings about a channel.
pub(super) fn findings(sensor: &SensorReport, channel: &Channel) -> Vec<Finding> {
    let mut found = Vec::new();
    let SensorReport { name, unit, missing, min, max, .. } = sensor;
    let mut say = |topic, severity, sentence| found.push(Finding::new(topic, severity, name, sentence));
    // For commands that are partly missing, `silences` reports each interval.
    if *missing > 0.01 && (channel.role != Role::Command || *missing >= 1.0) {
        let severity = if *missing > 0.5 { Severity::Bad } else { Severity::Doubtful };
        say(Topic::Missing, severity, format!("{name} lacks {:.1} % of its samples", 100.0 * missing));
    }
    let infinite = channel.values.iter().filter(|x| x.is_infinite()).count();
    if infinite > 0 {
        say(Topic::Missing, Severity::Bad, format!("{name} is infinite in {infinite} samples: leave them empty"));
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
        let sentence =
            format!("{name} has a noise of {noise:.2e} {unit} while it changes by only {:.2e} {unit}", max - min);
        say(Topic::Noise, Severity::Doubtful, sentence);
    }
    let at_limit = at_limit(sensor, channel);
    if name.starts_with("tau_") && max > min && at_limit > 0.05 {
        let sentence =
            format!("{name} is at its extreme {:.0} % of the time: the motor is at its limit", 100.0 * at_limit);
        say(Topic::Saturation, Severity::Doubtful, sentence);
    }
    found
}

/// Share of the samples at the largest value above zero or the smallest one below it: a motor that gives nothing is not
/// at its limit.
fn at_limit(sensor: &SensorReport, channel: &Channel) -> f64 {
    let present = || channel.values.iter().filter(|x| x.is_finite());
    let at_end = |x: &&f64| **x >= sensor.max && **x > 0.0 || **x <= sensor.min && **x < 0.0;
    present().filter(at_end).count() as f64 / present().count().max(1) as f64
}

/// Intervals without commands: single messages lost, or torque off.
pub(super) fn silences(log: &Log, name: &str, values: &[f64]) -> Vec<Finding> {
    let (lost, off): (Vec<Gap>, Vec<Gap>) = spells(log, values).into_iter().partition(|spell| spell.lost);
    let (lost, off) = (held(name, &lost), torque_off(name, &off, values));
    lost.into_iter().chain(off).collect()
}

fn held(name: &str, lost: &[Gap]) -> Option<Finding> {
    let longest_s = lost.iter().map(|spell| spell.end_s - spell.start_s).reduce(f64::max)?;
    let samples: usize = lost.iter().map(|spell| spell.samples.len()).sum();
    let times = if samples == 1 { "once".to_owned() } else { format!("{samples} times") };
    let sentence = format!("{name} is empty {times}, {:.0} ms at most: the last command is held", 1e3 * longest_s);
    Some(Finding::new(Topic::Missing, Severity::Fine, name, sentence))
}

fn torque_off(name: &str, off: &[Gap], values: &[f64]) -> Option<Finding> {
    let samples: usize = off.iter().map(|spell| spell.samples.len()).sum();
    if off.is_empty() || samples == values.len() {
        return None;
    }
    let listed: Vec<String> =
        off.iter().take(LISTED).map(|spell| format!("{:.2}..{:.2} s", spell.start_s, spell.end_s)).collect();
    let more = if off.len() > LISTED { format!(" and {} more times", off.len() - LISTED) } else { String::new() };
    let sentence = format!("{name} is empty, which is torque off, {}{more}", listed.join(", "));
    if off.len() <= SPARSE {
        return Some(Finding::new(Topic::Missing, Severity::Fine, name, sentence));
    }
    let sentence = format!("{sentence}; if its cells are only filled when a command is sent, fill in the others");
    Some(Finding::new(Topic::Missing, Severity::Doubtful, name, sentence))
}
