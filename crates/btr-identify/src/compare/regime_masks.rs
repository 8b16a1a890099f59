//! Which samples of a joint's track are in which regime.

use super::quantile::quantile;
use super::regime::Regime;
use super::track::JointTrack;

/// Duration of the regime after a reversal, in s.
const AFTER_REVERSAL_S: f64 = 0.2;
/// Duration of the regime after a step of the command, in s.
const AFTER_STEP_S: f64 = 0.33;
/// Duration of the start of a motion, in s; only in logs of at least three times that.
const START_UP_S: f64 = 1.0;

/// The regimes that occur, with the mask of their samples. Samples without an error are in none; samples without torque
/// are only in regimes that do not depend on it.
pub(super) fn regimes(track: &JointTrack) -> Vec<(Regime, Vec<bool>)> {
    let n = track.clock_s.len();
    let present: Vec<bool> = track.error.iter().map(|e| e.is_finite()).collect();
    let driven: Vec<bool> = (0..n).map(|i| track.command.get(i).is_none_or(|command| command.is_finite())).collect();
    let marked = |regime: Regime| -> Vec<bool> {
        let any_torque = matches!(regime, Regime::Throughout | Regime::TorqueOff);
        let mask = mask(regime, track, &driven);
        (0..n).map(|i| mask[i] && present[i] && (any_torque || driven[i])).collect()
    };
    let all = Regime::ALL.into_iter().map(|regime| (regime, marked(regime)));
    all.filter(|(_, mask)| mask.contains(&true)).collect()
}

fn mask(regime: Regime, track: &JointTrack, driven: &[bool]) -> Vec<bool> {
    let speed = |chosen: &dyn Fn(f64) -> bool| track.motion.iter().map(|m| chosen(m.velocity)).collect::<Vec<_>>();
    let top = quantile(track.motion.iter().map(|m| m.velocity.abs()), 0.95).unwrap_or(0.0);
    let still = track.still;
    let (first, last) = (track.clock_s.first().copied(), track.clock_s.last().copied());
    let (first, long) = (first.unwrap_or(0.0), last.unwrap_or(0.0) - first.unwrap_or(0.0));
    let time = |chosen: &dyn Fn(f64) -> bool| track.clock_s.iter().map(|t| chosen(t - first)).collect::<Vec<_>>();
    match regime {
        Regime::Throughout => vec![true; driven.len()],
        Regime::Forward => speed(&|v| v > still),
        Regime::Backward => speed(&|v| v < -still),
        Regime::Hold => speed(&|v| v.abs() <= still),
        Regime::Slow => speed(&|v| v.abs() > still && v.abs() < 0.25 * top),
        Regime::Fast => speed(&|v| v.abs() > still && v.abs() > 0.6 * top),
        Regime::AfterReversal => after(track, &track.reversals(), AFTER_REVERSAL_S),
        Regime::AfterStep => after(track, &steps(&track.command), AFTER_STEP_S),
        Regime::HighLoad => high_load(&track.load),
        Regime::Saturated if track.is_limited => saturated(&track.load),
        Regime::Saturated => vec![false; driven.len()],
        Regime::StartUp => time(&|t| t < START_UP_S && long >= 3.0 * START_UP_S),
        Regime::Early => time(&|t| t < long / 3.0),
        Regime::Late => time(&|t| t > 2.0 * long / 3.0),
        Regime::Low => third(track, 0),
        Regime::Middle => third(track, 1),
        Regime::High => third(track, 2),
        Regime::TorqueOff => driven.iter().map(|on| !on).collect(),
    }
}

/// The samples at which the command jumps: by a tenth of its range, and far more than it usually changes.
fn steps(command: &[f64]) -> Vec<usize> {
    let present = || command.iter().copied().filter(|x| x.is_finite());
    let range = present().fold(f64::MIN, f64::max) - present().fold(f64::MAX, f64::min);
    let change = |i: usize| (command[i] - command[i - 1]).abs();
    let usual = quantile((1..command.len()).map(change).filter(|c| *c > 0.0), 0.5).unwrap_or(0.0);
    let jump = |i: &usize| change(*i) > 0.1 * range && (change(*i) > 6.0 * usual || change(*i) > 0.9 * range);
    (1..command.len()).filter(jump).collect()
}

/// The samples up to `duration_s` after one of the events.
fn after(track: &JointTrack, events: &[usize], duration_s: f64) -> Vec<bool> {
    let clock = &track.clock_s;
    let mut mask = vec![false; clock.len()];
    for &event in events {
        let end = clock.partition_point(|t| *t <= clock[event] + duration_s);
        mask[event..end].fill(true);
    }
    mask
}

fn high_load(load: &[f64]) -> Vec<bool> {
    let most = quantile(load.iter().map(|x| x.abs()), 0.98).unwrap_or(0.0);
    load.iter().map(|x| most > 0.0 && x.abs() > 0.6 * most).collect()
}

/// Where the load stays at its maximum for several samples: a limit, not a peak.
fn saturated(load: &[f64]) -> Vec<bool> {
    const LASTING: usize = 5;
    const NEAR: f64 = 0.995;
    let most = load.iter().map(|x| x.abs()).filter(|x| x.is_finite()).fold(0.0, f64::max);
    let mut mask: Vec<bool> = load.iter().map(|x| most > 0.0 && x.abs() >= NEAR * most).collect();
    for run in mask.chunk_by_mut(|a, b| a == b).filter(|run| run.len() < LASTING) {
        run.fill(false);
    }
    mask
}

/// The lowest, middle or highest third of the positions.
fn third(track: &JointTrack, which: usize) -> Vec<bool> {
    let positions = || track.motion.iter().map(|m| m.value).filter(|q| q.is_finite());
    let (low, high) = positions().fold((f64::MAX, f64::MIN), |(low, high), q| (low.min(q), high.max(q)));
    let of = |q: f64| ((3.0 * (q - low) / (high - low)) as usize).min(2);
    // A joint that only holds has no thirds.
    let moves = high - low > 20.0 * track.floor;
    track.motion.iter().map(|m| moves && m.value.is_finite() && of(m.value) == which).collect()
}
