//! What speaks for the findings, and the verdict.

use super::own;
use super::report::{CapReason, Evidence, MissingEffect, Verdict};
use super::thresholds::{
    AT_MOST, AT_MOST_AT_ONE_PLACE, AT_MOST_IN_SERIES, AT_MOST_LITTLE, AT_MOST_UNCERTAIN, AT_MOST_UNSTABLE, CLEAN,
    CONSIDERABLE, EXPLAINED, IN_MOST_LOGS, MOSTLY, NEEDED, NEGLIGIBLE, NOISE, SERIES, STABLE,
};
use crate::LadderStep;
use crate::fit::residual_vector::{ResidualVector, chi, squares};
use crate::fit::{Estimate, FitPoint, LogSet, Objective};
use crate::residual_model::{CandidateKind, EffectCandidate, Needs};
use std::ops::Range;

/// The mean square errors of a fit.
#[derive(Clone, Copy, Default)]
pub(super) struct MeanSquares {
    /// Over the training logs.
    learnt: f64,
    /// Over the logs that judge it: the held-out ones, if there are any.
    pub(super) judged: f64,
}

impl MeanSquares {
    /// The larger one of each.
    pub(super) fn max(self, other: Self) -> Self {
        MeanSquares { learnt: self.learnt.max(other.learnt), judged: self.judged.max(other.judged) }
    }

    /// By how much they are above others, on the logs where it is more.
    fn most_above(self, other: Self) -> f64 {
        (self.judged - other.judged).max(self.learnt - other.learnt)
    }
}

/// The squared errors of a fit.
pub(super) struct LogErrors {
    /// Log by log.
    each: Vec<f64>,
    /// Over the logs.
    pub(super) mean: MeanSquares,
    /// Whether they are those of the channels where a candidate shows, and not all.
    in_own_channel: bool,
}

impl LogErrors {
    /// The errors of a fit with these squares on the held-out logs, in the channels where a candidate shows. If a
    /// held-out log cannot be simulated, the errors of all of them are infinite.
    pub(super) fn of(objective: &Objective, candidate: usize, fit: &FitPoint, held_out: Option<f64>) -> Self {
        let residual = objective.residual(&fit.u, LogSet::HeldOut).ok();
        if own::is_apart(objective, candidate) {
            return LogErrors::own(objective, candidate, fit, residual.as_ref());
        }
        LogErrors::whole(objective, fit, held_out, residual.as_ref())
    }

    /// The same in all channels.
    pub(super) fn in_all(objective: &Objective, fit: &FitPoint, held_out: Option<f64>) -> Self {
        let residual = objective.residual(&fit.u, LogSet::HeldOut).ok();
        LogErrors::whole(objective, fit, held_out, residual.as_ref())
    }

    fn whole(objective: &Objective, fit: &FitPoint, held_out: Option<f64>, residual: Option<&ResidualVector>) -> Self {
        let mut each = by_log(objective, LogSet::Learn, Some(&fit.residual));
        each.extend(by_log(objective, LogSet::HeldOut, residual));
        let learnt = chi(fit.squares(), objective.samples(LogSet::Learn));
        let judged = match (objective.logs(LogSet::HeldOut), held_out) {
            ([], _) => learnt,
            (_, Some(squares)) => chi(squares, objective.samples(LogSet::HeldOut)),
            (_, None) => f64::INFINITY,
        };
        let mean = MeanSquares { learnt: learnt.powi(2), judged: judged.powi(2) };
        LogErrors { each, mean, in_own_channel: false }
    }

