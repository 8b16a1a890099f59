//! Weighs findings against a law that they contain together with another one. Coulomb's friction that creeps looks like
//! presliding where the clock is slow, and beside an offset of the command it is the same torque as friction that
//! depends on the direction: whichever comes first explains everything, and the other would never be tried.

use super::pair::{Pair, accept_pair, fitted_together};
use super::with_each;
use crate::LadderStep;
use crate::diagnose::own;
use crate::diagnose::refit::Rival;
use crate::diagnose::report::{DiagnoseOptions, RivalPoint};
use crate::diagnose::state::DiagnosisState;
use crate::diagnose::thresholds::{DECISIVE, HELD_OUT_FALL, LEARNT_FALL, TIE};
use crate::fit::measure::ComparisonMeasure;
use crate::fit::{FitPoint, Objective, SearchBudget};
use crate::residual_model::Needs;

/// Replaces findings by such a pair that the held-out logs bear clearly better, and declares both alike where they bear
/// them equally well.
pub(crate) fn weigh_pairs(
    objective: &mut Objective,
    state: &mut DiagnosisState,
    question: DiagnoseOptions,
    on_step: &dyn Fn(&LadderStep),
) {
    let mut next = 0;
    while next < state.chosen.len() {
        let index = next;
        next += 1;
        let is_allowed = state.effects(objective) < question.max_effects && question.allows(1.0, objective.rollouts());
        let beside = if is_allowed { pair_beside(objective, state, index) } else { None };
        let pairs = [pair_inside(objective, state, index), beside].into_iter().flatten();
        let measure = ComparisonMeasure::of(objective, &state.fit);
        let criterion = |pair: &Pair| measure.criterion(&pair.companion.fit);
        let Some(mut pair) = pairs.min_by(|a, b| criterion(a).total_cmp(&criterion(b))) else { continue };
        pair.companion.fit.jacobian = None;
        pair.companion.fit.solve(objective, SearchBudget::FULL);
        if objective.is_stopped() {
            return;
        }
        objective.set_stoppable(false);
        match Weight::of(objective, state, &pair) {
            Weight::More if is_companion(objective, &pair) => accept_pair(objective, state, pair, on_step),
            Weight::More => {
                accept_both(objective, state, pair, on_step);
                // The next finding has taken its place.
                next = index;
            }
            Weight::Same => declare_alike(objective, state, pair),
            Weight::Less => {}
        }
        objective.set_stoppable(true);
    }
}

/// Whether the second of a pair only changes how the first one acts.
fn is_companion(objective: &Objective, pair: &Pair) -> bool {
    objective.candidates()[pair.companion.candidate].needs != Needs::Nothing
}

/// Puts a pair of two causes of their own in the place of a finding. The law that contains one of them explains the
/// logs as well: it stays alike.
fn accept_both(objective: &Objective, state: &mut DiagnosisState, pair: Pair, on_step: &dyn Fn(&LadderStep)) {
    let whole = objective.candidates()[state.chosen[pair.index].candidate].name();
    let both = [pair.effect, pair.companion.candidate];
    state.accept_parts(objective, pair.index, both, pair.companion.fit, on_step);
    let part = state.chosen.iter_mut().find(|found| found.candidate == pair.effect);
    part.into_iter().for_each(|found| found.alike.push(whole.clone()));
}

/// The best pair of a law that a finding contains and a companion that does not act on the finding itself.
fn pair_inside(objective: &Objective, state: &DiagnosisState, index: usize) -> Option<Pair> {
    let candidates = objective.candidates();
    let found = state.chosen[index].candidate;
    let acts_on = |c: usize, law: usize| matches!(&candidates[c].needs, Needs::OneOf(all) if all.contains(&law));
    let is_offered = |candidate: &usize| !state.is_chosen(*candidate);
    let laws = candidates[found].nested.iter().copied().filter(is_offered);
    let pairs = laws.flat_map(|law| {
        let companions = (0..candidates.len()).filter(is_offered);
        companions.filter(move |&c| acts_on(c, law) && !acts_on(c, found)).map(move |c| (law, c))
    });
    let fitted = pairs.filter_map(|(law, companion)| fitted_together(objective, state, index, law, companion));
    fitted.min_by(|a, b| a.companion.fit.cost.total_cmp(&b.companion.fit.cost))
}

/// The best pair of a law that a finding contains and another effect of the same place with one parameter, if both have
/// fewer parameters than the finding.
fn pair_beside(objective: &Objective, state: &DiagnosisState, index: usize) -> Option<Pair> {
    // Where the motion is prescribed, commands move nothing.
    if objective.description.is_decoupled {
        return None;
    }
    let candidates = objective.candidates();
    let found = &candidates[state.chosen[index].candidate];
    let size = |candidate: usize| candidates[candidate].parameters().count();
    let is_beside = |c: &usize| {
        let is_similar = found.similar.contains(c) || found.nested.contains(c);
        candidates[*c].needs == Needs::Nothing && candidates[*c].site == found.site && size(*c) == 1 && !is_similar
    };
    let companions: Vec<usize> = (0..candidates.len()).filter(|c| !state.is_chosen(*c)).filter(is_beside).collect();
    if companions.is_empty() {
        return None;
    }
    let smaller = |law: usize| size(law) + 1 < found.parameters().count();
    let beside = |law: Rival| {
        let companion = with_each(objective, &law.fit, &companions).into_iter().next()?;
        Some(Pair { index, effect: law.candidate, companion })
    };
    let pairs = state.nested_in_place(objective, index, smaller).into_iter().filter_map(beside);
    pairs.min_by(|a, b| a.companion.fit.cost.total_cmp(&b.companion.fit.cost))
}

/// How much speaks for a pair, compared with the finding.
enum Weight {
    More,
    Same,
    Less,
}

impl Weight {
    fn of(objective: &Objective, state: &DiagnosisState, pair: &Pair) -> Weight {
        let (now, then, candidate) = (&state.fit, &pair.companion.fit, pair.companion.candidate);
        let learnt = |fit: &FitPoint| own::learnt(objective, candidate, fit);
        let judged = state.own_held_out(objective, candidate).zip(own::held_out(objective, candidate, &then.u));
        let falls = |from: f64, to: f64| to < (1.0 - HELD_OUT_FALL) * from;
        let measure = ComparisonMeasure::of(objective, now);
        let costs = measure.behind(then, now);
        if costs <= DECISIVE && judged.is_some_and(|(now, then)| falls(now, then)) {
            return Weight::More;
        }
        let is_beaten = (!is_companion(objective, pair) && costs > DECISIVE)
            || learnt(now) < (1.0 - LEARNT_FALL) * learnt(then)
            || judged.is_some_and(|(now, then)| falls(then, now))
            || (state.held_out.is_some() && judged.is_none());
        if is_beaten { Weight::Less } else { Weight::Same }
    }
}

/// Two that the logs cannot tell apart share the probability, as rivals that tie do.
fn declare_alike(objective: &Objective, state: &mut DiagnosisState, pair: Pair) {
    let (candidates, measure) = (objective.candidates(), ComparisonMeasure::of(objective, &state.fit));
    let Pair { index, effect, companion } = pair;
    let costs = measure.behind(&companion.fit, &state.fit).clamp(-TIE, TIE);
    let found = &mut state.chosen[index];
    let name = format!("{} + {}", candidates[effect].name(), candidates[companion.candidate].name());
    found.share_with(vec![(name, (-costs / 2.0).exp())]);
    let now = RivalPoint { candidate: found.candidate, u: state.fit.u.clone() };
    state.rivals = vec![now, RivalPoint { candidate: effect, u: companion.fit.u }];
}
