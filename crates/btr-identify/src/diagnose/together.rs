//! Two effects that only show together: where the training logs show one best and the held-out logs another, neither is
//! accepted alone. The one that the training logs show is taken for granted, and a round looks for the other.

use super::evidence::LogErrors;
use super::report::{DiagnoseOptions, Evidence, SEARCH, SecondLooks};
use super::round::round;
use super::screen;
use super::state::DiagnosisState;
use super::thresholds::HELD_OUT_FALL;
use crate::fit::Objective;
use crate::fit::measure::held_out_squares;

/// The state with two effects that are only confirmed together, if there are such and the rollouts allow to look.
pub(super) fn two(
    objective: &mut Objective,
    state: &mut DiagnosisState,
    question: DiagnoseOptions,
    second_looks: &mut SecondLooks,
) -> Option<DiagnosisState> {
    let next = objective.rollouts().saturating_add(screen::rollouts(objective));
    let (room, allowed) = (state.effects(objective) + 2 <= question.max_effects, question.allows(SEARCH, next));
    second_looks.refused |= room && !allowed && state.unconfirmed.is_some();
    let step = objective.step();
    let both = (room && allowed).then(|| together(objective, state, second_looks)).flatten();
    if both.is_none() && objective.step() != step {
        state.integrator = state.fit.renew_step_error(objective);
    }
    both
}

/// The state with the effect that was not confirmed in the last round and another one, if the held-out logs confirm
/// both: each lowers their error beside the other.
fn together(
    objective: &mut Objective,
    state: &DiagnosisState,
    second_looks: &mut SecondLooks,
) -> Option<DiagnosisState> {
    let (rival, found) = state.unconfirmed.clone()?;
    let first = found.candidate;
    let mut both = state.clone();
    both.accept(objective, rival, found, &|_| {});
    let (rival, found) = round(objective, &mut both, second_looks).into_iter().next()?;
    if objective.is_stopped() {
        return None;
    }
    both.accept(objective, rival, found, &|_| {});
    both.eliminate(objective);
    let falls = |from: Option<f64>, to: f64| from.is_some_and(|from| to < (1.0 - HELD_OUT_FALL) * from);
    let now = both.held_out?;
    let Some(index) = both.chosen.iter().position(|found| found.candidate == first) else {
        return falls(state.held_out, now).then_some(both);
    };
    let without = both.without(objective, index)?;
    let alone = held_out_squares(objective, &without.u);
    let before = LogErrors::of(objective, first, &without, alone);
    let after = LogErrors::of(objective, first, &both.fit, both.held_out);
    both.chosen[index].evidence =
        Evidence::of(&before, &after, both.own_at_first(objective, first).unwrap_or(both.unexplained_at_first));
    (falls(state.held_out, now) && falls(alone, now)).then_some(both)
}
