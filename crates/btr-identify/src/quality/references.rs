//! Recorded commands compared with the references that were requested.

use super::report::{Finding, Severity, Topic};
use btr_core::log::{Log, Role, hold, interpolate};
use btr_core::signal::stats::std;

/// How far commands are looked for, in s, and as a share of what was asked.
const MOST_SHIFT: (f64, f64) = (0.5, 0.4);
/// Shifts are told to this share of the time between two references, ...
const FINEST: f64 = 0.25;
/// ... from so many rows of a log at most, spread over all of it.
const MOST_ROWS: usize = 3000;
/// A shift of less than this share of the log's step is none.
const TELLING: f64 = 0.75;
/// A shift that leaves more than this share of the difference explains nothing.
const EXPLAINS: f64 = 0.5;
/// Commands that differ by this share of their spread are others.
const OTHER: f64 = 0.1;
/// Differences below this share of the spread are rounding.
const ROUNDED: f64 = 1e-6;

/// A command that was asked for, and what the log has of it.
struct CommandPair<'a> {
    name: &'a str,
    asked: &'a [f64],
    told: &'a [f64],
    spread: f64,
}

/// How references become commands between their ticks.
#[derive(Clone, Copy)]
enum Interpolation {
    Held,
    Led,
}

/// What is to be said of a log's commands beside those that were `asked` for, both on the test's clock: that they come sooner
/// or later, or are others. Nothing where they are the same, and where the log has none that change.
pub fn check_references(asked: &Log, log: &Log) -> Option<Finding> {
    let both: Vec<CommandPair> =
        asked.channels().filter_map(|(name, channel)| both(name, &channel.values, log)).collect();
    let of_asked_s = asked.usual_step_s()?;
    let step_s = log.usual_step_s()?.clamp(FINEST * of_asked_s, of_asked_s);
    if both.is_empty() {
        return None;
    }
    let most_s = MOST_SHIFT.0.min(MOST_SHIFT.1 * asked.duration_s());
    // Half steps, of which one at least is none of the log's own.
    let most = (2.0 * most_s / step_s).floor() as i32;
    let shifts = |parity: i32| (0..=most).filter(move |k| k % 2 == parity).flat_map(|k| [-k, k]);
    // Whole steps first, as they are what gets lost.
    let shifts = || shifts(0).chain(shifts(1)).map(|k| 0.5 * step_s * f64::from(k));
    let mut best: Option<(f64, f64, Interpolation)> = None;
    for between in [Interpolation::Held, Interpolation::Led] {
        for shift_s in shifts() {
            let error = error(&both, asked, log, shift_s, between);
            // The smallest shift of those that are as good.
            if best.is_none_or(|(_, least, _)| error < 0.95 * least && least > ROUNDED) {
                best = Some((shift_s, error, between));
            }
        }
    }
    let (shift_s, left, between) = best?;
    let unshifted = error(&both, asked, log, 0.0, between);
    let explains = left < EXPLAINS * unshifted && left < EXPLAINS;
    if explains && shift_s.abs() >= TELLING * log.usual_step_s()? && unshifted > ROUNDED {
        return Some(shifted(shift_s, step_s));
    }
    (left > OTHER).then(|| others(&both, asked, log))
}

fn both<'a>(name: &'a str, asked: &'a [f64], log: &'a Log) -> Option<CommandPair<'a>> {
    let told = &log.channel(name).filter(|channel| channel.role == Role::Command)?.values;
    let spread = std(asked);
    (spread > 0.0 && told.iter().any(|x| x.is_finite())).then_some(CommandPair { name, asked, told, spread })
}

/// Root mean square difference from what was asked `shift_s` before, as a share of its spread; infinite where nothing is left
/// to compare.
fn error(both: &[CommandPair], asked: &Log, log: &Log, shift_s: f64, between: Interpolation) -> f64 {
    let squares: Vec<f64> = both.iter().filter_map(|one| one.square(asked, log, shift_s, between)).collect();
    if squares.is_empty() { f64::INFINITY } else { (squares.iter().sum::<f64>() / squares.len() as f64).sqrt() }
}

impl CommandPair<'_> {
    /// The mean square of the difference, in squares of the spread.
    fn square(&self, asked: &Log, log: &Log, shift_s: f64, between: Interpolation) -> Option<f64> {
        // Stamps may be rounded.
        let slack_s = 1e-6 * asked.usual_step_s().unwrap_or(0.0);
        let every = log.len().div_ceil(MOST_ROWS).max(1);
        let at: Vec<f64> = log.clock_s().iter().step_by(every).map(|t| t - shift_s + slack_s).collect();
        let wanted = match between {
            Interpolation::Held => hold(asked.clock_s(), self.asked, &at),
            Interpolation::Led => interpolate(asked.clock_s(), self.asked, &at),
        };
        let (first, last) = (asked.clock_s().first()?, asked.clock_s().last()?);
        let within = at.iter().map(|t| (first..=last).contains(&t));
        let errors = wanted
            .iter()
            .zip(self.told.iter().step_by(every))
            .zip(within)
            .filter(|(_, within)| *within)
            .map(|((a, b), _)| a - b);
        let (sum, n) = errors.filter(|e| e.is_finite()).fold((0.0, 0.0), |(sum, n), e| (sum + e * e, n + 1.0));
        (n > 1.0).then(|| sum / n / (self.spread * self.spread))
    }
}

fn shifted(shift_s: f64, step_s: f64) -> Finding {
    let ms = 1e3 * shift_s.abs();
    // A robot may well write down what it was told last.
    let by_a_row = (0.0..1.5 * step_s).contains(&shift_s);
    let severity = if by_a_row { Severity::Doubtful } else { Severity::Bad };
    let sentence = if shift_s < 0.0 {
        format!(
            "its commands come {ms:.0} ms before they were asked for: did it lose rows at its beginning? It is compared as \
             if it had not"
        )
    } else {
        format!("its commands come {ms:.0} ms after they were asked for: does its clock begin before the test?")
    };
    Finding::new(Topic::CommandLag, severity, "", sentence)
}

fn others(both: &[CommandPair], asked: &Log, log: &Log) -> Finding {
    let off = |one: &CommandPair| {
        let square = |between| one.square(asked, log, 0.0, between).unwrap_or(0.0);
        square(Interpolation::Held).min(square(Interpolation::Led)).sqrt()
    };
    let worst = both.iter().map(|one| (one.name, off(one))).max_by(|a, b| a.1.total_cmp(&b.1));
    let (name, off) = worst.unwrap_or_default();
    let sentence = format!(
        "its {name} is not what was asked for, at no shift in time: it differs by {:.0} % of its own spread",
        100.0 * off
    );
    Finding::new(Topic::CommandLag, Severity::Bad, name, sentence)
}
