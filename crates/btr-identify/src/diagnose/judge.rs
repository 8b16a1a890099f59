//! Acceptance of one of the fitted candidates.

use super::own;
use super::refit::{CLOSE, Rival};
use super::report::{MissingEffect, RankedCandidate, RivalPoint, RivalProbability};
use super::state::{DiagnosisState, earns_its_parameters};
use super::thresholds::{DECISIVE, HELD_OUT_FALL, INDISTINCT, LEARNT_FALL, TIE};
use crate::fit::measure::{ComparisonMeasure, held_out_squares, judge};
use crate::fit::residual_vector::chi;
use crate::fit::{FitPoint, LogSet, Objective};

/// Share of the sum of squares that an effect must explain for another one to be looked for beside it although the
/// held-out logs do not confirm it.
const SHOWN: f64 = 0.2;

/// A rival whose gain in B falls short of the first's by less than this share gains nearly as much, ...
const NEARLY: f64 = 0.5;
/// ... and what leaves this many times its sum of squares on the held-out logs leaves far more.
pub(super) const FAR_MORE: f64 = 2.0;

/// How many of the rivals that did nearly as well, besides those that are alike, are kept, to be compared again beside
/// later findings.
const COMPARED: usize = 3;

/// The first of the rivals, which are sorted by B, if the training logs show it clearly.
fn unconfirmed(
    objective: &Objective,
    state: &DiagnosisState,
    measure: &ComparisonMeasure,
    rivals: &[Rival],
) -> Option<(Rival, MissingEffect)> {
    let (first, others) = rivals.split_first()?;
    let behind = |fit: &FitPoint| measure.behind(fit, &first.fit);
    let gained = behind(&state.fit);
    let learnt = |fit: &FitPoint| own::learnt(objective, first.candidate, fit);
    if gained <= DECISIVE || learnt(&first.fit) >= (1.0 - SHOWN) * learnt(&state.fit) {
        return None;
    }
    let belief = |fit: &FitPoint| (-behind(fit) / 2.0).exp();
    let total = 1.0 + belief(&state.fit) + others.iter().map(|r| belief(&r.fit)).sum::<f64>();
    let candidates = objective.candidates();
    let alike = others.iter().filter(|r| behind(&r.fit) <= DECISIVE).map(|r| candidates[r.candidate].name()).collect();
    let found = MissingEffect::of(first.candidate, &candidates[first.candidate], 1.0 / total, gained);
    Some((first.clone(), MissingEffect { alike, ..found }))
}

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
    let held_out = on_held_out(objective, state, &rivals);
    state.rounds.push(ranked(objective, (&measure, before), &rivals, &held_out));
    // The best that the held-out logs confirm: one that fits by accident is passed over.
    let passes = |(r, whole): &(&Rival, &Option<f64>)| {
        let learnt = |fit: &FitPoint| own::learnt(objective, r.candidate, fit);
        let confirmed = |now: f64| {
            let apart = own::is_apart(objective, r.candidate);
            let then = if apart { own::held_out(objective, r.candidate, &r.fit.u) } else { **whole };
            then.is_some_and(|then| then < (1.0 - HELD_OUT_FALL) * now)
        };
        before - measure.criterion(&r.fit) > DECISIVE
            && 1.0 - learnt(&r.fit) / learnt(&state.fit) > LEARNT_FALL
            && state.own_held_out(objective, r.candidate).is_none_or(confirmed)
    };
    let passing: Vec<(&Rival, &Option<f64>)> = rivals.iter().zip(&held_out).filter(passes).collect();
    let first = rivals.first()?;
    let best = passing.first().map_or(f64::INFINITY, |(r, _)| measure.criterion(&r.fit));
    if best - measure.criterion(&first.fit) > DECISIVE {
        state.unconfirmed = unconfirmed(objective, state, &measure, &rivals);
        return None;
    }
    let (passing, contradicted) = contradicted_by_held_out(objective, &measure, (before, best), passing);
    let best = passing.first().map_or(f64::INFINITY, |r| measure.criterion(&r.fit));
    let leader = passing.first()?;
    let inside = &candidates[leader.candidate].nested;
    let will_do =
        |r: &Rival| inside.contains(&r.candidate) && !earns_its_parameters(objective, r.candidate, &leader.fit, &r.fit);
    let tied = |r: &&Rival| measure.criterion(&r.fit) - best <= TIE || will_do(r);
    let winner = passing.iter().copied().filter(tied).min_by_key(|r| (r.fit.active.len(), r.candidate))?.clone();
    // A law that the leader contains and that will do stands for the leader as well.
    let stands_for = will_do(&winner).then(|| (*leader).clone());
    rivals.retain(|r| !contradicted.contains(&r.candidate));
    let found = named(objective, state, &measure, &rivals, &winner, (best, stands_for.as_ref()));
    Some((winner, found))
}

/// The squares that rivals leave on the held-out logs, if these are judged; `None` where one cannot be simulated.
pub(super) fn on_held_out(objective: &Objective, state: &DiagnosisState, rivals: &[Rival]) -> Vec<Option<f64>> {
    if state.held_out.is_none() {
        return vec![None; rivals.len()];
    }
    judge(objective, &rivals.iter().map(|rival| rival.fit.u.as_slice()).collect::<Vec<_>>());
    rivals.iter().map(|rival| held_out_squares(objective, &rival.fit.u)).collect()
}

