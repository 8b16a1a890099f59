//! Effects that only show together: where the training logs show one best and the held-out logs another, neither is
//! accepted alone. The one that the training logs show is taken for granted, and a round looks for the other; where
//! each joint is a question of its own, one more may follow.

use super::evidence::LogErrors;
use super::own;
use super::report::{DiagnoseOptions, Evidence, SEARCH, SecondLooks};
use super::round::{Accepted, round, round_beside};
use super::screen;
use super::state::DiagnosisState;
use super::thresholds::HELD_OUT_FALL;
use crate::fit::Objective;
use crate::fit::measure::held_out_squares;

/// How many effects are looked for beside one that the held-out logs contradict at a joint: friction, dry and viscous,
/// may only be confirmed beside a coupling.
const BESIDE_AT_A_JOINT: usize = 2;

/// The state with two effects that are only confirmed together, if there are such and the rollouts allow to look.
pub(super) fn two(
    objective: &mut Objective,
    state: &mut DiagnosisState,
    question: DiagnoseOptions,
    second_looks: &mut SecondLooks,
) -> Option<DiagnosisState> {
    let room = state.effects(objective) + 2 <= question.max_effects;
    let (step, shown) = (objective.step(), unconfirmed(state));
    let attempt = |shown: Accepted| {
        let next = objective.rollouts().saturating_add(screen::rollouts(objective));
        let allowed = question.allows(SEARCH, next);
        second_looks.refused |= room && !allowed;
        if !room || !allowed || objective.is_stopped() {
            return None;
        }
        // What is tried in vain would be tried in vain again.
        state.forget_unconfirmed(shown.0.candidate);
        together(objective, state, second_looks, shown)
    };
    let both = shown.into_iter().find_map(attempt);
    if both.is_none() && objective.step() != step {
        state.integrator = state.fit.renew_step_error(objective);
    }
    both
}

/// What the training logs show best and the held-out logs do not confirm: in the last round, and at each joint that is
/// a question of its own.
fn unconfirmed(state: &DiagnosisState) -> Vec<Accepted> {
    let at_joints = state.settled.iter().filter_map(|joint| joint.unconfirmed.as_ref());
    let mut all: Vec<Accepted> = Vec::new();
    for shown in state.unconfirmed.iter().chain(at_joints) {
        if all.iter().all(|(other, _)| other.candidate != shown.0.candidate) {
            all.push(shown.clone());
        }
    }
    all
}

/// The state with an effect that was not confirmed and others, if the held-out logs confirm all: each lowers their
/// error beside the others. Where the first shows in a joint's channel alone, so must they.
fn together(
    objective: &mut Objective,
    state: &DiagnosisState,
    second_looks: &mut SecondLooks,
    (rival, found): Accepted,
) -> Option<DiagnosisState> {
    let (first, apart) = (found.candidate, own::is_apart(objective, found.candidate));
    let mut all = state.clone();
    // At a joint, much may have been found since it was fitted.
    let rival = if apart { all.with_rival(objective, &rival)? } else { rival };
    all.accept(objective, rival, found, &|_| {});
    for _ in 0..if apart { BESIDE_AT_A_JOINT } else { 1 } {
        let beside = if apart {
            round_beside(objective, &mut all, second_looks, first)
        } else {
            round(objective, &mut all, second_looks)
        };
        let (rival, found) = beside.into_iter().next()?;
        if objective.is_stopped() {
            return None;
        }
        all.accept(objective, rival, found, &|_| {});
        if let Some(confirmed) = confirmed(objective, state, &all, first) {
            return Some(confirmed);
        }
    }
    None
}

/// What was found together without what it can do without, if the held-out logs confirm it.
fn confirmed(
    objective: &Objective,
    before: &DiagnosisState,
    all: &DiagnosisState,
    first: usize,
) -> Option<DiagnosisState> {
    let falls = |from: Option<f64>, to: f64| from.is_some_and(|from| to < (1.0 - HELD_OUT_FALL) * from);
    let earlier = before.own_held_out(objective, first);
    let mut kept = all.clone();
    kept.eliminate(objective);
    if !kept.is_chosen(first) {
        if falls(earlier, kept.own_held_out(objective, first)?) {
            return Some(kept);
        }
        // The training logs can do without the first; at a joint, the held-out logs may not.
        kept = own::is_apart(objective, first).then(|| all.clone())?;
    }
    let now = kept.own_held_out(objective, first)?;
    let index = kept.chosen.iter().position(|found| found.candidate == first)?;
    let without = kept.without(objective, index)?;
    let alone = held_out_squares(objective, &without.u);
    let errors = LogErrors::of(objective, first, &without, alone);
    let after = LogErrors::of(objective, first, &kept.fit, kept.held_out);
    kept.chosen[index].evidence =
        Evidence::of(&errors, &after, kept.own_at_first(objective, first).unwrap_or(kept.unexplained_at_first));
    let own_alone = if own::is_apart(objective, first) { own::held_out(objective, first, &without.u) } else { alone };
    (falls(earlier, now) && falls(own_alone, now) && kept.is_no_worse_than(before)).then_some(kept)
}
