//! Which logs are runs of the same command.

use btr_core::log::{Channel, Log, Role, interpolate};
use btr_core::signal::stats::{quantile, std};

/// Commands are the same where nearly all of their samples...
const NEARLY_ALL: f64 = 0.95;
/// ... differ by less than this share of the command's standard deviation: logs sample a command at other instants.
const ALIKE: f64 = 0.03;
/// Smallest share of the longer log that both must cover.
const COVERED: f64 = 0.8;
/// A command begins to move where it leaves its first value by more than this share of its standard deviation.
const MOVED: f64 = 0.1;

/// Names of the channels that say what a robot was told to do: its commands, or the positions of joints that follow
/// them exactly.
pub(super) fn commands(log: &Log, prescribed: &[String]) -> Vec<String> {
    let told = log.channels().filter(|(_, channel)| channel.role == Role::Command).map(|(name, _)| name.to_owned());
    told.chain(prescribed.iter().map(|joint| format!("q_{joint}"))).collect()
}

/// By how much later the first log does what the second does, in s, if they are runs of the same command; logs that are
/// declared to be such are only aligned.
pub(super) fn shift_s(log: &Log, first: &Log, commands: &[String], declared: bool) -> Option<f64> {
    let onsets = onset_s(log, commands).zip(onset_s(first, commands));
    let shifts = [onsets.map_or(0.0, |(later, earlier)| later - earlier), 0.0];
    let same = shifts.into_iter().find(|shift_s| are_alike(log, first, commands, *shift_s));
    same.or_else(|| declared.then_some(shifts[0]))
}

/// The values of a channel on the clock of another log, NaN beyond its ends. `shift_s` is by how much later it does the
/// same.
pub(super) fn on_clock_of(first: &Log, log: &Log, values: &[f64], shift_s: f64) -> Vec<f64> {
    let clock_s: Vec<f64> = first.clock_s().iter().map(|t| t + shift_s).collect();
    let (begin, end) = (log.clock_s().first().copied(), log.clock_s().last().copied());
    let inside = |t: f64| begin.is_some_and(|begin| t >= begin) && end.is_some_and(|end| t <= end);
    let values = interpolate(log.clock_s(), values, &clock_s);
    values.into_iter().zip(&clock_s).map(|(x, t)| if inside(*t) { x } else { f64::NAN }).collect()
}

fn are_alike(log: &Log, first: &Log, commands: &[String], shift_s: f64) -> bool {
    let overlap_s = (log.duration_s() - shift_s).min(first.duration_s()) + shift_s.min(0.0);
    if commands.is_empty() || overlap_s < COVERED * log.duration_s().max(first.duration_s()) {
        return false;
    }
    let pair = |name: &String| Some((present(log, name)?, present(first, name)?));
    commands.iter().all(|name| {
        let Some((of_log, of_first)) = pair(name) else { return false };
        let on_clock = on_clock_of(first, log, &of_log.values, shift_s);
        let apart = on_clock.iter().zip(&of_first.values).map(|(a, b)| (a - b).abs()).filter(|x| x.is_finite());
        // A command that stays where it is has no size of its own.
        let scale = deviation(of_first).max(f64::EPSILON.sqrt());
        quantile(apart.collect(), NEARLY_ALL).is_some_and(|apart| apart <= ALIKE * scale)
    }) && commands.iter().any(|name| present(first, name).is_some_and(|channel| deviation(channel) > 0.0))
}

/// When the first of the commands begins to move, in s after the first sample.
fn onset_s(log: &Log, commands: &[String]) -> Option<f64> {
    let of = |name: &String| {
        let channel = present(log, name)?;
        let (begin, moved) = (*channel.values.first()?, MOVED * deviation(channel));
        let at = channel.values.iter().position(|x| (x - begin).abs() > moved)?;
        Some(log.clock_s()[at] - log.clock_s()[0])
    };
    commands.iter().filter_map(of).min_by(f64::total_cmp)
}

fn present<'a>(log: &'a Log, name: &str) -> Option<&'a Channel> {
    log.channel(name).filter(|channel| channel.values.iter().any(|x| x.is_finite()))
}

fn deviation(channel: &Channel) -> f64 {
    let present: Vec<f64> = channel.values.iter().copied().filter(|x| x.is_finite()).collect();
    if present.is_empty() { 0.0 } else { std(&present) }
}
