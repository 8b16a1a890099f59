//! What a comparison says first: a sentence for each joint that is off, or one for all that are late alike.

use super::joint::{CauseKind, Compared, JointVerdict, OFF, of_joint};
use super::words::{late_by, size, times};
use btr_identify::compare::ChannelError;
use btr_identify::fit::NOISE;
use serde::Serialize;

/// Joints from which one sentence tells of all that are late alike.
const MANY: usize = 3;
/// Lags are alike within this share of their median, or within this time in s.
const ALIKE: (f64, f64) = (0.25, 0.005);
/// Joints that a sentence names before it counts the others.
const NAMED: usize = 4;

/// The verdict of a comparison, with the keys of `--json`.
#[derive(Clone, Debug, Serialize)]
pub struct CompareVerdict {
    /// What people are told, the worst first. Never empty.
    pub sentences: Vec<String>,
    /// Every compared joint, the worst first.
    pub joints: Vec<JointVerdict>,
}

/// The verdict of a comparison.
pub(super) fn verdict(compared: &Compared) -> CompareVerdict {
    let mut joints: Vec<JointVerdict> = Vec::new();
    for track in &compared.comparison.tracks {
        let judged_by = ["q", "tau"].iter().find_map(|kind| channel(compared, &format!("{kind}_{}", track.joint)));
        if let Some(channel) = judged_by.filter(|_| joints.iter().all(|other| other.joint != track.joint)) {
            joints.push(of_joint(compared, &track.joint, channel));
        }
    }
    joints.sort_by(|a, b| b.x_noise_floor.total_cmp(&a.x_noise_floor));
    let off = said_together(&joints);
    let sentences = if off.is_empty() { vec![nothing_off(compared, &joints)] } else { off };
    CompareVerdict { sentences, joints }
}

fn channel<'a>(compared: &'a Compared, name: &str) -> Option<&'a ChannelError> {
    compared.comparison.channels.iter().find(|channel| channel.name == name)
}

/// The sentence where no joint is off by more than two noise floors.
fn nothing_off(compared: &Compared, joints: &[JointVerdict]) -> String {
    let comparison = compared.comparison;
    let worst = joints.first().map_or_else(|| comparison.worst().map_or(0.0, |c| c.chi), |joint| joint.x_noise_floor);
    let all = if joints.is_empty() { "every channel" } else { "every joint" };
    let within = format!("{all} is within {worst:.2} x the noise floor");
    if let Some(other) = comparison.worst().filter(|channel| channel.chi > OFF) {
        let ChannelError { name, rmse, unit, chi, .. } = other;
        return format!("{within}, but {name} is off by {} x ({} rms)", times(*chi), size(*rmse, unit));
    }
    let beside_runs = |joint: &JointVerdict| Some(joint.rmse / (compared.repeatability)(&joint.channel)?);
    let off = joints.iter().filter(|joint| joint.x_noise_floor > NOISE);
    let of_runs = off.map(|joint| beside_runs(joint).filter(|x| *x <= NOISE)).collect::<Option<Vec<f64>>>();
    if of_runs.is_some_and(|of_runs| !of_runs.is_empty()) {
        return format!(
            "{within}, and off by no more than runs of the same command differ by: nothing is left to explain"
        );
    }
    match comparison.failures().first() {
        None => format!("{within}: nothing is left to explain in these logs{}", but_patterns(&comparison.channels)),
        Some(cell) => {
            format!("{within}: little is left to explain, most of it in {} {}", cell.joint, cell.regime.words())
        }
    }
}

/// The exception of channels whose error is as small as noise but does not look like it; empty without any.
fn but_patterns(channels: &[ChannelError]) -> String {
    let names: Vec<&str> = channels.iter().filter(|channel| !channel.white).map(|channel| &*channel.name).collect();
    match names.as_slice() {
        [] => String::new(),
        [name] => format!(" but a faint pattern in {name}, which is not white"),
        [first @ .., last] if names.len() <= NAMED => {
            format!(" but faint patterns in {} and {last}, which are not white", first.join(", "))
        }
        many => format!(" but faint patterns in {} channels, which are not white", many.len()),
    }
}

/// The sentences about joints that are off, the worst first. Those that are late alike have one together.
fn said_together(joints: &[JointVerdict]) -> Vec<String> {
    let alike = late_alike(joints);
    let mut sentences = Vec::new();
    for joint in joints {
        match alike.iter().position(|other| other.joint == joint.joint) {
            Some(0) => sentences.push(all_late(&alike)),
            Some(_) => {}
            None => sentences.extend(joint.sentence.clone()),
        }
    }
    sentences
}

fn lag_s(joint: &JointVerdict) -> Option<f64> {
    joint.cause.filter(|cause| cause.kind == CauseKind::Late)?.lag_s
}

/// The joints that are late by about the same time; empty unless these are many.
fn late_alike(joints: &[JointVerdict]) -> Vec<&JointVerdict> {
    let mut lags: Vec<f64> = joints.iter().filter_map(lag_s).collect();
    lags.sort_by(f64::total_cmp);
    let Some(&median) = lags.get(lags.len() / 2) else { return Vec::new() };
    let near = |lag: f64| (lag - median).abs() <= (ALIKE.0 * median.abs()).max(ALIKE.1);
    let alike: Vec<&JointVerdict> = joints.iter().filter(|joint| lag_s(joint).is_some_and(near)).collect();
    if alike.len() < MANY { Vec::new() } else { alike }
}

fn all_late(alike: &[&JointVerdict]) -> String {
    let named: Vec<&str> = alike.iter().take(NAMED).map(|joint| joint.joint.as_str()).collect();
    let more = alike.len() - named.len();
    let names = match (named.split_last(), more) {
        (Some((last, others)), 0) => format!("{} and {last}", others.join(", ")),
        _ => format!("{} and {more} more", named.join(", ")),
    };
    let (low, high) = range(alike.iter().filter_map(|joint| lag_s(joint)));
    let (least, most) = range(alike.iter().filter_map(|joint| Some(100.0 * joint.cause?.share)));
    let late = if times(1e3 * low.abs()) == times(1e3 * high.abs()) {
        late_by(high)
    } else {
        format!("{} to {}", times(1e3 * low), late_by(high))
    };
    let share = if (most - least).abs() < 1.0 { format!("{most:.0}") } else { format!("{least:.0} to {most:.0}") };
    let worst = alike[0];
    format!(
        "{names} arrive {late}: {share} % of the squared error of each; {} is worst, {} x the noise floor ({} rms)",
        worst.joint,
        times(worst.x_noise_floor),
        size(worst.rmse, &worst.unit)
    )
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
}
