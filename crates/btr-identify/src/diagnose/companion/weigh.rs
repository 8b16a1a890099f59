//! Weighs findings against a law that they contain together with another one. Coulomb's friction that creeps looks like
//! presliding where the clock is slow, and beside an offset of the command it is the same torque as friction that
//! depends on the direction: whichever comes first explains everything, and the other would never be tried.

use super::pair::{Pair, accept_pair, fitted_together};
use crate::LadderStep;
use crate::diagnose::own;
use crate::diagnose::refit::{FOLLOWER, Rival};
use crate::diagnose::report::RivalPoint;
use crate::diagnose::screen::{screen, with};
use crate::diagnose::state::DiagnosisState;
use crate::diagnose::thresholds::{DECISIVE, HELD_OUT_FALL, LEARNT_FALL, TIE};
use crate::fit::measure::ComparisonMeasure;
use crate::fit::{FitPoint, Objective, SearchBudget};
use crate::residual_model::Needs;

/// Replaces findings by such a pair that the held-out logs bear clearly better, and declares both alike where they bear
/// them equally well.
pub(crate) fn weigh_pairs(objective: &mut Objective, state: &mut DiagnosisState, on_step: &dyn Fn(&LadderStep)) {
    for index in 0..state.chosen.len() {
        let pairs = [pair_inside(objective, state, index), pair_beside(objective, state, index)].into_iter().flatten();
        let best = pairs.min_by(|a, b| a.companion.fit.cost.total_cmp(&b.companion.fit.cost));
        let Some(mut pair) = best else { continue };
        pair.companion.fit.jacobian = None;
        pair.companion.fit.solve(objective, SearchBudget::FULL);
        if objective.is_stopped() {
            return;
        }
        objective.set_stoppable(false);
        match Weight::of(objective, state, &pair) {
            Weight::More => accept_pair(objective, state, pair, on_step),
            Weight::Same => declare_alike(objective, state, pair),
            Weight::Less => {}
        }
        objective.set_stoppable(true);
    }
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
    let candidates = objective.candidates();
    let found = &candidates[state.chosen[index].candidate];
    let size = |candidate: usize| candidates[candidate].parameters().count();
    if objective.description.is_decoupled {
        // Commands do not move anything there, and a law has been compared with two of its parts.
        return None;
    }
    let is_beside = |c: &usize| {
        let is_similar = found.similar.contains(c) || found.nested.contains(c);
        candidates[*c].needs == Needs::Nothing && candidates[*c].site == found.site && size(*c) == 1 && !is_similar
    };
    let companions: Vec<usize> = (0..candidates.len()).filter(|c| !state.is_chosen(*c)).filter(is_beside).collect();
    let smaller = |law: usize| size(law) + 1 < found.parameters().count();
    let beside = |law: Rival| {
        let mut bases = vec![law.fit];
        let start = screen(objective, &mut bases, &companions).into_iter().next()?;
        let active = with(&bases[0], &candidates[start.candidate]);
        let mut fit = FitPoint::at(objective, active, start.u, &bases[0].step_error).ok()?;
        own::solve(objective, start.candidate, &mut fit, FOLLOWER);
        Some(Pair { index, effect: law.candidate, companion: Rival { candidate: start.candidate, fit } })
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
        let is_beaten = learnt(now) < (1.0 - LEARNT_FALL) * learnt(then)
            || judged.is_some_and(|(now, then)| falls(then, now))
            || (state.held_out.is_some() && judged.is_none());
        match is_beaten {
            true => Weight::Less,
            false if costs < -DECISIVE => Weight::More,
            false => Weight::Same,
        }
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
