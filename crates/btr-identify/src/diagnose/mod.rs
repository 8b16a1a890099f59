//! Diagnosis of missing physical effects.
//!
//! Every effect at every site is screened with finite probes while all free parameters may adapt, the leaders are
//! refitted, and the best is accepted only if it also explains held-out logs. Effects are added one by one and removed
//! again where others make them superfluous. The answer may be that nothing is missing, or that nothing known explains
//! the error.

mod beginning;
mod companion;
mod conclusion;
mod dead_end;
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
use crate::fit::second_look::{LEFT_OUT, NEW_FLOORS, with_torque_floors, without_glitches};
use crate::fit::{Objective, RESTARTS};
use crate::residual_model::ResidualModel;
use beginning::{GrantedTest, begin, take_for_granted};
use btr_core::world::{Cancelled, WorldError};
use companion::{companion, exchange, exchange_for_larger, is_near, weigh_pairs};
use conclusion::conclude;
use dead_end::another_way;
use refit::Rival;
use report::SecondLooks;
use round::round;
use state::{DiagnosisState, Explains};
use together::two;

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
    let diagnosis = match with_floors_of_usual_laws(objective, question) {
        Some(model) => {
            let origin = vec![0.0; objective.parameters().len()];
            search(&mut objective.going_on(model.as_ref(), &origin), question, on_step)?
        }
        None => search(objective, question, on_step)?,
    };
    if objective.model.is_cancelled() { Err(Cancelled.into()) } else { Ok(diagnosis) }
}

/// The model with the noise floors of torques beside the usual laws; `None` where they stay about the same. Rotors have
/// more of the motion's noise, and where noise decides the sign of dry friction, other friction would be found.
fn with_floors_of_usual_laws(objective: &mut Objective, question: DiagnoseOptions) -> Option<Box<dyn ResidualModel>> {
    if !objective.description.is_decoupled {
        return None;
    }
    let state = begin(objective, &|_| ()).ok()?;
    let usual = take_for_granted(objective, question, &state);
    let model = usual.and_then(|usual| with_torque_floors(objective, &usual.fit));
    objective.set_stoppable(false);
    model
}

/// Searches from the model as it stands.
fn search(
    objective: &mut Objective,
    question: DiagnoseOptions,
    on_step: &dyn Fn(&LadderStep),
) -> Result<Diagnosis, WorldError> {
    let state = begin(objective, on_step)?;
    let state = with_usual_laws(objective, question, state, on_step);
    Ok(match objective.description.has_contact {
        true => go_on(objective, question, state, on_step),
        false => go_on_with_new_starts(objective, question, state, on_step, RESTARTS),
    })
}

/// Begins with the laws that nearly every joint follows, where the motion is prescribed and the training logs show
/// them, and with what shows beside all of them: friction that a model lacks hides what the links lack, and is taken
/// for it. Whether the held-out logs confirm these laws is asked at the end.
fn with_usual_laws(
    objective: &mut Objective,
    question: DiagnoseOptions,
    state: DiagnosisState,
    on_step: &dyn Fn(&LadderStep),
) -> DiagnosisState {
    let Some(mut usual) = take_for_granted(objective, question, &state) else { return state };
    let silent = &|_: &LadderStep| ();
    if usual.leaves_something(objective, &usual.fit)
        && search_once(objective, question, &mut usual, silent) == RoundEnd::Found
    {
        complete(objective, &mut usual, silent);
        objective.set_stoppable(true);
    }
    with_those_that_pass(objective, state, usual, GrantedTest::Shown, on_step)
}

/// Tries the usual laws again at the joints that have not got them: what was found since may have hidden them.
fn with_usual_laws_again(
    objective: &mut Objective,
    question: DiagnoseOptions,
    state: DiagnosisState,
    on_step: &dyn Fn(&LadderStep),
) -> DiagnosisState {
    let Some(usual) = take_for_granted(objective, question, &state) else { return state };
    with_those_that_pass(objective, state, usual, GrantedTest::Finding, on_step)
}

/// The state with those of the laws taken for granted that pass a test; a stopped search has tested none.
fn with_those_that_pass(
    objective: &Objective,
    state: DiagnosisState,
    mut granted: DiagnosisState,
    test: GrantedTest,
    on_step: &dyn Fn(&LadderStep),
) -> DiagnosisState {
    granted.keep_granted(objective, test, state.chosen.len());
    if objective.is_stopped() { state } else { granted.told_after(objective, state, on_step) }
}

