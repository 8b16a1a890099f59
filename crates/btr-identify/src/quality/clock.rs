//! The clock of a log: rate, jitter, gaps.

use super::report::{ClockReport, Finding, Severity, Topic};
use btr_core::log::Log;
use btr_core::signal::missing;

pub(super) fn of(log: &Log) -> ClockReport {
    let usual_s = log.usual_step_s().unwrap_or(0.0);
    let steps = || log.clock_s().windows(2).map(|pair| (pair[0], pair[1] - pair[0]));
    let usual: Vec<f64> = steps().map(|(_, step)| step).filter(|step| *step <= 1.5 * usual_s).collect();
    let variance = usual.iter().map(|step| (step - usual_s).powi(2)).sum::<f64>() / usual.len().max(1) as f64;
    ClockReport {
        samples: log.len(),
        duration_s: log.duration_s(),
        rate_hz: if usual_s > 0.0 { usual_s.recip() } else { 0.0 },
        jitter_s: variance.sqrt(),
        gaps: steps().filter(|(_, step)| *step > 3.0 * usual_s).collect(),
        duplicates: steps().filter(|(_, step)| *step < 0.1 * usual_s).count(),
    }
}

/// Fewest samples of a usable log.
pub const FEWEST_SAMPLES: usize = 20;

/// Findings about a clock.
pub(super) fn findings(clock: &ClockReport, log: &Log) -> Vec<Finding> {
    let mut found = Vec::new();
    let jitter = clock.jitter_s * clock.rate_hz;
    let severity = match () {
        () if clock.samples < FEWEST_SAMPLES => Severity::Bad,
        () if jitter > 0.2 || clock.rate_hz < 20.0 => Severity::Doubtful,
        () => Severity::Fine,
    };
    let ClockReport { samples, duration_s, rate_hz, jitter_s, .. } = clock;
    let sentence =
        format!("{samples} samples in {duration_s:.2} s, {rate_hz:.1} per second, jitter {:.2} ms", 1e3 * jitter_s);
    found.push(Finding::new(Topic::Clock, severity, "", sentence));
    found.extend(gaps(clock, log));
    if clock.duplicates > 0 {
        let sentence =
            format!("{} samples have almost the time of the sample before: the same sample twice?", clock.duplicates);
        found.push(Finding::new(Topic::Clock, Severity::Doubtful, "", sentence));
    }
    found
}

/// Gaps in the clock, and how the replay handles them.
fn gaps(clock: &ClockReport, log: &Log) -> Option<Finding> {
    let longest = clock.gaps.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let (at_s, long_s) = longest;
    let what = match clock.gaps.len() {
        1 => format!("1 gap of {long_s:.3} s at {at_s:.3} s"),
        count => format!("{count} gaps, the longest of {long_s:.3} s at {at_s:.3} s"),
    };
    let consequence = match missing::pieces(log).len() {
        1 => "the last command is held".to_owned(),
        pieces => format!("the log is replayed in {pieces} pieces, each from its own start"),
    };
    Some(Finding::new(Topic::Gaps, Severity::Doubtful, "", format!("{what}: {consequence}")))
}
