//! Diagnosis of missing physical effects.
//!
//! Every effect at every site is screened with finite probes while all free parameters may adapt, the leaders are
//! refitted, and the best is accepted only if it also explains held-out logs. Effects are added one by one and removed
//! again where others make them superfluous. The answer may be that nothing is missing, or that nothing known explains
//! the error.

mod beginning;
mod companion;
mod evidence;
mod judge;
mod own;
mod refit;
mod replacement;
mod report;
mod residual_law;
mod round;
mod screen;
mod short_parts;
mod stand_ins;
mod state;
pub mod thresholds;
mod together;

pub use beginning::with_effects;
pub use report::{
    CapReason, DiagnoseOptions, Diagnosis, Evidence, MissingEffect, ProbabilityCap, RankedCandidate, RivalPoint,
    RivalProbability, StandIn, Verdict,
};
pub use residual_law::ResidualLaw;

use crate::LadderStep;
use crate::fit::measure::ComparisonMeasure;
use crate::fit::second_look::{LEFT_OUT, without_glitches};
use crate::fit::{Degree, Estimate, Intervals, Objective, RESTARTS, estimates, remaining};
use beginning::begin;
use btr_core::world::{Cancelled, WorldError};
use companion::{companion, exchange, exchange_for_larger, is_near, weigh_pairs};
use evidence::NoiseBound;
use refit::Rival;
use report::SecondLooks;
use residual_law::residual_law;
use round::round;
use stand_ins::stand_ins;
use state::{DiagnosisState, Explains};
use thresholds::{AT_MOST_AT_BOUNDS, AT_MOST_WITH_LEFT_OVER, LEFT_OVER};
use together::two;

/// How many logs are left out in a fit of its own, those first on which the findings seem to depend most.
const REFITTED: usize = 4;

/// Finds out which effects of the model's candidates are missing; `on_step` is called with every step of the ladder as
/// it is reached.
///
/// # Errors
/// The reason why the model cannot be simulated at its current values, or cancelled work.
pub fn diagnose(
    objective: &mut Objective,
    question: DiagnoseOptions,
    on_step: &dyn Fn(&LadderStep),
) -> Result<Diagnosis, WorldError> {
    let state = begin(objective, on_step)?;
    let diagnosis = match objective.description.has_contact {
        true => go_on(objective, question, state, on_step),
        false => go_on_with_new_starts(objective, question, state, on_step, RESTARTS),
    };
    if objective.model.is_cancelled() { Err(Cancelled.into()) } else { Ok(diagnosis) }
}

/// Continues without the glitches that show beside the fitted model, and with starts from it, for at most
/// `restarts_left` times. Without contact, such starts are accepted if nothing else is left to explain, or if they
/// explain most of it and the held-out logs do not contradict that: a model that lacks something prefers starts that
/// compensate for it.
fn go_on_with_new_starts(
    objective: &mut Objective,
    question: DiagnoseOptions,
    mut state: DiagnosisState,
    on_step: &dyn Fn(&LadderStep),
    restarts_left: usize,
) -> Diagnosis {
    let contact = objective.description.has_contact;
    let is_explained =
        !state.leaves_something(objective, &state.fit) && (contact || !state.fails_on_held_out(objective));
    if let Some(cleaner) = (!is_explained).then(|| without_glitches(objective, &state.fit)).flatten() {
        let mut again = objective.going_on(cleaner.as_ref(), &state.fit.u);
        state.continue_with(&mut again, LEFT_OUT, on_step);
        return go_on_with_new_starts(&mut again, question, state, on_step, restarts_left);
    }
    if restarts_left == 0 || is_explained || objective.is_stopped() {
        return go_on(objective, question, state, on_step);
    }
    let seen = objective.with_starts_at(&state.fit.u);
    if seen.is_none() && contact {
        return go_on(objective, question, state, on_step);
    }
    let mut again = objective.going_on(seen.as_deref().unwrap_or(objective.model), &state.fit.u);
    let explains = if contact { Explains::Everything } else { state.explains_with(&again) };
    let before = state.clone();
    if explains != Explains::Little {
        state.continue_with(&mut again, "starts re-estimated", &|_| ());
    }
    if explains == Explains::Little || explains == Explains::Most && !state.is_no_worse_than(&before) {
        objective.count(&again);
        return go_on(objective, question, before, on_step);
    }
    state.ladder.last().into_iter().for_each(on_step);
    if !contact {
        // From the wrong starts, a simpler effect may have fitted worse.
        let all = 0..state.chosen.len();
        state.simplify(&again, all);
    }
    go_on_with_new_starts(&mut again, question, state, on_step, restarts_left - 1)
}

