//! What is tried where a search ends and leaves more than noise: it may have settled in a local minimum, or its first
//! finding may have been the wrong one of several that came close. Of two effects that act at once, a third one may
//! explain more than either of them does alone, and neither shows beside it.

use super::judge::{judge_rivals, on_held_out, ranked};
use super::refit::{Rival, race};
use super::report::{DiagnoseOptions, MissingEffect, SEARCH};
use super::screen::{self, screen};
use super::state::DiagnosisState;
use super::thresholds::LEARNT_FALL;
use crate::LadderStep;
use crate::fit::measure::{ComparisonMeasure, held_out_squares};
use crate::fit::residual_vector::chi;
use crate::fit::{FitPoint, LogSet, Objective, SearchBudget};
use crate::residual_model::Needs;

/// Multiples of their typical size at which all findings begin once more, ...
const SIZES: [f64; 2] = [0.4, 1.5];
/// ... and the budget for each of these starts; only the best one continues.
const TRIAL: SearchBudget = SearchBudget { jacobians: 1, steps: 6 };

/// How many candidates are tried in the place of the first finding.
const INSTEAD: usize = 3;
/// Largest share of the squares above the noise that another first finding may leave, with what shows beside it.
const LEAVES: f64 = 0.25;

/// Another state from which the search goes on, if it leaves less than this one, which leaves more than noise. Each way
/// to one is tried once.
pub(super) fn another_way(
    objective: &mut Objective,
    state: &mut DiagnosisState,
    question: DiagnoseOptions,
    on_step: &dyn Fn(&LadderStep),
) -> Option<DiagnosisState> {
    let description = &objective.description;
    // With contact every look is dear, and joints of a prescribed motion are questions of their own.
    let is_left_alone = description.has_contact || description.is_chaotic || description.is_decoupled;
    let allowed =
        |share, rollouts| question.while_falling().allows(share, objective.rollouts().saturating_add(rollouts));
    if is_left_alone || state.chosen.is_empty() || objective.is_stopped() || !leaves_error(objective, state) {
        return None;
    }
    if allowed(1.0, 0)
        && !std::mem::replace(&mut state.tried.afresh, true)
        && let Some(other) = afresh(objective, state)
    {
        other.ladder.last().into_iter().for_each(on_step);
        return Some(other);
    }
    let has_room = question.max_effects > 1 && allowed(SEARCH, INSTEAD * screen::rollouts(objective));
    if !has_room || std::mem::replace(&mut state.tried.another_first, true) {
        return None;
    }
    let step = objective.step();
    let other = another_first(objective, state);
    match &other {
        Some(other) => other.ladder[state.ladder.len()..].iter().for_each(on_step),
        None if objective.step() != step => state.integrator = state.fit.renew_step_error(objective),
        None => (),
    }
    other
}

/// Whether the fit leaves more than noise on the training or on the held-out logs.
fn leaves_error(objective: &Objective, state: &DiagnosisState) -> bool {
    let learnt = chi(state.fit.squares(), objective.samples(LogSet::Learn));
    learnt > objective.noise_bound() || state.fails_on_held_out(objective)
}

/// The findings fitted once more from typical sizes, with the free parameters at the model's values, if that leaves
/// less: what was found first may have drawn all that followed into a local minimum.
fn afresh(objective: &Objective, state: &DiagnosisState) -> Option<DiagnosisState> {
    let from = |size: f64| {
        let mut u = vec![0.0; state.fit.u.len()];
        for candidate in state.chosen.iter().map(|found| &objective.candidates()[found.candidate]) {
            candidate.amplitudes.iter().for_each(|&k| u[k] = objective.parameters()[k].clamp(size));
            candidate.shapes.iter().zip(&candidate.starts[0]).for_each(|(&k, &shape)| u[k] = shape);
        }
        let mut fit = FitPoint::at(objective, state.fit.active.clone(), u, &state.fit.step_error).ok()?;
        fit.solve(objective, TRIAL);
        Some(fit)
    };
    let mut fit = SIZES.into_iter().filter_map(from).min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    fit.solve(objective, SearchBudget::FULL);
    let held_out = state.held_out.and_then(|_| held_out_squares(objective, &fit.u));
    let falls = |from: f64, to: f64| to < (1.0 - LEARNT_FALL) * from;
    let confirmed = state.held_out.is_none_or(|now| held_out.is_some_and(|then| then < now));
    if objective.is_stopped() || !falls(state.fit.squares(), fit.squares()) || !confirmed {
        return None;
    }
    let mut other = DiagnosisState { fit, ..state.clone() };
    other.record(objective, "fitted once more from the model as it stands".to_owned(), &|_| ());
    other.eliminate(objective);
    Some(other)
}

