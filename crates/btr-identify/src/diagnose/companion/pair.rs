//! Pairs: an effect with a companion in the place of a finding that comes closer by itself than either of them.

use super::{is_near, with_each};
use crate::LadderStep;
use crate::diagnose::evidence::LogErrors;
use crate::diagnose::own;
use crate::diagnose::refit::{FOLLOWER, Rival};
use crate::diagnose::report::{Evidence, MissingEffect, RivalProbability};
use crate::diagnose::screen::{StartPoint, simulate_worst, with};
use crate::diagnose::state::DiagnosisState;
use crate::diagnose::thresholds::{DECISIVE, HELD_OUT_FALL, LEARNT_FALL};
use crate::fit::measure::ComparisonMeasure;
use crate::fit::residual_vector::chi;
use crate::fit::{FitPoint, LogSet, Objective, SearchBudget};
use crate::residual_model::Needs;

/// Sizes of a companion at which it is tried with a larger law, ...
const SIZES: [f64; 3] = [0.5, 4.0, 30.0];
/// ... that law's amplitudes, as shares of what is found, ...
const SHARES: [f64; 2] = [0.8, 2.0];
/// ... and how many of these points are fitted.
const FITTED: usize = 3;

/// Two candidates in the place of one that was found.
pub(super) struct Pair {
    /// Index among the findings.
    pub(super) index: usize,
    pub(super) effect: usize,
    /// With the fit of both.
    pub(super) companion: Rival,
}

/// Replaces findings by a similar effect with its companion where the two together explain decisively more.
pub(crate) fn exchange(objective: &mut Objective, state: &mut DiagnosisState, on_step: &dyn Fn(&LadderStep)) {
    for index in 0..state.chosen.len() {
        if is_near(objective, state)
            && state.may_depend_on_latest(objective, index)
            && let Some(pair) = better_pair(objective, state, index)
        {
            accept_pair(objective, state, pair, on_step);
            // With the companion, a simpler law may do.
            state.simplify(objective, index..index + 1);
        }
    }
}

fn better_pair(objective: &Objective, state: &DiagnosisState, index: usize) -> Option<Pair> {
    let candidates = objective.candidates();
    let found = state.chosen[index].candidate;
    // A pair that is larger than what it replaces by more than the companion is no simpler explanation.
    let no_larger =
        |effect: &&usize| candidates[**effect].parameters().count() <= candidates[found].parameters().count();
    let pairs = candidates[found].similar.iter().filter(no_larger).filter_map(|&effect| {
        let changes = |needs: &Needs, other: usize| matches!(needs, Needs::OneOf(others) if others.contains(&other));
        let companions: Vec<usize> = (0..candidates.len())
            .filter(|&c| changes(&candidates[c].needs, effect) && !changes(&candidates[c].needs, found))
            .collect();
        let base = (!companions.is_empty()).then(|| state.replaced(objective, &[index], &[effect])).flatten()?;
        let companion = with_each(objective, &base.fit, &companions).into_iter().next()?;
        Some(Pair { index, effect, companion })
    });
    let best = pairs.min_by(|a, b| a.companion.fit.cost.total_cmp(&b.companion.fit.cost))?;
    is_better(objective, state, &best.companion).then_some(best)
}

/// Whether a fit explains decisively more than the current one, and the held-out logs confirm it.
fn is_better(objective: &Objective, state: &DiagnosisState, then: &Rival) -> bool {
    let measure = ComparisonMeasure::of(objective, &state.fit);
    let (now, then, candidate) = (&state.fit, &then.fit, then.candidate);
    let learnt = |fit: &FitPoint| own::learnt(objective, candidate, fit);
    let confirms =
        |now: f64| own::held_out(objective, candidate, &then.u).is_some_and(|then| then < (1.0 - HELD_OUT_FALL) * now);
    measure.behind(now, then) > DECISIVE
        && learnt(then) < (1.0 - LEARNT_FALL) * learnt(now)
        && state.own_held_out(objective, candidate).is_none_or(confirms)
}

/// Replaces findings by a larger law with its companion, which may be among the findings, where an error is left.
/// Either alone may explain nothing: Stribeck's friction becomes Coulomb's where nothing creeps, and what creeps is
/// its static part. So they are fitted together, from the friction found so far.
pub(crate) fn exchange_for_larger(
    objective: &mut Objective,
    state: &mut DiagnosisState,
    on_step: &dyn Fn(&LadderStep),
) {
    for index in 0..state.chosen.len() {
        let leaves = chi(state.fit.squares(), objective.samples(LogSet::Learn));
        if leaves > objective.noise_bound()
            && is_near(objective, state)
            && state.may_depend_on_latest(objective, index)
            && let Some(pair) = larger_pair(objective, state, index)
        {
            accept_pair(objective, state, pair, on_step);
            state.simplify(objective, index..index + 1);
        }
    }
}

fn larger_pair(objective: &Objective, state: &DiagnosisState, index: usize) -> Option<Pair> {
    let candidates = objective.candidates();
    let found = &candidates[state.chosen[index].candidate];
    let is_larger = |effect: &&usize| {
        candidates[**effect].parameters().count() > found.parameters().count() && !state.is_chosen(**effect)
    };
    let pairs = found.similar.iter().filter(is_larger).flat_map(|&effect| {
        let changes = move |c: &usize| matches!(&candidates[*c].needs, Needs::OneOf(all) if all.contains(&effect));
        let together = move |companion| fitted_together(objective, state, index, effect, companion);
        (0..candidates.len()).filter(changes).filter_map(together)
    });
    let best = pairs.min_by(|a, b| a.companion.fit.cost.total_cmp(&b.companion.fit.cost))?;
    is_better(objective, state, &best.companion).then_some(best)
}