/// Runs round after round; once an effect is found, with starts from the model that includes it.
fn go_on(
    objective: &mut Objective,
    question: DiagnoseOptions,
    mut state: DiagnosisState,
    on_step: &dyn Fn(&LadderStep),
) -> Diagnosis {
    let mut cut_short = false;
    while state.effects(objective) < question.max_effects && state.leaves_something(objective, &state.fit) {
        let next = objective.rollouts().saturating_add(screen::rollouts(objective));
        cut_short = !question.allows_round(next, state.is_falling()) || objective.is_stopped();
        if cut_short {
            break;
        }
        let (rounds, before) = (state.rounds.len(), state.fit.clone());
        let mut second_looks = SecondLooks::new(question);
        let found = round(objective, &mut state, &mut second_looks);
        if objective.is_stopped() {
            // A round that was not finished has not seen all rivals: nothing is named by it, and the state is that in
            // which a limit of rollouts would have ended the search before it.
            state.rounds.truncate(rounds);
            state.fit = before;
            cut_short = true;
            break;
        }
        state.left_over = None;
        if !found.is_empty() {
            // An accepted effect is finished: stopped halfway, it would be neither fitted nor judged.
            objective.set_stoppable(false);
            for (rival, found) in found {
                if state.effects(objective) < question.max_effects {
                    let rival = state.beside_others(objective, rival);
                    add(objective, &mut state, rival, found, on_step);
                }
            }
        } else if let Some(both) = two(objective, &mut state, question, &mut second_looks) {
            both.ladder[state.ladder.len()..].iter().for_each(on_step);
            state = both;
            objective.set_stoppable(false);
        } else if objective.is_stopped() || !state.replace_by_unconfirmed(objective, on_step) {
            state.left_over = state.rounds.last().and_then(|ranked| ranked.first().cloned());
            cut_short = second_looks.refused || objective.is_stopped();
            break;
        }
        exchange(objective, &mut state, on_step);
        while let Some((rival, found)) = companion(objective, &mut state) {
            add(objective, &mut state, rival, found, on_step);
        }
        exchange_for_larger(objective, &mut state, on_step);
        if is_near(objective, &state) {
            state.reconsider(objective, on_step);
        }
        objective.set_stoppable(true);
        let contact = objective.description.has_contact;
        if state.leaves_something(objective, &state.fit) || (!contact && state.fails_on_held_out(objective)) {
            let restarts_left = if contact { 1 } else { RESTARTS };
            return go_on_with_new_starts(objective, question, state, on_step, restarts_left);
        }
    }
    if objective.description.is_decoupled && !objective.is_stopped() {
        state.drop_needless(objective);
        state.split(objective, |_, _| true, on_step);
    }
    if !cut_short && !objective.description.has_contact {
        state.one_for_two(objective, on_step);
        state.compare_again(objective, on_step);
    }
    if !objective.is_stopped() {
        state.tell_apart(objective);
    }
    if !cut_short && !objective.is_stopped() {
        weigh_pairs(objective, &mut state, question, on_step);
    }
    Diagnosis { cut_short, ..conclude(objective, question, state) }
}

/// Adds an effect to the findings, and drops or replaces earlier ones by simpler ones where it makes them superfluous.
fn add(
    objective: &mut Objective,
    state: &mut DiagnosisState,
    rival: Rival,
    found: MissingEffect,
    on_step: &dyn Fn(&LadderStep),
) {
    state.accept(objective, rival, found, on_step);
    let found = state.chosen.len();
    state.eliminate(objective);
    // The latest effect has just been compared with the simpler ones, unless with an effect that is gone now.
    let left = state.chosen.len();
    if left < found {
        state.simplify(objective, 0..left);
    } else {
        state.simplify(objective, 0..left.saturating_sub(1));
        state.simplify_latest(objective);
    }
    if objective.description.is_decoupled {
        state.split(objective, |state, index| state.may_depend_on_latest(objective, index), on_step);
    }
}