/// Continues without the glitches that show beside the fitted model; and with its noise floors, or with starts from it,
/// for at most `restarts_left` times. Without contact, such starts are accepted if nothing else is left to explain, or
/// if they explain most of it and the held-out logs do not contradict that: a model that lacks something prefers starts
/// that compensate for it.
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
    let asks_floors = !is_explained && restarts_left > 0;
    if let Some(other) = asks_floors.then(|| with_torque_floors(objective, &state.fit)).flatten() {
        let mut again = objective.going_on(other.as_ref(), &state.fit.u);
        state.continue_with(&mut again, NEW_FLOORS, on_step);
        state.renew_first_errors(&again);
        return go_on_with_new_starts(&mut again, question, state, on_step, restarts_left - 1);
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
    let contact = objective.description.has_contact;
    let mut end = RoundEnd::Nothing;
    while state.effects(objective) < question.max_effects && state.leaves_something(objective, &state.fit) {
        end = search_once(objective, question, &mut state, on_step);
        if end != RoundEnd::Found {
            break;
        }
        complete(objective, &mut state, on_step);
        objective.set_stoppable(true);
        state = with_usual_laws_again(objective, question, state, on_step);
        if state.leaves_something(objective, &state.fit) || (!contact && state.fails_on_held_out(objective)) {
            let restarts_left = if contact { 1 } else { RESTARTS };
            return go_on_with_new_starts(objective, question, state, on_step, restarts_left);
        }
    }
    let (mut is_refused, spent) = (false, objective.rollouts());
    let other = another_way(objective, &mut state, question, &mut is_refused);
    // What that took is not missing from what follows.
    let question = question.with_more(objective.rollouts() - spent);
    if let Some(mut other) = other {
        other.ladder[state.ladder.len()..].iter().for_each(on_step);
        objective.set_stoppable(false);
        complete(objective, &mut other, on_step);
        objective.set_stoppable(true);
        return go_on_with_new_starts(objective, question, other, on_step, RESTARTS);
    }
    let cut_short = end == RoundEnd::CutShort || is_refused || objective.is_stopped();
    compare_findings(objective, question, &mut state, cut_short, on_step);
    let cut_short = cut_short || objective.is_stopped();
    Diagnosis { cut_short, ..conclude(objective, question, state) }
}

/// How a round ended.
#[derive(Clone, Copy, PartialEq)]
enum RoundEnd {
    Found,
    Nothing,
    CutShort,
}

/// Looks for effects and adds those that are found.
fn search_once(
    objective: &mut Objective,
    question: DiagnoseOptions,
    state: &mut DiagnosisState,
    on_step: &dyn Fn(&LadderStep),
) -> RoundEnd {
    let next = objective.rollouts().saturating_add(screen::rollouts(objective));
    if !question.allows_round(next, state.is_falling()) || objective.is_stopped() {
        return RoundEnd::CutShort;
    }
    let (rounds, before) = (state.rounds.len(), state.fit.clone());
    let mut second_looks = SecondLooks::new(question);
    let found = round(objective, state, &mut second_looks);
    if objective.is_stopped() {
        // A round that was not finished has not seen all rivals: nothing is named by it, and the state is that in
        // which a limit of rollouts would have ended the search before it.
        state.rounds.truncate(rounds);
        state.fit = before;
        return RoundEnd::CutShort;
    }
    state.left_over = None;
    if !found.is_empty() {
        // An accepted effect is finished: stopped halfway, it would be neither fitted nor judged.
        objective.set_stoppable(false);
        for (rival, found) in found {
            if state.effects(objective) < question.max_effects {
                let rival = state.beside_others(objective, rival);
                add(objective, state, rival, found, on_step);
            }
        }
    } else if let Some(both) = two(objective, state, question, &mut second_looks) {
        both.ladder[state.ladder.len()..].iter().for_each(on_step);
        *state = both;
        objective.set_stoppable(false);
    } else if objective.is_stopped() || !state.replace_by_unconfirmed(objective, on_step) {
        state.left_over = state.rounds.last().and_then(|ranked| ranked.first().cloned());
        let cut_short = second_looks.refused || objective.is_stopped();
        return if cut_short { RoundEnd::CutShort } else { RoundEnd::Nothing };
    }
    RoundEnd::Found
}

/// Exchanges findings for laws that explain more, and adds what only shows beside them.
fn complete(objective: &mut Objective, state: &mut DiagnosisState, on_step: &dyn Fn(&LadderStep)) {
    exchange(objective, state, on_step);
    while let Some((rival, found)) = companion(objective, state) {
        add(objective, state, rival, found, on_step);
    }
    exchange_for_larger(objective, state, on_step);
    if is_near(objective, state) {
        state.reconsider(objective, on_step);
    }
}

/// Compares the findings with simpler and similar ones, now that all are known.
fn compare_findings(
    objective: &mut Objective,
    question: DiagnoseOptions,
    state: &mut DiagnosisState,
    cut_short: bool,
    on_step: &dyn Fn(&LadderStep),
) {
    if objective.description.is_decoupled && !objective.is_stopped() {
        state.keep_granted(objective, GrantedTest::Finding, 0);
        state.drop_needless(objective);
        state.split(objective, |_, _| true, on_step);
        state.join(objective, on_step);
    }
    if !cut_short && !objective.description.has_contact {
        state.one_for_two(objective, on_step);
        state.compare_again(objective, on_step);
    }
    state.share_uncompared(objective);
    if !objective.is_stopped() {
        state.tell_apart(objective);
    }
    if !cut_short && !objective.is_stopped() {
        weigh_pairs(objective, state, question, on_step);
    }
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