    /// The same in the channels of a candidate that does not show in all.
    fn own(objective: &Objective, candidate: usize, fit: &FitPoint, held_out: Option<&ResidualVector>) -> Self {
        let errors = |logs: LogSet, residual: Option<&ResidualVector>| -> Vec<f64> {
            let rows = own::rows(objective, candidate, logs).into_iter();
            rows.map(|rows| residual.map_or(f64::INFINITY, |r| squares(&r[rows]))).collect()
        };
        let (learnt, judged) = (errors(LogSet::Learn, Some(&fit.residual)), errors(LogSet::HeldOut, held_out));
        let mean_of = |errors: &[f64], logs: LogSet| {
            errors.iter().sum::<f64>() / own::samples(objective, candidate, logs).max(1) as f64
        };
        let is_judged = own::samples(objective, candidate, LogSet::HeldOut) > 0;
        let of_learnt = mean_of(&learnt, LogSet::Learn);
        let of_judged = if is_judged { mean_of(&judged, LogSet::HeldOut) } else { of_learnt };
        let mean = MeanSquares { learnt: of_learnt, judged: of_judged };
        let each = learnt.into_iter().chain(judged).collect();
        LogErrors { each, mean, in_own_channel: true }
    }
}

/// The rows of each log of a set in its residual.
pub(super) fn rows(objective: &Objective, logs: LogSet) -> Vec<Range<usize>> {
    let mut start = 0;
    let rows = |&log: &usize| {
        let rows = start..start + objective.description.logs[log].rows();
        start = rows.end;
        rows
    };
    objective.logs(logs).iter().map(rows).collect()
}

