//! What is tried where a search ends and leaves more than noise: it may have settled in a local minimum, or its first
//! finding may have been the wrong one of several that came close. Of two effects that act at once, a third one may
//! explain more than either of them does alone, and neither shows beside it.

use super::judge::{judge_rivals, on_held_out, ranked};
use super::refit::{Rival, race};
use super::report::{DiagnoseOptions, MissingEffect, SEARCH};
use super::screen::{self, screen};
use super::state::DiagnosisState;
use super::thresholds::{DECISIVE, LEARNT_FALL};
use crate::fit::measure::ComparisonMeasure;
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
/// to one is tried once; `is_refused` is set where the limit of rollouts does not allow it.
pub(super) fn another_way(
    objective: &mut Objective,
    state: &mut DiagnosisState,
    question: DiagnoseOptions,
    is_refused: &mut bool,
) -> Option<DiagnosisState> {
    let description = &objective.description;
    // With contact every look is dear, and joints of a prescribed motion are questions of their own.
    let is_left_alone = description.has_contact || description.is_chaotic || description.is_decoupled;
    if is_left_alone || state.chosen.is_empty() || objective.is_stopped() || !leaves_error(objective, state) {
        return None;
    }
    let allowed = |objective: &Objective, share, rollouts| {
        question.while_falling().allows(share, objective.rollouts().saturating_add(rollouts))
    };
    if !std::mem::replace(&mut state.tried.afresh, true) && allowed(objective, 1.0, 0) {
        let other = attempt(objective, state, afresh);
        if other.is_some() || objective.is_stopped() {
            return other;
        }
    }
    let is_open = question.max_effects > 1 && !state.tried.another_first;
    *is_refused = is_open && !allowed(objective, SEARCH, (INSTEAD + 1) * screen::rollouts(objective));
    if !is_open || *is_refused {
        return None;
    }
    state.tried.another_first = true;
    attempt(objective, state, another_first)
}

/// What a way leads to; without any, the state has the error of the time step that the attempt may have refined.
fn attempt(
    objective: &mut Objective,
    state: &mut DiagnosisState,
    way: fn(&mut Objective, &DiagnosisState) -> Option<DiagnosisState>,
) -> Option<DiagnosisState> {
    let step = objective.step();
    let other = way(objective, state).filter(|_| !objective.is_stopped());
    if other.is_none() && objective.step() != step {
        objective.set_stoppable(false);
        state.integrator = state.fit.renew_step_error(objective);
        objective.set_stoppable(true);
    }
    other
}

/// Whether the fit leaves more than noise on the training or on the held-out logs.
fn leaves_error(objective: &Objective, state: &DiagnosisState) -> bool {
    let learnt = chi(state.fit.squares(), objective.samples(LogSet::Learn));
    learnt > objective.noise_bound() || state.fails_on_held_out(objective)
}

/// The findings fitted once more from typical sizes, with the free parameters at the model's values, if that leaves
/// less: what was found first may have drawn all that followed into a local minimum. Sizes and ripples that no
/// derivative leads to stay.
fn afresh(objective: &mut Objective, state: &DiagnosisState) -> Option<DiagnosisState> {
    let fits = SIZES.into_iter().filter_map(|size| from_size(objective, state, size));
    let mut fit = fits.min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    fit.solve(objective, SearchBudget::FULL);
    let falls = |from: f64, to: f64| to < (1.0 - LEARNT_FALL) * from;
    if !falls(state.fit.squares(), fit.squares()) {
        return None;
    }
    // What was left, told apart or could not be told apart was so beside the old values.
    let (left_over, unconfirmed, rivals) = (None, None, Vec::new());
    let mut other = DiagnosisState { fit, left_over, unconfirmed, rivals, ..state.clone() };
    other.integrator = other.fit.renew_step_error(objective);
    other.fit.solve(objective, SearchBudget::RACE);
    other.record(objective, "fitted once more from the model as it stands".to_owned(), &|_| ());
    let confirmed = state.held_out.is_none_or(|now| other.held_out.is_some_and(|then| then < now));
    if !confirmed || !falls(state.fit.squares(), other.fit.squares()) {
        return None;
    }
    other.eliminate(objective);
    let all = 0..other.chosen.len();
    other.simplify(objective, all);
    Some(other)
}

