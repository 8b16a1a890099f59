//! Resamples several topics on the joint states' clock: commands are held, the rest is interpolated.

use super::other::{Names, Sample, TopicKind};
use crate::channels::series::check_size;
use crate::error::{IoError, Warning};
use btr_core::log::{hold, interpolate};
use std::path::Path;

/// Channels on one clock.
pub(crate) struct Merged {
    pub(crate) clock_s: Vec<f64>,
    pub(crate) series: Vec<(String, Vec<f64>)>,
    pub(crate) warnings: Vec<Warning>,
}

/// How a channel is resampled on the clock.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Onto {
    /// Not resampled; NaN at ticks of other joints.
    Exactly,
    /// The last value before the tick, as servos hold it.
    Held,
    /// Linear interpolation, and the last value after the end, as trajectories are followed.
    Planned,
    /// Linear interpolation.
    Between,
}

struct MergedTrack {
    onto: Onto,
    points: Vec<(u64, f64)>,
}

/// Merges samples in the order in which they were recorded; `None` without joint states.
///
/// # Errors
/// More values than a log may have: every channel has one at every tick.
pub(crate) fn merge(path: &Path, samples: Vec<(TopicKind, Sample)>, names: &Names) -> Result<Option<Merged>, IoError> {
    // Header stamps are preferred, but only if all messages have them: two clocks must not be mixed.
    let stamped = samples.iter().all(|(_, s)| s.stamp_ns > 0);
    let time = |s: &Sample| if stamped { s.stamp_ns } else { s.log_ns };
    let mut clock: Vec<u64> = samples.iter().filter(|(k, s)| is_state(*k, s, names)).map(|(_, s)| time(s)).collect();
    clock.sort_unstable();
    clock.dedup();
    let Some(&first) = clock.first() else { return Ok(None) };
    check_size(path, clock.len(), names.iter().len())?;
    // Beyond 2^53 ns (104 days, so any clock since 1970) seconds in f64 lose nanoseconds: count from the first tick.
    let zero = if first > 1 << 53 { first } else { 0 };
    let signed = |ns: u64| if ns < zero { -((zero - ns) as f64) } else { (ns - zero) as f64 };
    let seconds = |ns: u64| signed(ns) / 1e9;
    let clock_s: Vec<f64> = clock.iter().map(|ns| seconds(*ns)).collect();

    let mut warnings = Vec::new();
    if zero > 0 {
        warnings.push(Warning::ClockShifted { start_ns: zero });
    }
    let mut series = Vec::new();
    for (name, track) in names.iter().zip(tracks(samples, names, time)) {
        let Some(mut track) = track else { continue };
        let all = track.points.len();
        track.points.sort_by_key(|(ns, _)| *ns);
        track.points.dedup_by_key(|(ns, _)| *ns);
        if track.points.len() < all {
            warnings.push(Warning::Repeated { channel: name.to_owned(), count: all - track.points.len() });
        }
        series.push((name.to_owned(), track.onto(&clock_s, seconds)));
    }
    Ok(Some(Merged { clock_s, series, warnings }))
}

/// Whether a sample holds joint positions.
fn is_state(kind: TopicKind, sample: &Sample, names: &Names) -> bool {
    let position = |(number, _): &(usize, f64)| names.of(*number).starts_with("q_");
    kind == TopicKind::States || (kind == TopicKind::Array && sample.values.iter().any(position))
}

/// The samples by the channels' numbers.
fn tracks(samples: Vec<(TopicKind, Sample)>, names: &Names, time: impl Fn(&Sample) -> u64) -> Vec<Option<MergedTrack>> {
    let mut tracks: Vec<Option<MergedTrack>> = names.iter().map(|_| None).collect();
    for (kind, sample) in samples {
        let ns = time(&sample);
        let state = is_state(kind, &sample, names);
        for (number, value) in sample.values {
            let track = tracks[number].get_or_insert_with(|| {
                let onto = match kind {
                    _ if state => Onto::Exactly,
                    TopicKind::Trajectory => Onto::Planned,
                    _ if names.of(number).starts_with("cmd_") => Onto::Held,
                    _ => Onto::Between,
                };
                MergedTrack { onto, points: Vec::new() }
            });
            if let Some(after_start_ns) = sample.after_start_ns {
                track.points.retain(|(planned, _)| *planned < ns.saturating_sub(after_start_ns));
            }
            track.points.push((ns, value));
        }
    }
    tracks
}

impl MergedTrack {
    fn onto(&self, clock_s: &[f64], seconds: impl Fn(u64) -> f64) -> Vec<f64> {
        let x: Vec<f64> = self.points.iter().map(|(ns, _)| seconds(*ns)).collect();
        let y: Vec<f64> = self.points.iter().map(|(_, value)| *value).collect();
        let (Some(&first), Some(&last)) = (x.first(), x.last()) else { return vec![f64::NAN; clock_s.len()] };
        let mut values = match self.onto {
            Onto::Between | Onto::Planned => interpolate(&x, &y, clock_s),
            Onto::Exactly | Onto::Held => hold(&x, &y, clock_s),
        };
        // A channel is unknown before its first sample. After its last one, a sensor is missing and a command is held.
        let mut known = x.iter().peekable();
        for (value, &t) in values.iter_mut().zip(clock_s) {
            while known.next_if(|k| **k < t).is_some() {}
            let exact = known.peek().is_some_and(|k| **k <= t);
            let silent = match self.onto {
                Onto::Exactly => !exact,
                Onto::Held | Onto::Planned => t < first,
                Onto::Between => t < first || t > last,
            };
            if silent {
                *value = f64::NAN;
            }
        }
        values
    }
}
