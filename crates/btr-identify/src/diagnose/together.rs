//! Two effects that only show together: where the training logs show one best and the held-out logs another, neither is
//! accepted alone. The one that the training logs show is taken for granted, and a round looks for the other.

use super::evidence::LogErrors;
use super::own;
use super::report::{DiagnoseOptions, Evidence, SEARCH, SecondLooks};
use super::round::{Accepted, round};
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
    let unconfirmed = unconfirmed(state);
    second_looks.refused |= room && !allowed && !unconfirmed.is_empty();
    let step = objective.step();
    let mut tried = unconfirmed.into_iter().take_while(|_| room && allowed);
    let both = tried.find_map(|shown| together(objective, state, second_looks, shown));
    if both.is_none() && objective.step() != step {
        state.integrator = state.fit.renew_step_error(objective);
    }
    both
}

/// What the training logs show best and the held-out logs do not confirm: in the last round, and at each joint that is
/// a question of its own.
fn unconfirmed(state: &DiagnosisState) -> Vec<Accepted> {
    let at_joints = state.settled.iter().filter_map(|joint| joint.unconfirmed.as_ref());
    state.unconfirmed.iter().chain(at_joints).cloned().collect()
}

/// The state with an effect that was not confirmed and another one, if the held-out logs confirm both: each lowers
/// their error beside the other. Where the first shows in a joint's channel alone, so must the other.
fn together(
    objective: &mut Objective,
    state: &DiagnosisState,
    second_looks: &mut SecondLooks,
    (rival, found): Accepted,
) -> Option<DiagnosisState> {
    let (first, apart) = (found.candidate, own::is_apart(objective, found.candidate));
    let mut both = state.clone();
    let rival = both.beside_others(objective, rival);
    both.accept(objective, rival, found, &|_| {});
    let found = round(objective, &mut both, second_looks).into_iter();
    let mut beside = found.filter(|(_, found)| !apart || own::are_together(objective, found.candidate, first));
    let (rival, found) = beside.next()?;
    if objective.is_stopped() {
        return None;
    }
    both.accept(objective, rival, found, &|_| {});
    both.eliminate(objective);
    let falls = |from: Option<f64>, to: f64| from.is_some_and(|from| to < (1.0 - HELD_OUT_FALL) * from);
    let earlier = state.own_held_out(objective, first);
    let now = both.own_held_out(objective, first)?;
    let Some(index) = both.chosen.iter().position(|found| found.candidate == first) else {
        return falls(earlier, now).then_some(both);
    };
    let without = both.without(objective, index)?;
    let alone = held_out_squares(objective, &without.u);
    let before = LogErrors::of(objective, first, &without, alone);
    let after = LogErrors::of(objective, first, &both.fit, both.held_out);
    both.chosen[index].evidence =
        Evidence::of(&before, &after, both.own_at_first(objective, first).unwrap_or(both.unexplained_at_first));
    let own_alone = if apart { own::held_out(objective, first, &without.u) } else { alone };
    (falls(earlier, now) && falls(own_alone, now)).then_some(both)
}