/// The sum of squares of each log of a set, infinite without a residual.
fn by_log(objective: &Objective, logs: LogSet, residual: Option<&ResidualVector>) -> Vec<f64> {
    let error = |rows| residual.map_or(f64::INFINITY, |residual| squares(&residual[rows]));
    rows(objective, logs).into_iter().map(error).collect()
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

/// The same of the error as it was before.
fn of_rest(before: f64, after: f64) -> f64 {
    share(before, after, before)
}

impl Evidence {
    /// What speaks for a finding that changed the errors from `before`; `at_first` are those before the first
    /// finding.
    pub(super) fn of(before: &LogErrors, after: &LogErrors, at_first: MeanSquares) -> Self {
        let better = before.each.iter().zip(&after.each).filter(|(before, after)| after < before);
        Evidence {
            share: share(before.mean.judged, after.mean.judged, at_first.judged),
            learnt_share: share(before.mean.learnt, after.mean.learnt, at_first.learnt),
            logs_better: better.count(),
            logs: after.each.len(),
            removed: before.mean.most_above(after.mean),
            leave_one_out_change: None,
            leave_one_out_log: None,
            established: false,
            in_own_channel: after.in_own_channel,
            of_rest: of_rest(before.mean.judged, after.mean.judged).min(of_rest(before.mean.learnt, after.mean.learnt)),
        }
    }
}

/// Up to which error a residual counts as noise.
#[derive(Clone, Copy)]
pub(super) struct NoiseBound {
    /// Largest error that is noise, in multiples of the noise floor or of what runs differ by.
    pub(super) noise: f64,
    /// Whether the noise floors are only roughly known.
    pub(super) roughly: bool,
}

/// The verdict about an error that was `at_first` (a mean square) and is the ladder's `last` now. Marks which findings
/// are established, and bounds their probabilities by how much they explain.
pub(super) fn weigh(last: &LadderStep, at_first: f64, bound: NoiseBound, findings: &mut [MissingEffect]) -> Verdict {
    let judged = last.held_out.unwrap_or(last.train);
    if findings.is_empty() {
        return if judged <= bound.noise { Verdict::NothingMissing } else { Verdict::Unexplained };
    }
    let explained = if bound.roughly { judged <= EXPLAINED } else { judged.max(last.train) <= bound.noise };
    let share = share(at_first, judged.powi(2), at_first);
    let mostly = share >= MOSTLY || judged.max(last.train) <= EXPLAINED;
    for found in findings.iter_mut() {
        let evidence = &mut found.evidence;
        let in_most = evidence.logs_better as f64 >= IN_MOST_LOGS * evidence.logs as f64;
        let stable = evidence.leave_one_out_change.is_none_or(|change| change <= STABLE);
        let is_little = evidence.share.max(evidence.learnt_share) < NEGLIGIBLE && evidence.removed < NOISE;
        // A rotor is a small part of a joint's first error beside friction, and nearly all of what is left without it.
        let is_needed = evidence.in_own_channel && evidence.of_rest >= NEEDED;
        let is_considerable = mostly && (evidence.share >= CONSIDERABLE || is_needed) && in_most && stable;
        evidence.established = (explained && !is_little) || is_considerable;
        if is_little {
            found.cap(AT_MOST_LITTLE, CapReason::LittleExplained);
        }
        if !stable {
            found.cap(AT_MOST_UNSTABLE, CapReason::UnstableSize);
        }
        if !explained {
            // The likelihood takes what is left for noise. It is not: another cause may be behind all of it.
            found.lower(share.min(AT_MOST), CapReason::ErrorLeft);
        } else if last.train > CLEAN && !bound.roughly {
            found.cap(AT_MOST, CapReason::ErrorLeft);
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

/// Bounds the probability of a finding whose `sizes` may all be none by their intervals: of laws that together stand in
/// for an unknown one, none is determined beside the others. Each size comes with the value at which it is none.
pub(super) fn doubt_size(found: &mut MissingEffect, sizes: &[(f64, &Estimate)]) {
    let may_be_none =
        |(none, size): &(f64, &Estimate)| size.ci95.is_some_and(|[from, to]| from <= *none && *none <= to);
    if !sizes.is_empty() && sizes.iter().all(may_be_none) {
        found.cap(AT_MOST_UNCERTAIN, CapReason::UncertainSize);
    }
}

/// Bounds the probabilities of findings that may be parts of one law: an effect, and several instances of a similar
/// one.
pub(super) fn doubt_series(candidates: &[EffectCandidate], findings: &mut [MissingEffect]) {
    let first = |found: &MissingEffect| first_instance(candidates, found.candidate);
    let is_series = |first_one: &usize| findings.iter().filter(|found| first(found) == *first_one).count() >= SERIES;
    let series: Vec<usize> = findings.iter().map(first).filter(is_series).collect();
    let is_beside = |found: &MissingEffect, one: &usize| candidates[*one].similar.contains(&found.candidate);
    let with_others: Vec<usize> =
        series.into_iter().filter(|one| findings.iter().any(|found| is_beside(found, one))).collect();
    for found in findings.iter_mut() {
        if with_others.iter().any(|one| first(found) == *one || is_beside(found, one)) {
            found.cap(AT_MOST_IN_SERIES, CapReason::Series);
        }
    }
}

/// Bounds the probabilities of findings at one place, except companions and further instances: one effect that is not
/// in the library may be behind both, or a load of which they are parts. What acts on all joints, or on the whole
/// robot, is not at any place, nor is what shows apart from all else.
pub(super) fn doubt_same_place(
    candidates: &[EffectCandidate],
    findings: &mut [MissingEffect],
    is_apart: impl Fn(usize) -> bool,
) {
    let place = |found: &MissingEffect| {
        let site = found.site.split('#').next().unwrap_or_default();
        let counts = candidates[found.candidate].needs == Needs::Nothing && site != "*" && !is_apart(found.candidate);
        counts.then(|| site.to_owned())
    };
    let places: Vec<String> = findings.iter().filter_map(place).collect();
    for found in findings.iter_mut() {
        let here = place(found);
        if places.iter().filter(|other| Some(*other) == here.as_ref()).count() > 1 {
            found.cap(AT_MOST_AT_ONE_PLACE, CapReason::SamePlace);
        }
    }
}

/// The candidate of which one is a further instance, or itself.
fn first_instance(candidates: &[EffectCandidate], mut candidate: usize) -> usize {
    while let Needs::Instance(before) = candidates[candidate].needs {
        candidate = before;
    }
    candidate
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::report::ProbabilityCap;

    fn found(share: f64, logs_better: usize) -> MissingEffect {
        MissingEffect {
            kind: CandidateKind::Effect,
            evidence: Evidence {
                share,
                learnt_share: share,
                logs_better,
                logs: 5,
                removed: 99.0 * share,
                ..Evidence::default()
            },
            effect: "coulomb_friction".to_owned(),
            site: "elbow".to_owned(),
            alike: Vec::new(),
            probability: 1.0,
            rivals: Vec::new(),
            probability_cap: None,
            delta_bic: 100.0,
            parameters: Vec::new(),
            close: Vec::new(),
            is_granted: false,
            candidate: 0,
        }
    }

    fn verdict(train: f64, held_out: f64, findings: &mut [MissingEffect]) -> Verdict {
        let last =
            LadderStep { step: "+ coulomb_friction@elbow".to_owned(), train, held_out: Some(held_out), u: Vec::new() };
        weigh(&last, 10.0 * 10.0, NoiseBound { noise: 1.15, roughly: false }, findings)
    }

    #[test]
    fn what_a_joint_needs_is_established_beside_what_explains_far_more() {
        let with = |of_rest: f64, in_own_channel: bool| {
            let mut findings = [found(0.98, 5), found(0.02, 5)];
            findings[1].evidence = Evidence { of_rest, in_own_channel, ..findings[1].evidence };
            let last = LadderStep { step: String::new(), train: 1.4, held_out: Some(1.4), u: Vec::new() };
            let bound = NoiseBound { noise: 1.15, roughly: false };
            let verdict = weigh(&last, 5000.0, bound, &mut findings);
            (verdict, findings[1].evidence.established)
        };
        assert_eq!(with(0.9, true), (Verdict::PartlyExplained, true));
        assert_eq!(with(0.5, true), (Verdict::PartlyExplained, false));
        assert_eq!(with(0.9, false), (Verdict::PartlyExplained, false));
    }

    #[test]
    fn both_errors_must_be_noise() {
        assert_eq!(verdict(1.0, 1.0, &mut [found(1.0, 5)]), Verdict::EffectMissing);
        assert_eq!(verdict(2.6, 1.1, &mut [found(0.99, 5)]), Verdict::PartlyExplained);
        assert_eq!(verdict(1.1, 1.3, &mut [found(0.99, 5)]), Verdict::PartlyExplained);
        assert_eq!(verdict(1.0, 1.0, &mut []), Verdict::NothingMissing);
    }

    #[test]
    fn what_rests_on_one_log_is_not_established_while_an_error_is_left() {
        let change = |by: f64| {
            let mut found = found(0.99, 5);
            found.evidence.leave_one_out_change = Some(by);
            found
        };
        assert_eq!(verdict(1.4, 1.4, &mut [change(0.1)]), Verdict::PartlyExplained);
        assert_eq!(verdict(1.4, 1.4, &mut [change(0.9)]), Verdict::Unexplained);
        // Where nothing is left, it is named, and not called certain.
        let mut findings = [change(0.9)];
        assert_eq!(verdict(1.0, 1.0, &mut findings), Verdict::EffectMissing);
        assert!((findings[0].probability - AT_MOST_UNSTABLE).abs() < 1e-12, "{}", findings[0].probability);
        let cap = ProbabilityCap { at_most: AT_MOST_UNSTABLE, reasons: vec![CapReason::UnstableSize] };
        assert_eq!(findings[0].probability_cap, Some(cap));
        // Where it has less, nothing is capped.
        let mut findings = [MissingEffect { probability: 0.5, ..change(0.9) }];
        verdict(1.0, 1.0, &mut findings);
        assert_eq!((findings[0].probability.to_bits(), &findings[0].probability_cap), (0.5_f64.to_bits(), &None));
    }

    #[test]
    fn what_removes_less_than_the_noise_beside_a_large_finding_is_not_established() {
        let little = |removed: f64| {
            let mut little = found(0.001, 5);
            little.evidence.removed = removed;
            little
        };
        let mut findings = [found(0.99, 5), little(0.4), little(3.0)];
        assert_eq!(verdict(1.0, 1.0, &mut findings), Verdict::EffectMissing);
        assert_eq!(findings.each_ref().map(|found| found.evidence.established), [true, false, true]);
        assert!((findings[1].probability - AT_MOST_UNSTABLE).abs() < 1e-12, "{}", findings[1].probability);
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
        let cap = ProbabilityCap { at_most: AT_MOST, reasons: vec![CapReason::ErrorLeft] };
        assert_eq!(findings[0].probability_cap, Some(cap));
        let mut findings = [found(0.9, 5)];
        assert_eq!(verdict(4.0, 4.0, &mut findings), Verdict::Unexplained);
        let mut findings = [found(0.5, 5)];
        assert_eq!(verdict(7.0, 7.0, &mut findings), Verdict::Unexplained);
        assert!(findings[0].probability < 0.6 && !findings[0].evidence.established);
    }

    #[test]
    fn an_error_on_the_training_logs_that_may_still_be_noise_leaves_a_doubt() {
        let asked = |train: f64, roughly: bool| {
            let last = LadderStep { step: "+".to_owned(), train, held_out: Some(1.06), u: Vec::new() };
            let mut findings = [found(0.99, 5)];
            let bound = NoiseBound { noise: 1.15, roughly };
            assert_eq!(weigh(&last, 10.0 * 10.0, bound, &mut findings), Verdict::EffectMissing);
            findings[0].probability
        };
        assert_eq!(asked(1.12, false).to_bits(), AT_MOST.to_bits());
        // Below that it is noise, and where small errors grow nobody knows how much noise there is.
        assert_eq!([asked(1.05, false), asked(1.12, true)].map(f64::to_bits), [1.0_f64.to_bits(); 2]);
    }

    #[test]
    fn what_may_be_none_by_its_interval_is_not_certain() {
        let size = |ci95| Estimate {
            name: "amplitude".to_owned(),
            unit: "N·m".to_owned(),
            value: 0.06,
            ci95,
            at_bound: false,
            by_bounds: false,
            prior_sd: None,
        };
        let asked = |sizes: &[(f64, &Estimate)]| {
            let mut one = found(0.5, 5);
            doubt_size(&mut one, sizes);
            (one.probability, one.probability_cap.is_some())
        };
        let (wide, narrow, withheld) = (size(Some([0.0, 0.16])), size(Some([0.05, 0.07])), size(None));
        assert_eq!(asked(&[(0.0, &wide)]), (AT_MOST_UNCERTAIN, true));
        assert_eq!(asked(&[(0.0, &wide), (0.0, &narrow)]), (1.0, false));
        assert_eq!(asked(&[(0.0, &withheld)]), (1.0, false));
        // A value of the model that may be right.
        assert_eq!(asked(&[(0.06, &narrow)]), (AT_MOST_UNCERTAIN, true));
    }

    #[test]
    fn what_links_lack_at_one_place_may_be_one_load_and_laws_of_joints_are_told_apart() {
        let linear = crate::residual_model::Parametrisation::Linear;
        let parameters = vec![crate::fixture::parameter(linear, 0.0, 1.0); 3];
        let model = crate::fixture::SyntheticModel::new(parameters, 1, |_| vec![0.0]);
        let model = (0..3).fold(model, crate::fixture::SyntheticModel::with_candidate);
        let candidates = crate::residual_model::ResidualModel::description(&model).candidates;
        let asked = |apart: &[usize]| {
            let mut findings = [found(0.5, 5), found(0.3, 5), found(0.2, 5)];
            findings.iter_mut().enumerate().for_each(|(k, finding)| finding.candidate = k);
            findings[2].site = "wrist".to_owned();
            doubt_same_place(&candidates, &mut findings, |candidate| apart.contains(&candidate));
            findings.map(|finding| finding.probability_cap.is_some())
        };
        assert_eq!(asked(&[]), [true, true, false]);
        assert_eq!(asked(&[0, 1, 2]), [false; 3]);
        assert_eq!(asked(&[0]), [false; 3], "a law of a joint is no part of what its link lacks");
    }
}
