//! What speaks for the findings, and the verdict.

use super::report::{Evidence, MissingEffect, Verdict};
use super::thresholds::{AT_MOST, CONSIDERABLE, EXPLAINED, IN_MOST_LOGS, MOSTLY};
use crate::LadderStep;
use crate::fit::measure::NOISE;
use crate::fit::residual_vector::{ResidualVector, chi, squares};
use crate::fit::{FitPoint, LogSet, Objective};
use crate::residual_model::CandidateKind;

/// The squared errors of a fit.
pub(super) struct LogErrors {
    /// Log by log.
    each: Vec<f64>,
    /// The mean square over the logs that judge it: the held-out ones, if there are any.
    pub(super) judged: f64,
}

impl LogErrors {
    /// The errors of a fit with these squares on the held-out logs. If one of these cannot be simulated, the errors of
    /// all of them are infinite.
    pub(super) fn of(objective: &Objective, fit: &FitPoint, held_out: Option<f64>) -> Self {
        let mut each = by_log(objective, LogSet::Learn, Some(&fit.residual));
        let residual = objective.residual(&fit.u, LogSet::HeldOut).ok();
        each.extend(by_log(objective, LogSet::HeldOut, residual.as_ref()));
        let judged = match (objective.logs(LogSet::HeldOut), held_out) {
            ([], _) => chi(fit.squares(), objective.samples(LogSet::Learn)),
            (_, Some(squares)) => chi(squares, objective.samples(LogSet::HeldOut)),
            (_, None) => f64::INFINITY,
        };
        LogErrors { each, judged: judged.powi(2) }
    }
}

/// The sum of squares of each log of a set, infinite without a residual.
fn by_log(objective: &Objective, logs: LogSet, residual: Option<&ResidualVector>) -> Vec<f64> {
    let mut start = 0;
    let error = |&log: &usize| {
        let rows = start..start + objective.description.logs[log].rows();
        start = rows.end;
        residual.map_or(f64::INFINITY, |residual| squares(&residual[rows]))
    };
    objective.logs(logs).iter().map(error).collect()
}

/// The share of the mean square error above the noise, `at_first`, that is gone where it falls from `before` to
/// `after`.
fn share(before: f64, after: f64, at_first: f64) -> f64 {
    match at_first - 1.0 {
        excess if excess <= 0.0 => 0.0,
        // The logs could not be simulated before.
        excess if excess.is_infinite() => f64::from(u8::from(before.is_infinite() && after.is_finite())),
        excess => ((before - after) / excess).clamp(0.0, 1.0),
    }
}

impl Evidence {
    /// What speaks for a finding that changed the errors from `before`; `at_first` is the mean square error before the
    /// first finding.
    pub(super) fn of(before: &LogErrors, after: &LogErrors, at_first: f64) -> Self {
        let better = before.each.iter().zip(&after.each).filter(|(before, after)| after < before);
        Evidence {
            share: share(before.judged, after.judged, at_first),
            logs_better: better.count(),
            logs: after.each.len(),
            established: false,
        }
    }
}

/// The verdict about an error that was `at_first` (a mean square) and is the ladder's `last` now. Marks which findings
/// are established, and bounds their probabilities by how much they explain. `roughly`: whether the noise floors are
/// only roughly known.
pub(super) fn weigh(last: &LadderStep, at_first: f64, roughly: bool, findings: &mut [MissingEffect]) -> Verdict {
    let judged = last.held_out.unwrap_or(last.train);
    if findings.is_empty() {
        return if judged <= NOISE { Verdict::NothingMissing } else { Verdict::Unexplained };
    }
    let explained = if roughly { judged <= EXPLAINED } else { judged.max(last.train) <= NOISE };
    let share = share(at_first, judged.powi(2), at_first);
    let mostly = share >= MOSTLY || judged.max(last.train) <= EXPLAINED;
    for found in findings.iter_mut() {
        let evidence = &mut found.evidence;
        let in_most = evidence.logs_better as f64 >= IN_MOST_LOGS * evidence.logs as f64;
        evidence.established = explained || (mostly && evidence.share >= CONSIDERABLE && in_most);
        if !explained {
            // The likelihood takes what is left for noise. It is not: another cause may be behind all of it.
            found.probability *= share.min(AT_MOST);
        }
    }
    let named = || findings.iter().filter(|found| found.evidence.established);
    match (explained, named().count()) {
        (_, 0) => Verdict::Unexplained,
        (false, _) => Verdict::PartlyExplained,
        (true, _) if named().all(|found| found.kind == CandidateKind::Value) => Verdict::ValueWrong,
        (true, _) => Verdict::EffectMissing,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(share: f64, logs_better: usize) -> MissingEffect {
        MissingEffect {
            kind: CandidateKind::Effect,
            evidence: Evidence { share, logs_better, logs: 5, established: false },
            effect: "coulomb_friction".to_owned(),
            site: "elbow".to_owned(),
            alike: Vec::new(),
            probability: 1.0,
            delta_bic: 100.0,
            parameters: Vec::new(),
            candidate: 0,
        }
    }

    fn verdict(train: f64, held_out: f64, findings: &mut [MissingEffect]) -> Verdict {
        let last = LadderStep { step: "+ coulomb_friction@elbow".to_owned(), train, held_out: Some(held_out) };
        weigh(&last, 10.0 * 10.0, false, findings)
    }

    #[test]
    fn both_errors_must_be_noise() {
        assert_eq!(verdict(1.0, 1.0, &mut [found(1.0, 5)]), Verdict::EffectMissing);
        assert_eq!(verdict(2.6, 1.1, &mut [found(0.99, 5)]), Verdict::PartlyExplained);
        assert_eq!(verdict(1.1, 1.3, &mut [found(0.99, 5)]), Verdict::PartlyExplained);
        assert_eq!(verdict(1.0, 1.0, &mut []), Verdict::NothingMissing);
    }

    #[test]
    fn a_share_is_a_number_whatever_the_errors() {
        assert!((share(16.0, 6.0, 26.0) - 0.4).abs() < 1e-12);
        // Already below the noise floor; and logs that could not be simulated before.
        assert_eq!((share(0.7, 0.6, 0.7).to_bits(), share(1.0, 1.0, 1.0).to_bits()), (0, 0));
        assert_eq!(share(f64::INFINITY, 1.0, f64::INFINITY).to_bits(), 1f64.to_bits());
        assert_eq!(share(2.0, 1.0, f64::INFINITY).to_bits(), 0);
        assert_eq!(share(f64::INFINITY, f64::INFINITY, f64::INFINITY).to_bits(), 0);
    }

    #[test]
    fn what_leaves_an_error_is_never_certain() {
        let mut findings = [found(0.9, 5), found(0.01, 5), found(0.09, 2)];
        assert_eq!(verdict(1.4, 1.4, &mut findings), Verdict::PartlyExplained);
        assert_eq!(findings.each_ref().map(|found| found.evidence.established), [true, false, false]);
        assert!(findings.iter().all(|found| found.probability <= AT_MOST));
        let mut findings = [found(0.9, 5)];
        assert_eq!(verdict(4.0, 4.0, &mut findings), Verdict::Unexplained);
        let mut findings = [found(0.5, 5)];
        assert_eq!(verdict(7.0, 7.0, &mut findings), Verdict::Unexplained);
        assert!(findings[0].probability < 0.6 && !findings[0].evidence.established);
    }
}
