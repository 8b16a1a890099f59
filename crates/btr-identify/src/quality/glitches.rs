//! Glitches of joint positions: readings that no motion explains, found and left out.

use super::report::{Finding, GlitchReport, Severity, Topic};
use btr_core::log::{Channel, Log, Role, interpolate};
use btr_core::signal::glitch::{Glitch, GlitchKind, glitches, glitches_beside, repeated_rows};
use std::ops::Range;

/// Largest share of a channel's readings that is left out: more are no glitches, but how the sensor works.
const MOST: f64 = 0.05;
/// Number of glitches that a finding lists one by one.
const LISTED: usize = 3;

/// The glitches in the joint positions of a log.
pub fn find_glitches(log: &Log) -> Vec<GlitchReport> {
    let lost = lost_messages(log);
    let within = |at: &GlitchReport| lost.iter().any(|other| other.sample <= at.sample && at.end() <= other.end());
    let single = positions(log).flat_map(|(name, channel)| {
        let found = glitches(log.clock_s(), &channel.values).into_iter();
        found.map(move |glitch| report(log, name, &glitch, false))
    });
    let mut all: Vec<GlitchReport> = single.filter(|glitch| !within(glitch)).collect();
    all.extend(lost.iter().cloned());
    sort(&mut all, log);
    all
}

/// The samples of all positions where they repeat the samples before.
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
        positions(log).map(one).collect::<Vec<_>>()
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
    let mut all: Vec<GlitchReport> = Vec::new();
    loop {
        // Without the large ones, the noise is clearer, and smaller ones show.
        let (left_out, kept): (Vec<_>, Vec<_>) = left_out(log).into_iter().partition(|glitch| glitch.left_out);
        let is_last = left_out.is_empty();
        all.extend(if is_last { kept } else { left_out });
        if is_last {
            break;
        }
    }
    sort(&mut all, log);
    all
}

/// One pass of [`leave_out_glitches`].
fn left_out(log: &mut Log) -> Vec<GlitchReport> {
    let found = find_glitches(log);
    leave_out(log, found)
}

/// Leaves out the glitches that show beside a simulation of the log, and returns them.
pub fn leave_out_glitches_beside(log: &mut Log, simulated: &Log) -> Vec<GlitchReport> {
    let beside = |(name, channel): (&str, &Channel)| {
        let model = interpolate(simulated.clock_s(), simulated.values(name).ok()?, log.clock_s());
        let found = glitches_beside(log.clock_s(), &channel.values, &model).into_iter();
        Some(found.map(|glitch| report(log, name, &glitch, false)).collect::<Vec<_>>())
    };
    let found = positions(log).filter_map(beside).flatten().collect();
    leave_out(log, found)
}

/// Makes the samples of glitches missing, except in channels where they are too many.
fn leave_out(log: &mut Log, mut found: Vec<GlitchReport>) -> Vec<GlitchReport> {
    for of_channel in found.chunk_by_mut(|a, b| a.channel == b.channel) {
        let wrong: usize = of_channel.iter().map(|glitch| glitch.samples).sum();
        let Some(values) = log.values_mut(&of_channel[0].channel) else { continue };
        let present = values.iter().filter(|x| x.is_finite()).count();
        if wrong as f64 > MOST * present as f64 {
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

/// One finding for each channel with glitches; `samples` is the number of samples of the log.
pub(super) fn findings(found: &[GlitchReport], samples: usize) -> Vec<Finding> {
    let of_channel = |found: &[GlitchReport]| {
        let (name, wrong) = (&found[0].channel, found.iter().map(|glitch| glitch.samples).sum::<usize>());
        let kinds = [
            (GlitchKind::WrapAround, "off by full turns"),
            (GlitchKind::Zero, "exactly zero"),
            (GlitchKind::Stuck, "stuck at the reading before"),
            (GlitchKind::Spike, "at another value"),
        ];
        let counted = |is: &dyn Fn(&GlitchReport) -> bool, what: &str| {
            let count: usize = found.iter().filter(|glitch| is(glitch)).map(|glitch| glitch.samples).sum();
            (count > 0).then(|| format!("{count} {what}"))
        };
        let alone = |(kind, what): (GlitchKind, &str)| counted(&|it| !it.lost_message && it.kind == kind, what);
        let lost = counted(&|glitch| glitch.lost_message, "from lost messages, which repeat all joints' positions");
        let kinds: Vec<String> = kinds.into_iter().filter_map(alone).chain(lost).collect();
        let listed = |glitch: &GlitchReport| {
            format!("{:.5} instead of {:.5} at {:.3} s", glitch.value, glitch.expected, glitch.time_s)
        };
        let list: Vec<String> = found.iter().take(LISTED).map(listed).collect();
        let more = if found.len() > LISTED { ", ..." } else { "" };
        let fate = match (found[0].left_out, wrong as f64 > MOST * samples as f64) {
            (true, _) if wrong == 1 => "it is left out",
            (true, _) => "they are left out",
            (false, true) => {
                "too many to leave out: they are kept; does the sensor read more slowly than it is logged?"
            }
            (false, false) if wrong == 1 => "it is kept",
            (false, false) => "they are kept",
        };
        let readings = if wrong == 1 { "reading" } else { "readings" };
        let sentence = format!(
            "{name} has {wrong} {readings} that no motion explains: {} ({}{more}); {fate}",
            kinds.join(", "),
            list.join(", ")
        );
        Finding::new(Topic::Glitches, Severity::Doubtful, name, sentence)
    };
    found.chunk_by(|a, b| a.channel == b.channel).map(of_channel).collect()
}

fn positions(log: &Log) -> impl Iterator<Item = (&str, &Channel)> {
    log.channels().filter(|(name, channel)| name.starts_with("q_") && channel.role == Role::Measured)
}