fn conclude(objective: &mut Objective, question: DiagnoseOptions, mut state: DiagnosisState) -> Diagnosis {
    let stopped = objective.is_stopped();
    objective.set_stoppable(false);
    if stopped {
        // The last step may not have been judged any more.
        state.judge_last_step(objective);
    }
    let last = state.ladder.last().map_or(f64::INFINITY, |step| step.held_out.unwrap_or(step.train));
    let learnt = state.ladder.last().map_or(f64::INFINITY, |step| step.train);
    let integrator_error = state.fit.held_out_step_error(objective).max(state.integrator);
    let bound = NoiseBound { noise: objective.noise_bound(), roughly: objective.has_rough_floors() };
    state.leave_one_out(objective, if stopped { 0 } else { REFITTED });
    let verdict = match state.ladder.last() {
        Some(last) => evidence::weigh(last, state.unexplained_at_first.judged, bound, &mut state.chosen),
        None => Verdict::Unexplained,
    };
    let explains = matches!(verdict, Verdict::EffectMissing | Verdict::ValueWrong);
    let left_over = state.left_over.take().filter(|ranked| explains && ranked.delta_bic > LEFT_OVER);
    if left_over.is_some() {
        state.chosen.iter_mut().for_each(|found| found.cap(AT_MOST_WITH_LEFT_OVER, CapReason::LeftOver));
    }
    state.declare_larger_laws(objective, left_over.as_ref());
    let leaves = matches!(verdict, Verdict::Unexplained | Verdict::PartlyExplained);
    let left = if leaves { last.max(learnt) } else { last };
    let intervals = if left <= objective.noise_bound() { Intervals::Given } else { Intervals::Withheld };
    if intervals == Intervals::Given {
        state.settle(objective);
    }
    let inflation = ComparisonMeasure::of(objective, &state.fit).inflation();
    let all = estimates(objective, &state.fit, inflation, intervals);
    state.chosen.iter_mut().for_each(|found| note_estimates(objective, found, &all));
    evidence::doubt_series(objective.candidates(), &mut state.chosen);
    // Where the motion is prescribed, the torque of each joint is a sum of laws that are told apart one by one.
    if !objective.description.is_decoupled {
        evidence::doubt_same_place(objective.candidates(), &mut state.chosen);
    }
    let found = (!state.chosen.is_empty()).then_some(&state.fit);
    let law = (leaves && !stopped && objective.rollouts() < question.max_rollouts)
        .then(|| state.bare_now(objective))
        .flatten()
        .and_then(|bare| residual_law(objective, &bare, found));
    let is_free = |parameter: &usize| objective.description.free.contains(parameter);
    let at_bound: Vec<&Estimate> =
        all.iter().filter(|(parameter, e)| is_free(parameter) && e.at_bound).map(|(_, e)| e).collect();
    // A bound of zero is physics, as of friction; any other one says that what is named does not suffice.
    if at_bound.iter().any(|estimate| estimate.value != 0.0) {
        state.chosen.iter_mut().for_each(|found| found.cap(AT_MOST_AT_BOUNDS, CapReason::ParameterAtBound));
    }
    let at_bound = at_bound.into_iter().map(|estimate| estimate.name.clone()).collect();
    let stand_ins = match leaves || stopped || objective.description.is_decoupled {
        true => Vec::new(),
        false => stand_ins(objective, &state),
    };
    let rollouts = objective.rollouts();
    let channels = remaining(objective, &state.fit.u);
    let degree = match verdict {
        Verdict::Unexplained => Degree::Unexplained,
        Verdict::PartlyExplained => Degree::PartlyExplained,
        Verdict::EffectMissing | Verdict::ValueWrong | Verdict::NothingMissing => Degree::of_noise(&channels),
    };
    Diagnosis {
        verdict,
        degree,
        left: channels,
        left_over,
        unexplained_share: (1.0 - left.powi(-2)).max(0.0),
        integrator_error,
        at_bound,
        rounds: state.rounds,
        effects: state.chosen,
        ladder: state.ladder,
        rivals: state.rivals,
        residual_law: law,
        stand_ins,
        cut_short: false,
        glitches: objective.description.glitches.clone(),
        rollouts,
        fit: state.fit,
    }
}

/// Gives a finding its parameters' estimates, which may tell that its size is uncertain.
fn note_estimates(objective: &Objective, found: &mut MissingEffect, all: &[(usize, Estimate)]) {
    let candidate = &objective.candidates()[found.candidate];
    let of = |(parameter, _): &&(usize, Estimate)| candidate.parameters().any(|own| own == *parameter);
    found.parameters = all.iter().filter(of).map(|(_, estimate)| estimate.clone()).collect();
    let is_size = |(parameter, _): &&(usize, Estimate)| candidate.amplitudes.contains(parameter);
    let none = |parameter: usize| objective.parameters()[parameter].value(0.0);
    let sizes: Vec<(f64, &Estimate)> =
        all.iter().filter(is_size).map(|(parameter, estimate)| (none(*parameter), estimate)).collect();
    evidence::doubt_size(found, &sizes);
}
