//! Acceptance of one of the fitted candidates.

use super::refit::Rival;
use super::report::{Evidence, MissingEffect, RankedCandidate, RivalPoint};
use super::state::{DiagnosisState, earns_its_parameters};
use super::thresholds::{DECISIVE, HELD_OUT_FALL, LEARNT_FALL, TIE};
use crate::fit::measure::{ComparisonMeasure, held_out_squares};
use crate::fit::residual_vector::chi;
use crate::fit::{LogSet, Objective};

/// The rival with the lowest B that passes all three tests; of several that tie, the simplest, and of equally simple
/// ones the first of the library, so that mechanically equivalent effects always get the same name. `None` where
/// others fit decisively better that do not pass: then the held-out logs contradict the training logs.
pub(super) fn judge_rivals(
    objective: &Objective,
    state: &mut DiagnosisState,
    mut rivals: Vec<Rival>,
) -> Option<(Rival, MissingEffect)> {
    let measure = ComparisonMeasure::of(objective, &rivals.first()?.fit);
    rivals.sort_by(|a, b| measure.criterion(&a.fit).total_cmp(&measure.criterion(&b.fit)));
    let before = measure.criterion(&state.fit);
    let candidates = objective.candidates();
    let on_held_out = |r: &Rival| state.held_out.and_then(|_| held_out_squares(objective, &r.fit.u));
    let held_out: Vec<Option<f64>> = rivals.iter().map(on_held_out).collect();
    let ranked = |(r, squares): (&Rival, &Option<f64>)| RankedCandidate {
        name: candidates[r.candidate].name(),
        train: chi(r.fit.squares(), objective.samples(LogSet::Learn)),
        held_out: squares.map(|squares| chi(squares, objective.samples(LogSet::HeldOut))),
        delta_bic: before - measure.criterion(&r.fit),
    };
    state.rounds.push(rivals.iter().zip(&held_out).map(ranked).collect());
    // The best that the held-out logs confirm: one that fits by accident is passed over.
    let confirmed = |squares: Option<f64>| {
        state.held_out.is_none_or(|base| squares.is_some_and(|squares| squares < (1.0 - HELD_OUT_FALL) * base))
    };
    let passes = |(r, squares): &(&Rival, &Option<f64>)| {
        let learnt = 1.0 - r.fit.squares() / state.fit.squares();
        before - measure.criterion(&r.fit) > DECISIVE && learnt > LEARNT_FALL && confirmed(**squares)
    };
    let passing: Vec<&Rival> = rivals.iter().zip(&held_out).filter(passes).map(|(r, _)| r).collect();
    let best = measure.criterion(&passing.first()?.fit);
    if best - measure.criterion(&rivals.first()?.fit) > DECISIVE {
        return None;
    }
    let leader = passing.first()?;
    let inside = &candidates[leader.candidate].nested;
    let will_do = |r: &Rival| inside.contains(&r.candidate) && !earns_its_parameters(objective, &leader.fit, &r.fit);
    let tied = |r: &&Rival| measure.criterion(&r.fit) - best <= TIE || will_do(r);
    let winner = passing.iter().copied().filter(tied).min_by_key(|r| (r.fit.active.len(), r.candidate))?.clone();
    let belief = |b: f64| (-(b - best) / 2.0).exp();
    let total: f64 = rivals.iter().map(|r| belief(measure.criterion(&r.fit))).sum::<f64>() + belief(before);
    let winning = if will_do(&winner) { belief(best) } else { 0.0 } + belief(measure.criterion(&winner.fit));
    let alike: Vec<&Rival> = rivals
        .iter()
        .filter(|r| r.candidate != winner.candidate && measure.criterion(&r.fit) - best <= DECISIVE)
        .collect();
    if !alike.is_empty() {
        let point = |r: &&Rival| RivalPoint { candidate: r.candidate, u: r.fit.u.clone() };
        state.rivals = [&winner].iter().chain(&alike).map(point).collect();
    }
    let found = MissingEffect {
        kind: candidates[winner.candidate].kind,
        evidence: Evidence::default(),
        effect: candidates[winner.candidate].effect.clone(),
        site: candidates[winner.candidate].site.clone(),
        alike: alike.iter().map(|r| candidates[r.candidate].name()).collect(),
        probability: winning / total,
        delta_bic: before - measure.criterion(&winner.fit),
        parameters: Vec::new(),
        candidate: winner.candidate,
    };
    Some((winner, found))
}
