//! Recorded commands compared with the references that were requested.

use super::report::{Finding, Severity, Topic};
use btr_core::log::{Log, Role, hold, interpolate};
use btr_core::signal::stats::std;

/// Largest time shift that is searched, in s, and as a share of the references' duration.
const MOST_SHIFT: (f64, f64) = (0.5, 0.4);
/// Resolution of shifts, as a share of the time between two references.
const FINEST: f64 = 0.25;
/// Most rows of a log that are compared, spread over all of it.
const MOST_ROWS: usize = 3000;
/// Smallest shift that is reported, as a share of the log's step.
const SMALLEST: f64 = 0.75;
/// Largest share of the difference that a shift may leave in order to explain it.
const EXPLAINS: f64 = 0.5;
/// Share of their spread by which commands must differ to count as different ones.
const OTHER: f64 = 0.1;
/// Differences below this share of the spread are rounding.
const ROUNDED: f64 = 1e-6;

/// A requested command and the recorded one.
struct CommandPair<'a> {
    name: &'a str,
    requested: &'a [f64],
    recorded: &'a [f64],
    spread: f64,
}

/// How references become commands between their ticks: zero-order hold, or linear interpolation.
#[derive(Clone, Copy)]
enum Interpolation {
    Hold,
    Linear,
}

/// Compares a log's commands with the `requested` ones, both on the test's clock, and reports that they come earlier or
/// later, or are different ones. `None` where they are the same, or where the log has none that change.
pub fn check_references(requested: &Log, log: &Log) -> Option<Finding> {
    let both: Vec<CommandPair> =
        requested.channels().filter_map(|(name, channel)| both(name, &channel.values, log)).collect();
    let requested_step_s = requested.usual_step_s()?;
    let step_s = log.usual_step_s()?.clamp(FINEST * requested_step_s, requested_step_s);
    if both.is_empty() {
        return None;
    }
    let most_s = MOST_SHIFT.0.min(MOST_SHIFT.1 * requested.duration_s());
    // In half steps, so that some shifts lie between the log's samples.
    let most = (2.0 * most_s / step_s).floor() as i32;
    let shifts = |parity: i32| (0..=most).filter(move |k| k % 2 == parity).flat_map(|k| [-k, k]);
    // Whole steps first: rows are lost whole.
    let shifts = || shifts(0).chain(shifts(1)).map(|k| 0.5 * step_s * f64::from(k));
    let mut best: Option<(f64, f64, Interpolation)> = None;
    for between in [Interpolation::Hold, Interpolation::Linear] {
        for shift_s in shifts() {
            let error = error(&both, requested, log, shift_s, between);
            // Of shifts that are equally good, the smallest.
            if best.is_none_or(|(_, least, _)| error < 0.95 * least && least > ROUNDED) {
                best = Some((shift_s, error, between));
            }
        }
    }
    let (shift_s, left, between) = best?;
    let unshifted = error(&both, requested, log, 0.0, between);
    let explains = left < EXPLAINS * unshifted && left < EXPLAINS;
    if explains && shift_s.abs() >= SMALLEST * log.usual_step_s()? && unshifted > ROUNDED {
        return Some(shifted(shift_s, step_s));
    }
    (left > OTHER).then(|| others(&both, requested, log))
}

fn both<'a>(name: &'a str, requested: &'a [f64], log: &'a Log) -> Option<CommandPair<'a>> {
    let recorded = &log.channel(name).filter(|channel| channel.role == Role::Command)?.values;
    let spread = std(requested);
    let has_values = recorded.iter().any(|x| x.is_finite());
    (spread > 0.0 && has_values).then_some(CommandPair { name, requested, recorded, spread })
}

/// Root mean square difference from the commands requested `shift_s` before, as a share of their spread; infinite where
/// nothing is left to compare.
fn error(both: &[CommandPair], requested: &Log, log: &Log, shift_s: f64, between: Interpolation) -> f64 {
    let squares: Vec<f64> = both.iter().filter_map(|one| one.square(requested, log, shift_s, between)).collect();
    if squares.is_empty() { f64::INFINITY } else { (squares.iter().sum::<f64>() / squares.len() as f64).sqrt() }
}

impl CommandPair<'_> {
    /// The mean square of the difference, in squares of the spread.
    fn square(&self, requested: &Log, log: &Log, shift_s: f64, between: Interpolation) -> Option<f64> {
        // Stamps may be rounded.
        let slack_s = 1e-6 * requested.usual_step_s().unwrap_or(0.0);
        let every = log.len().div_ceil(MOST_ROWS).max(1);
        let at: Vec<f64> = log.clock_s().iter().step_by(every).map(|t| t - shift_s + slack_s).collect();
        let expected = match between {
            Interpolation::Hold => hold(requested.clock_s(), self.requested, &at),
            Interpolation::Linear => interpolate(requested.clock_s(), self.requested, &at),
        };
        let (first, last) = (requested.clock_s().first()?, requested.clock_s().last()?);
        let within = at.iter().map(|t| (first..=last).contains(&t));
        let errors = expected
            .iter()
            .zip(self.recorded.iter().step_by(every))
            .zip(within)
            .filter(|(_, within)| *within)
            .map(|((a, b), _)| a - b);
        let (sum, n) = errors.filter(|e| e.is_finite()).fold((0.0, 0.0), |(sum, n), e| (sum + e * e, n + 1.0));
        (n > 1.0).then(|| sum / n / (self.spread * self.spread))
    }
}

fn shifted(shift_s: f64, step_s: f64) -> Finding {
    let ms = 1e3 * shift_s.abs();
    // Some robots record the command of the previous row.
    let by_a_row = (0.0..1.5 * step_s).contains(&shift_s);
    let severity = if by_a_row { Severity::Doubtful } else { Severity::Bad };
    let sentence = if shift_s < 0.0 {
        format!(
            "its commands come {ms:.0} ms before they were requested: did it lose rows at its beginning? It \
             is compared as if it had not"
        )
    } else {
        format!("its commands come {ms:.0} ms after they were requested: does its clock begin before the test?")
    };
    Finding::new(Topic::CommandLag, severity, "", sentence)
}

fn others(both: &[CommandPair], requested: &Log, log: &Log) -> Finding {
    let off = |one: &CommandPair| {
        let square = |between| one.square(requested, log, 0.0, between).unwrap_or(0.0);
        square(Interpolation::Hold).min(square(Interpolation::Linear)).sqrt()
    };
    let worst = both.iter().map(|one| (one.name, off(one))).max_by(|a, b| a.1.total_cmp(&b.1));
    let (name, off) = worst.unwrap_or_default();
    let sentence = format!(
        "its {name} is not what was requested, at any shift in time: it differs by {:.0} % of its spread",
        100.0 * off
    );
    Finding::new(Topic::CommandLag, Severity::Bad, name, sentence)
}