/// The findings fitted from a multiple of their typical sizes; `None` where that cannot be simulated.
fn from_size(objective: &Objective, state: &DiagnosisState, size: f64) -> Option<FitPoint> {
    let mut u = vec![0.0; state.fit.u.len()];
    for candidate in state.chosen.iter().map(|found| &objective.candidates()[found.candidate]) {
        candidate.amplitudes.iter().for_each(|&k| u[k] = objective.parameters()[k].clamp(size));
        candidate.shapes.iter().zip(&candidate.starts[0]).for_each(|(&k, &shape)| u[k] = shape);
        let kept =
            candidate.parameters().filter(|&k| candidate.ripple.is_some() || objective.parameters()[k].is_searched());
        kept.for_each(|k| u[k] = state.fit.u[k]);
    }
    let mut fit = FitPoint::at(objective, state.fit.active.clone(), u, &state.fit.step_error).ok()?;
    fit.solve(objective, TRIAL);
    Some(fit)
}

/// Another candidate in the place of the first finding, with what shows beside it, if the two explain most of what all
/// findings leave. Tried are up to three that came close to it in its round: one screening beside all of them decides
/// which, and a round beside that one what shows.
fn another_first(objective: &mut Objective, state: &DiagnosisState) -> Option<DiagnosisState> {
    let (first, bare) = (state.chosen.first()?, state.bare_now(objective)?);
    let candidates = objective.candidates();
    let stands_alone = |c: &usize| candidates[*c].needs == Needs::Nothing && *c != first.candidate;
    let close: Vec<usize> = first.close.iter().copied().filter(stands_alone).take(INSTEAD).collect();
    let instead = beside(objective, &mut [bare.clone()], &close);
    let offered: Vec<usize> = (0..candidates.len()).filter(stands_alone).collect();
    let base = instead.get(most_promising(objective, &instead, &offered)?)?.clone();
    let mut other = state.without_findings(objective, bare);
    let found = weighed(objective, &mut other, &base, &instead, first.candidate);
    other.accept(objective, base, found, &|_| ());
    let offered = other.offered(objective);
    let rivals = beside(objective, &mut [other.fit.clone()], &offered);
    let (rival, found) = judge_rivals(objective, &mut other, rivals)?;
    other.accept(objective, rival, found, &|_| ());
    other.eliminate(objective);
    (other.chosen.len() > 1 && explains_most(objective, state, &other)).then_some(other)
}

/// Which of some fitted rivals explains most together with one of the candidates `offered`.
fn most_promising(objective: &Objective, instead: &[Rival], offered: &[usize]) -> Option<usize> {
    let mut bases: Vec<FitPoint> = instead.iter().map(|rival| rival.fit.clone()).collect();
    if bases.is_empty() {
        return None;
    }
    let mut starts = screen(objective, &mut bases, offered);
    starts.retain(|start| instead[start.base].candidate != start.candidate);
    let best = race(objective, &bases, &starts, None).into_iter().next()?;
    let has = |base: &Rival| {
        let mut own = objective.candidates()[base.candidate].parameters();
        base.candidate != best.candidate && own.all(|parameter| best.fit.active.contains(&parameter))
    };
    instead.iter().position(has)
}

/// One of some rivals as the first finding of a state without any, weighed against them, with a round that ranks them.
fn weighed(
    objective: &Objective,
    state: &mut DiagnosisState,
    base: &Rival,
    instead: &[Rival],
    before: usize,
) -> MissingEffect {
    let (candidates, measure) = (objective.candidates(), ComparisonMeasure::of(objective, &base.fit));
    let held_out = on_held_out(objective, state, instead);
    state.rounds.push(ranked(objective, (&measure, measure.criterion(&state.fit)), instead, &held_out));
    let behind = |fit: &FitPoint| measure.behind(fit, &base.fit);
    let others = || instead.iter().filter(|rival| rival.candidate != base.candidate);
    // Of those that are ahead without the other effect, the screening has told: they count as a tie.
    let belief = |fit: &FitPoint| (-behind(fit).max(0.0) / 2.0).exp();
    let alike = others().filter(|rival| behind(&rival.fit).abs() <= DECISIVE);
    let total = 1.0 + belief(&state.fit) + alike.clone().map(|rival| belief(&rival.fit)).sum::<f64>();
    MissingEffect {
        alike: alike.map(|rival| candidates[rival.candidate].name()).collect(),
        close: others().map(|rival| rival.candidate).chain([before]).collect(),
        ..MissingEffect::of(base.candidate, &candidates[base.candidate], 1.0 / total, behind(&state.fit))
    }
}

/// The fits of candidates beside a base.
fn beside(objective: &Objective, base: &mut [FitPoint; 1], candidates: &[usize]) -> Vec<Rival> {
    let starts = screen(objective, base, candidates);
    race(objective, base, &starts, None)
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
        let other = afresh(&mut objective, &stuck).unwrap();
        assert!((other.fit.u[1] - 1.0).abs() < 0.01 && (other.fit.u[0] - 0.3).abs() < 0.01, "{:?}", other.fit.u);
        assert!(afresh(&mut objective, &other).is_none());
    }
}
