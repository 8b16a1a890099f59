//! Companions: effects that only change how another one acts, as the creep of dry friction does. They are tried as soon
//! as that one is found, before all others. Further instances of an effect, such as ripples of other orders, are tried
//! as soon as well: where there is one there are often several, and a round of all candidates for each of them would
//! take most of the rollouts.

mod pair;
mod weigh;

use super::judge::judge_rivals;
use super::own;
use super::refit::{Rival, race};
use super::report::MissingEffect;
use super::screen::screen;
use super::state::DiagnosisState;
use crate::fit::residual_vector::chi;
use crate::fit::{FitPoint, LogSet, Objective};
use crate::residual_model::Needs;
pub(super) use pair::{exchange, exchange_for_larger};
pub(super) use weigh::weigh_pairs;

/// A companion that leaves more than noise and this share of the sum of squares has to compete with all candidates.
const MODEST: f64 = 0.5;
/// The same for a further instance: each of several takes its part.
const INSTANCE: f64 = 0.7;

/// Largest error in noise floors at which companions and what was alike are tried: what leaves more needs another
/// effect first, and the rollouts for that.
const NEAR: f64 = 20.0;

/// Whether the findings leave something, but not too much for companions.
pub(super) fn is_near(objective: &Objective, state: &DiagnosisState) -> bool {
    state.leaves_something(objective, &state.fit) && chi(state.fit.squares(), objective.samples(LogSet::Learn)) <= NEAR
}

/// The best companion of what is found, or a further instance of it, if it explains enough of what is left.
pub(super) fn companion(objective: &Objective, state: &mut DiagnosisState) -> Option<(Rival, MissingEffect)> {
    if !state.leaves_something(objective, &state.fit) {
        return None;
    }
    let near = is_near(objective, state);
    let may_leave = |candidate: usize| match objective.candidates()[candidate].needs {
        Needs::OneOf(_) if near => Some(MODEST),
        Needs::Instance(_) => Some(INSTANCE),
        Needs::OneOf(_) | Needs::Nothing => None,
    };
    let companions: Vec<usize> = state.offered(objective).into_iter().filter(|&c| may_leave(c).is_some()).collect();
    let mut rivals = with_each(objective, &state.fit, &companions);
    rivals.retain(|rival| {
        let share = may_leave(rival.candidate).unwrap_or(0.0);
        let left = |fit: &FitPoint| own::learnt(objective, rival.candidate, fit);
        left(&rival.fit) < share * left(&state.fit) || !state.leaves_something(objective, &rival.fit)
    });
    if rivals.is_empty() { None } else { judge_rivals(objective, state, rivals) }
}

/// The fits with each of some candidates.
fn with_each(objective: &Objective, base: &FitPoint, candidates: &[usize]) -> Vec<Rival> {
    if candidates.is_empty() {
        return Vec::new();
    }
    let mut bases = vec![base.clone()];
    let starts = screen(objective, &mut bases, candidates);
    race(objective, &bases, &starts, None)
}