/// Another candidate in the place of the first finding, with what shows beside it, if the two explain most of what all
/// findings leave. Tried are those that came close to it in its round, all in one screening.
fn another_first(objective: &mut Objective, state: &DiagnosisState) -> Option<DiagnosisState> {
    let (first, bare) = (state.chosen.first()?, state.bare_now(objective)?);
    let candidates = objective.candidates();
    let stands_alone = |c: &usize| candidates[*c].needs == Needs::Nothing && *c != first.candidate;
    let close: Vec<usize> = first.close.iter().copied().filter(stands_alone).take(INSTEAD).collect();
    let instead = with_each(objective, std::slice::from_ref(&bare), &close);
    let offered: Vec<usize> = (0..candidates.len()).filter(|c| stands_alone(c) && !close.contains(c)).collect();
    let bases: Vec<FitPoint> = instead.iter().map(|rival| rival.fit.clone()).collect();
    let mut rivals = with_each(objective, &bases, &offered);
    let best = rivals.first()?;
    let is_base = |base: &&Rival, rival: &Rival| {
        candidates[base.candidate].parameters().all(|parameter| rival.fit.active.contains(&parameter))
    };
    let base = instead.iter().find(|base| is_base(base, best))?.clone();
    rivals.retain(|rival| is_base(&&base, rival));
    let measure = ComparisonMeasure::of(objective, &base.fit);
    let gained = measure.behind(&bare, &base.fit);
    let probability = 1.0 / (1.0 + (-gained / 2.0).exp());
    let found = MissingEffect {
        close: close.into_iter().chain([first.candidate]).filter(|&c| c != base.candidate).collect(),
        ..MissingEffect::of(base.candidate, &candidates[base.candidate], probability, gained)
    };
    let mut other = state.without_findings(objective, bare);
    let held_out = on_held_out(objective, &other, &instead);
    other.rounds.push(ranked(objective, (&measure, measure.criterion(&other.fit)), &instead, &held_out));
    other.accept(objective, base, found, &|_| ());
    let (rival, found) = judge_rivals(objective, &mut other, rivals)?;
    other.accept(objective, rival, found, &|_| ());
    other.eliminate(objective);
    let is_better = !objective.is_stopped() && other.chosen.len() > 1 && explains_most(objective, state, &other);
    is_better.then_some(other)
}

/// The fits of candidates, each beside the base from which it explains most.
fn with_each(objective: &Objective, bases: &[FitPoint], candidates: &[usize]) -> Vec<Rival> {
    if candidates.is_empty() || bases.is_empty() {
        return Vec::new();
    }
    let mut bases = bases.to_vec();
    let starts = screen(objective, &mut bases, candidates);
    race(objective, &bases, &starts, None)
}

/// Whether another state leaves so little of the squares above the noise, on training and on held-out logs.
fn explains_most(objective: &Objective, state: &DiagnosisState, other: &DiagnosisState) -> bool {
    let above_noise = |squares: f64, logs| (squares / objective.samples(logs).max(1) as f64 - 1.0).max(0.0);
    let falls = |from: f64, to: f64, logs| {
        let is_noise = chi(to, objective.samples(logs).max(1)) <= objective.noise_bound();
        is_noise || above_noise(to, logs) <= LEAVES * above_noise(from, logs)
    };
    let on_held_out = |from: f64| other.held_out.is_some_and(|to| falls(from, to, LogSet::HeldOut));
    falls(state.fit.squares(), other.fit.squares(), LogSet::Learn) && state.held_out.is_none_or(on_held_out)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::diagnose::beginning::with_one_found;
    use crate::fixture::{SyntheticModel, parameter};
    use crate::residual_model::Parametrisation;
    use std::f64::consts::PI;

    #[test]
    fn findings_that_ended_in_a_local_minimum_are_fitted_once_more_from_typical_sizes() {
        // Least squares at a size of 1, and a local minimum near 6.
        let residual = |values: &[f64]| {
            let (gain, size) = (values[0] - 0.3, values[1] - 1.0);
            vec![20.0 * (PI * size / 5.0).sin(), 2.0 * size, 20.0 * gain, 20.0 * (gain + 0.1 * size)]
        };
        let linear = || parameter(Parametrisation::Linear, 0.0, 1.0);
        let model = SyntheticModel::new(vec![linear(), linear()], 4, residual).with_candidate(1);
        let mut objective = Objective::new(&model);
        let stuck = with_one_found(&mut objective, 0, &[0.0, 6.0]);
        assert!((stuck.fit.u[1] - 6.0).abs() < 0.5, "{:?}", stuck.fit.u);
        let other = afresh(&objective, &stuck).unwrap();
        assert!((other.fit.u[1] - 1.0).abs() < 0.01 && (other.fit.u[0] - 0.3).abs() < 0.01, "{:?}", other.fit.u);
        assert!(afresh(&objective, &other).is_none());
    }
}