/// What is told of the rivals of a round; `before` is B without any of them.
pub(super) fn ranked(
    objective: &Objective,
    (measure, before): (&ComparisonMeasure, f64),
    rivals: &[Rival],
    held_out: &[Option<f64>],
) -> Vec<RankedCandidate> {
    let of = |(rival, squares): (&Rival, &Option<f64>)| RankedCandidate {
        name: objective.candidates()[rival.candidate].name(),
        train: chi(rival.fit.squares(), objective.samples(LogSet::Learn)),
        held_out: squares.map(|squares| chi(squares, objective.samples(LogSet::HeldOut))),
        delta_bic: before - measure.criterion(&rival.fit),
    };
    rivals.iter().zip(held_out).map(of).collect()
}

/// The rivals, which pass and are sorted by B, without those that the held-out logs contradict, and these.
///
/// Contradicted is what the training logs hardly tell from the first, but the held-out logs from one that leaves only
/// noise there. Where all leave more, the simplest is the best first step, and which of them the held-out logs prefer
/// says little, unless one that gains nearly as much leaves far less: what gained more fits the training logs' other
/// cause.
fn contradicted_by_held_out<'a>(
    objective: &Objective,
    measure: &ComparisonMeasure,
    (before, best): (f64, f64),
    passing: Vec<(&'a Rival, &Option<f64>)>,
) -> (Vec<&'a Rival>, Vec<usize>) {
    let behind = |r: &Rival| measure.criterion(&r.fit) - best;
    let lowest = |within: f64| {
        let squares = passing.iter().filter(|(r, _)| behind(r) <= within).filter_map(|(_, squares)| **squares);
        squares.fold(f64::INFINITY, f64::min)
    };
    let (nearly, close) = (lowest(NEARLY * (before - best)), lowest(DECISIVE));
    let is_noise = chi(close, objective.samples(LogSet::HeldOut)) <= objective.noise_bound();
    let contradicted = |r: &Rival, squares: &Option<f64>| {
        let squares = squares.unwrap_or(0.0);
        let by_noise = is_noise
            && behind(r) <= DECISIVE
            && measure.scaled(squares - close) > DECISIVE
            && squares > (1.0 + HELD_OUT_FALL) * close;
        by_noise || (!is_noise && squares > FAR_MORE * nearly)
    };
    let (out, left): (Vec<_>, Vec<_>) = passing.into_iter().partition(|(r, squares)| contradicted(r, squares));
    (left.into_iter().map(|(r, _)| r).collect(), out.iter().map(|(r, _)| r.candidate).collect())
}

/// The winner as a finding: its share of the belief in all rivals, and those that cannot be told from it; `best` is the
/// lowest B that passes, and `stands_for` a rival whose share is the winner's as well.
fn named(
    objective: &Objective,
    state: &mut DiagnosisState,
    measure: &ComparisonMeasure,
    rivals: &[Rival],
    winner: &Rival,
    (best, stands_for): (f64, Option<&Rival>),
) -> MissingEffect {
    let candidates = objective.candidates();
    let before = measure.criterion(&state.fit);
    let left = |r: &Rival| own::learnt(objective, winner.candidate, &r.fit);
    let as_good = |r: &Rival| {
        let together = own::are_together(objective, r.candidate, winner.candidate);
        together && r.fit.active.len() <= winner.fit.active.len() && left(r) <= (1.0 + INDISTINCT) * left(winner)
    };
    let belief = |b: f64| (-(b - best) / 2.0).exp();
    let of_rival = |r: &Rival| {
        let b = measure.criterion(&r.fit);
        belief(if as_good(r) { b.min(best + TIE) } else { b })
    };
    let total: f64 = rivals.iter().map(of_rival).sum::<f64>() + belief(before);
    let winning = stands_for.map_or(0.0, |r| belief(measure.criterion(&r.fit))) + of_rival(winner);
    let is_alike = |r: &Rival| as_good(r) || measure.criterion(&r.fit) - best <= DECISIVE;
    let alike: Vec<&Rival> = rivals.iter().filter(|r| r.candidate != winner.candidate && is_alike(r)).collect();
    if !alike.is_empty() {
        let point = |r: &&Rival| RivalPoint { candidate: r.candidate, u: r.fit.u.clone() };
        state.rivals = [&winner].into_iter().chain(&alike).map(point).collect();
    }
    let gained = before - measure.criterion(&winner.fit);
    let has_share =
        |r: &&Rival| r.candidate != winner.candidate && stands_for.is_none_or(|s| s.candidate != r.candidate);
    let is_close = |r: &&Rival| {
        let together = own::are_together(objective, r.candidate, winner.candidate);
        has_share(r) && together && !is_alike(r) && left(r) <= CLOSE * left(winner)
    };
    let close = rivals.iter().filter(is_close).take(COMPARED);
    let close = alike.iter().copied().chain(close).map(|r| r.candidate).collect();
    let others = rivals.iter().filter(has_share);
    let others = others.map(|r| (Some(candidates[r.candidate].name()), of_rival(r) / total));
    MissingEffect {
        rivals: RivalProbability::likeliest(others.chain([(None, belief(before) / total)])),
        alike: alike.iter().map(|r| candidates[r.candidate].name()).collect(),
        close,
        ..MissingEffect::of(winner.candidate, &candidates[winner.candidate], winning / total, gained)
    }
}
