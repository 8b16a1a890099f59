//! Companions: effects that only change how another one acts, as the creep of dry friction does. They are tried as soon
//! as that one is found, before all others; and together with it in the place of a similar effect that was found
//! instead, because it comes closer by itself. Further instances of an effect, such as ripples of other orders, are
//! tried as soon as well: where there is one there are often several, and a round of all candidates for each of them
//! would take most of the rollouts.

use super::evidence::LogErrors;
use super::judge::judge_rivals;
use super::refit::{Rival, race};
use super::report::{Evidence, MissingEffect};
use super::screen::screen;
use super::state::DiagnosisState;
use super::thresholds::{DECISIVE, HELD_OUT_FALL, LEARNT_FALL};
use crate::LadderStep;
use crate::fit::measure::{ComparisonMeasure, held_out_squares};
use crate::fit::residual_vector::chi;
use crate::fit::{FitPoint, LogSet, Objective, SearchBudget};
use crate::residual_model::Needs;

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
        rival.fit.squares() < share * state.fit.squares() || !state.leaves_something(objective, &rival.fit)
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

/// Two candidates in the place of one that was found.
struct Pair {
    /// Index among the findings.
    index: usize,
    effect: usize,
    companion: Rival,
}

/// Replaces findings by a similar effect with its companion where the two together explain decisively more.
pub(super) fn exchange(objective: &mut Objective, state: &mut DiagnosisState, on_step: &dyn Fn(&LadderStep)) {
    for index in 0..state.chosen.len() {
        if is_near(objective, state)
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
    let measure = ComparisonMeasure::of(objective, &state.fit);
    let best = pairs.min_by(|a, b| a.companion.fit.cost.total_cmp(&b.companion.fit.cost))?;
    let (now, then) = (&state.fit, &best.companion.fit);
    let confirms =
        |now: f64| held_out_squares(objective, &then.u).is_some_and(|squares| squares < (1.0 - HELD_OUT_FALL) * now);
    let better = measure.criterion(now) - measure.criterion(then) > DECISIVE
        && then.squares() < (1.0 - LEARNT_FALL) * now.squares()
        && state.held_out.is_none_or(confirms);
    better.then_some(best)
}

fn accept_pair(objective: &mut Objective, state: &mut DiagnosisState, pair: Pair, on_step: &dyn Fn(&LadderStep)) {
    let Pair { index, effect, companion } = pair;
    let before = LogErrors::of(objective, &state.fit, state.held_out);
    let measure = ComparisonMeasure::of(objective, &state.fit);
    let gained = measure.criterion(&state.fit) - measure.criterion(&companion.fit);
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
    let probability = 1.0 / (1.0 + (-gained / 2.0).exp());
    let added = MissingEffect::of(companion.candidate, added, probability, gained);
    state.record(objective, step, on_step);
    let after = LogErrors::of(objective, &state.fit, state.held_out);
    let evidence = Evidence::of(&before, &after, state.unexplained_at_first);
    state.chosen.push(MissingEffect { evidence, ..added });
}
