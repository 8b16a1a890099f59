//! What speaks for the findings, and the verdict.

use super::report::{Evidence, MissingEffect, Verdict};
use super::thresholds::{AT_MOST, CONSIDERABLE, EXPLAINED, IN_MOST_LOGS, MOSTLY};
use crate::LadderStep;
use crate::fit::measure::{NOISE, held_out_squares};
use crate::fit::residual_vector::{chi, squares};
use crate::fit::{FitPoint, LogSet, Objective};
use crate::residual_model::CandidateKind;

/// The squared errors of a fit.
pub(super) struct LogErrors {
    /// Log by log.
    each: Vec<f64>,
    /// The mean square over the logs that judge it.
    pub(super) judged: f64,
}

impl LogErrors {
    /// The errors of a fit. A held-out log that cannot be simulated has an infinite error.
    pub(super) fn of(objective: &Objective, fit: &FitPoint) -> Self {
        let learn = objective.worst_logs(&fit.residual, usize::MAX);
        let mut learn: Vec<(usize, f64)> =
            learn.into_iter().map(|(log, rows)| (log, squares(&fit.residual[rows]))).collect();
        learn.sort_by_key(|(log, _)| *log);
        let held_out = objective.logs(LogSet::HeldOut);
        let error = |log: &usize| {
            let residual = objective.residuals_of(std::slice::from_ref(&fit.u), std::slice::from_ref(log)).pop();
            residual.and_then(Result::ok).map_or(f64::INFINITY, |residual| squares(&residual))
        };
        let held_out_errors: Vec<f64> = held_out.iter().map(error).collect();
        let judged = match held_out {
            [] => chi(fit.squares(), objective.samples(LogSet::Learn)).powi(2),
            _ => {
                let squares = held_out_squares(objective, &fit.u).unwrap_or(f64::INFINITY);
                chi(squares, objective.samples(LogSet::HeldOut)).powi(2)
            }
        };
        LogErrors { each: learn.into_iter().map(|(_, error)| error).chain(held_out_errors).collect(), judged }
    }
}

impl Evidence {
    /// What speaks for a finding that changed the errors from `before`; `at_first` is the mean square error before the
    /// first finding.
    pub(super) fn of(before: &LogErrors, after: &LogErrors, at_first: f64) -> Self {
        let better = before.each.iter().zip(&after.each).filter(|(before, after)| after < before);
        Evidence {
            share: ((before.judged - after.judged) / (at_first - 1.0)).clamp(0.0, 1.0),
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
    let share = (1.0 - (judged.powi(2) - 1.0) / (at_first - 1.0)).clamp(0.0, 1.0);
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