/// An effect in the place of a finding together with a companion, fitted from where both explain most of several
/// points: each of the effect's amplitudes about as large as the finding's of the same unit, or twice as large.
pub(super) fn fitted_together(
    objective: &Objective,
    state: &DiagnosisState,
    index: usize,
    effect: usize,
    companion: usize,
) -> Option<Pair> {
    let (candidates, parameters) = (objective.candidates(), objective.parameters());
    let (law, added) = (&candidates[effect], &candidates[companion]);
    let mut base = state.less(objective, &[index])?;
    base.active = with(&base, law);
    base.active = with(&base, added);
    let found = &candidates[state.chosen[index].candidate].amplitudes;
    let of_found = |unit: &str| {
        let same = found.iter().filter(|&&k| parameters[k].unit == unit);
        same.map(|&k| parameters[k].value(state.fit.u[k])).sum::<f64>()
    };
    let mut points = vec![base.u.clone()];
    for &amplitude in &law.amplitudes {
        let parameter = &parameters[amplitude];
        let value = of_found(&parameter.unit);
        points = varied(&points, &SHARES, |u, share| {
            u[amplitude] = parameter.clamp(parameter.coordinate(share * value));
        });
    }
    points = varied(&points, &law.starts, |u, shapes| law.shapes.iter().zip(shapes).for_each(|(&k, &u0)| u[k] = u0));
    points =
        varied(&points, &added.starts, |u, shapes| added.shapes.iter().zip(shapes).for_each(|(&k, &u0)| u[k] = u0));
    let mut sized = varied(&points, &SIZES, |u, size| {
        added.amplitudes.iter().for_each(|&k| u[k] = parameters[k].clamp(*size));
    });
    if state.is_chosen(companion) {
        sized.extend(points);
    }
    let start = |u| StartPoint { candidate: effect, base: 0, u, cost: f64::INFINITY };
    let mut starts: Vec<StartPoint> = sized.into_iter().map(start).collect();
    simulate_worst(objective, &base, &mut starts);
    starts.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    // Points that differ in a shape that does nothing yet cost the same: one of them is enough.
    starts.dedup_by_key(|start| start.cost.to_bits());
    let fitted = starts.into_iter().take(FITTED).filter_map(|start| {
        let mut fit = FitPoint::at(objective, base.active.clone(), start.u, &base.step_error).ok()?;
        own::solve(objective, effect, &mut fit, FOLLOWER);
        Some(fit)
    });
    let fit = fitted.min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    Some(Pair { index, effect, companion: Rival { candidate: companion, fit } })
}

/// Each of the points with each of the values.
fn varied<T>(points: &[Vec<f64>], values: &[T], set: impl Fn(&mut Vec<f64>, &T)) -> Vec<Vec<f64>> {
    let with = |mut u: Vec<f64>, value| {
        set(&mut u, value);
        u
    };
    points.iter().flat_map(|u| values.iter().map(move |value| (u.clone(), value))).map(|(u, v)| with(u, v)).collect()
}

pub(super) fn accept_pair(
    objective: &mut Objective,
    state: &mut DiagnosisState,
    pair: Pair,
    on_step: &dyn Fn(&LadderStep),
) {
    let Pair { index, effect, companion } = pair;
    let before = LogErrors::of(objective, companion.candidate, &state.fit, state.held_out);
    let measure = ComparisonMeasure::of(objective, &state.fit);
    let gained = measure.behind(&state.fit, &companion.fit);
    state.fit = companion.fit;
    state.fit.jacobian = None;
    state.fit.solve(objective, SearchBudget::FULL);
    let candidates = objective.candidates();
    let (similar, added) = (&candidates[effect], &candidates[companion.candidate]);
    let found = &mut state.chosen[index];
    let step = format!("{} + {} for {}@{}", similar.name(), added.name(), found.effect, found.site);
    (found.effect, found.site, found.candidate) = (similar.effect.clone(), similar.site.clone(), effect);
    (found.kind, found.delta_bic) = (similar.kind, found.delta_bic + gained);
    found.alike.retain(|alike| *alike != similar.name());
    found.rivals.retain(|other| other.name.as_ref() != Some(&similar.name()));
    if state.is_chosen(companion.candidate) {
        state.record(objective, step, on_step);
        return;
    }
    let probability = 1.0 / (1.0 + (-gained / 2.0).exp());
    let added = MissingEffect {
        rivals: RivalProbability::likeliest([(None, 1.0 - probability)].into_iter()),
        ..MissingEffect::of(companion.candidate, added, probability, gained)
    };
    state.record(objective, step, on_step);
    let after = LogErrors::of(objective, added.candidate, &state.fit, state.held_out);
    let evidence = Evidence::of(
        &before,
        &after,
        state.own_at_first(objective, added.candidate).unwrap_or(state.unexplained_at_first),
    );
    state.chosen.push(MissingEffect { evidence, ..added });
}
