//! Glitches of joint positions and torques: readings that no motion explains, found and left out.

use super::report::GlitchReport;
use btr_core::log::{Channel, Log, Role, interpolate};
use btr_core::signal::glitch::{
    Glitch, GlitchKind, glitches, glitches_beside, repeated_rows, torque_glitches, usually_longest,
};
use std::ops::Range;

/// Largest share of a channel's readings that is left out: more are no glitches, but how the sensor works. A sensor
/// that is stuck for long counts like the longest of other glitches there, ...
pub(super) const MOST: f64 = 0.05;
/// ... and with all its readings here.
const MOST_STUCK: f64 = 0.2;

/// Searches readings on a clock.
type Search = fn(&[f64], &[f64]) -> Vec<Glitch>;

/// The glitches in the joint positions and torques of a log.
pub fn find_glitches(log: &Log) -> Vec<GlitchReport> {
    let lost = lost_messages(log);
    let is_lost = |at: &GlitchReport| {
        lost.iter().any(|of| of.channel == at.channel && of.sample <= at.sample && at.end() <= of.end())
    };
    let single =
        positions(log).map(|of| (of, glitches as Search)).chain(torques(log).map(|of| (of, torque_glitches as _)));
    let found = single.flat_map(|((name, channel), search)| {
        let found = search(log.clock_s(), &channel.values).into_iter();
        found.map(move |glitch| report(log, name, &glitch, false))
    });
    let mut all: Vec<GlitchReport> = found.filter(|glitch| !is_lost(glitch)).collect();
    all.extend(lost.iter().cloned());
    sort(&mut all, log);
    all
}

/// The samples of all positions where they repeat the samples before, and of the torques that do so as well.
fn lost_messages(log: &Log) -> Vec<GlitchReport> {
    let values: Vec<&[f64]> = positions(log).map(|(_, channel)| channel.values.as_slice()).collect();
    let rows = repeated_rows(log.clock_s(), &values);
    let of_row = |samples: &Range<usize>| {
        let one = |(name, channel): (&str, &Channel)| {
            let (before, worst, after) = (samples.start - 1, samples.end - 1, samples.end);
            let (t, x) = (log.clock_s(), &channel.values);
            let expected = interpolate(&[t[before], t[after]], &[x[before], x[after]], &[t[worst]])[0];
            let (samples, value) = (samples.clone(), x[worst]);
            let glitch = Glitch { samples, worst, kind: GlitchKind::Stuck, value, expected };
            report(log, name, &glitch, true)
        };
        let repeats = |(_, channel): &(&str, &Channel)| {
            let of_message = &channel.values[samples.start - 1..samples.end];
            of_message.iter().all(|x| x.to_bits() == of_message[0].to_bits())
        };
        positions(log).chain(torques(log).filter(repeats)).map(one).collect::<Vec<_>>()
    };
    rows.iter().flat_map(of_row).collect()
}

/// Channel by channel in the order of the log.
fn sort(found: &mut [GlitchReport], log: &Log) {
    found.sort_by_key(|glitch| (log.channels().position(|(name, _)| name == glitch.channel), glitch.sample));
}

fn report(log: &Log, channel: &str, glitch: &Glitch, lost_message: bool) -> GlitchReport {
    GlitchReport {
        channel: channel.to_owned(),
        kind: glitch.kind,
        sample: glitch.samples.start,
        samples: glitch.samples.len(),
        time_s: log.clock_s()[glitch.samples.start],
        value: glitch.value,
        expected: glitch.expected,
        lost_message,
        left_out: false,
    }
}

/// Makes the samples of glitches missing, except in channels where they are too many, until none is left. Returns all
/// that were found.
pub fn leave_out_glitches(log: &mut Log) -> Vec<GlitchReport> {
    until_none_is_left(log, &[], find_glitches)
}

/// The same for those that show beside a simulation of the log; `before` are those that were left out so earlier.
pub fn leave_out_glitches_beside(log: &mut Log, simulated: &Log, before: &[GlitchReport]) -> Vec<GlitchReport> {
    until_none_is_left(log, before, |log| {
        let beside = |(name, channel): (&str, &Channel)| {
            let model = interpolate(simulated.clock_s(), simulated.values(name).ok()?, log.clock_s());
            let found = glitches_beside(log.clock_s(), &channel.values, &model).into_iter();
            Some(found.map(|glitch| report(log, name, &glitch, false)).collect::<Vec<_>>())
        };
        positions(log).filter_map(beside).flatten().collect()
    })
}

fn until_none_is_left(
    log: &mut Log,
    before: &[GlitchReport],
    find: impl Fn(&Log) -> Vec<GlitchReport>,
) -> Vec<GlitchReport> {
    let mut all: Vec<GlitchReport> = before.to_vec();
    loop {
        // Without the large ones, the noise is clearer, and smaller ones show.
        let found = find(log);
        let (left_out, kept): (Vec<_>, Vec<_>) =
            leave_out(log, found, &all).into_iter().partition(|glitch| glitch.left_out);
        let is_last = left_out.is_empty();
        all.extend(if is_last { kept } else { left_out });
        if is_last {
            break;
        }
    }
    let mut all = all.split_off(before.len());
    sort(&mut all, log);
    all
}

/// Makes the samples of glitches missing, except in channels where they are too many, together with those `before`.
fn leave_out(log: &mut Log, mut found: Vec<GlitchReport>, before: &[GlitchReport]) -> Vec<GlitchReport> {
    let longest = usually_longest(log.clock_s()).unwrap_or(usize::MAX);
    for of_channel in found.chunk_by_mut(|a, b| a.channel == b.channel) {
        let name = of_channel[0].channel.clone();
        let all = || before.iter().filter(|glitch| glitch.channel == name).chain(of_channel.iter());
        let stuck: usize = all().map(|glitch| glitch.samples).sum();
        let wrong: usize = all().map(|glitch| glitch.samples.min(longest)).sum();
        let gone = left_out_of(before, &name);
        let Some(values) = log.values_mut(&name) else { continue };
        let present = (gone + values.iter().filter(|x| x.is_finite()).count()) as f64;
        if wrong as f64 > MOST * present || stuck as f64 > MOST_STUCK * present {
            continue;
        }
        for glitch in of_channel {
            values[glitch.sample..glitch.end()].fill(f64::NAN);
            glitch.left_out = true;
        }
    }
    found
}

/// Number of samples of a channel that were left out.
pub(super) fn left_out_of(found: &[GlitchReport], channel: &str) -> usize {
    found.iter().filter(|glitch| glitch.left_out && glitch.channel == channel).map(|glitch| glitch.samples).sum()
}

fn positions(log: &Log) -> impl Iterator<Item = (&str, &Channel)> {
    measured(log, "q_")
}

fn torques(log: &Log) -> impl Iterator<Item = (&str, &Channel)> {
    measured(log, "tau_")
}

fn measured<'a>(log: &'a Log, prefix: &'static str) -> impl Iterator<Item = (&'a str, &'a Channel)> {
    log.channels().filter(move |(name, channel)| name.starts_with(prefix) && channel.role == Role::Measured)
}
