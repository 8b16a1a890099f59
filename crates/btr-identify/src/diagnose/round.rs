//! One round of a diagnosis: which of the effects that are not chosen yet explains most of the remaining error, and
//! whether it is accepted.

use super::judge::{FAR_MORE, judge_rivals};
use super::own;
use super::refit::{Rival, last_chance, last_chance_of_the_best, race};
use super::report::{MissingEffect, RankedCandidate, SecondLooks};
use super::screen::{StartPoint, is_searched, screen};
use super::short_parts::from_short_parts;
use super::state::{DiagnosisState, SettledJoint};
use crate::fit::residual_vector::chi;
use crate::fit::{FitPoint, LogSet, Objective};
use crate::residual_model::Derivation;

/// If an effect leaves more than this share of the sum of squares, the base may reach the same without it.
const MODEST: f64 = 0.5;
/// If it leaves more than this share, it has hardly moved the free parameters, and a second screening from where they
/// are now would show the same.
const HARDLY: f64 = 0.7;

/// An error above this many noise floors, even with the leader, is far away: probes around a motion that has run off
/// predict little.
const FAR: f64 = 5.0;

/// A model whose error is above this many noise floors has run off somewhere: short parts of logs, which begin where
/// the robot was, are screened first, and whole logs only if these leave much.
const RUN_OFF: f64 = 50.0;

/// Number of the best rivals whose effects are tried at other sites if none of them explains enough.
const OTHER_SITES: usize = 3;

/// What candidates are screened on.
enum Look {
    AtTheWhole,
    InWindows,
}

/// A rival that is accepted, with what is to be said of it.
pub(super) type Accepted = (Rival, MissingEffect);

/// Screens, races and judges; the winner if it is accepted. Where what acts in a joint shows in its own channel alone,
/// each joint has a winner of its own; one at which nothing was found is not tried again until something changes there.
pub(super) fn round(
    objective: &mut Objective,
    state: &mut DiagnosisState,
    second_looks: &mut SecondLooks,
) -> Vec<Accepted> {
    let mut offered = state.offered(objective);
    offered.retain(|&candidate| !state.is_settled(objective, candidate));
    attempt(objective, state, second_looks, &offered)
}

/// The same with the candidates that show where another one does.
pub(super) fn round_beside(
    objective: &mut Objective,
    state: &mut DiagnosisState,
    second_looks: &mut SecondLooks,
    other: usize,
) -> Vec<Accepted> {
    let mut offered = state.offered(objective);
    offered.retain(|&candidate| own::are_together(objective, candidate, other));
    attempt(objective, state, second_looks, &offered)
}

/// One attempt of a round, with the candidates `offered`.
fn attempt(
    objective: &mut Objective,
    state: &mut DiagnosisState,
    second_looks: &mut SecondLooks,
    offered: &[usize],
) -> Vec<Accepted> {
    state.unconfirmed = None;
    let rivals = rivals(objective, state, second_looks, offered);
    if rivals.is_empty() {
        return Vec::new();
    }
    if objective.description.has_contact {
        return judge_rivals(objective, state, rivals).into_iter().collect();
    }
    let points_before = state.rivals.clone();
    let judged = judge_rivals(objective, state, rivals.clone());
    // Of a prescribed motion no probe predicts too little.
    if objective.description.is_decoupled {
        return with_other_joints(objective, state, judged, (&rivals, offered));
    }
    let is_good = judged.as_ref().is_some_and(|(first, _)| !fails_elsewhere(objective, state, first));
    if is_good || !leaves_much(objective, &rivals) || !second_looks.allow(objective) {
        return judged.into_iter().collect();
    }
    let others = not_fitted(objective, &rivals, offered);
    let late = last_chance_of_the_best(objective, &state.fit, &others, &rivals[0].fit);
    let (ranked, points) = (state.rounds.pop(), std::mem::replace(&mut state.rivals, points_before));
    let again = judge_rivals(objective, state, best_of_each(rivals.into_iter().chain(late).collect()));
    if again.is_none() && judged.is_some() {
        // What the held-out logs contradict does not take the place of what they confirmed.
        state.rounds.pop();
        state.rounds.extend(ranked);
        (state.rivals, state.unconfirmed) = (points, None);
        return judged.into_iter().collect();
    }
    again.into_iter().collect()
}

/// The candidates `offered` that explain most, fitted, best first; the base follows where the best has moved it.
pub(super) fn rivals(
    objective: &mut Objective,
    state: &mut DiagnosisState,
    second_looks: &mut SecondLooks,
    offered: &[usize],
) -> Vec<Rival> {
    let (rivals, starts) = first_rivals(objective, state, second_looks, offered);
    let Some(leader) = rivals.first() else { return rivals };
    let hardly = leader.fit.squares() > HARDLY * state.fit.squares() && !objective.description.has_contact;
    if !explains_most(state, &rivals) {
        drop_effect(objective, leader, state).into_iter().for_each(|drop_effect| state.follow(objective, drop_effect));
    }
    let once_more = leaves_much(objective, &rivals)
        && !hardly
        && !leaves_more_than(RUN_OFF, objective, state, &rivals)
        && second_looks.allow(objective);
    let screened = if once_more { starts.as_slice() } else { &[] };
    let again = to_be_tried_again(objective, leader, &rivals, screened, offered);
    let others = from_the_leader(objective, state, leader, &again);
    let rivals = best_of_each(rivals.into_iter().chain(others).collect());
    if objective.description.has_contact { on_the_ground(objective, state, rivals, offered) } else { rivals }
}

/// The winner and those at other joints, if it shows in its joint's channel alone. An effect of the links shows in all
/// channels: what a joint seemed to lack may have been that, so it is accepted first. Where the held-out logs
/// contradict what fits best, each joint is judged by itself, and then what shows in all channels.
fn with_other_joints(
    objective: &Objective,
    state: &mut DiagnosisState,
    winner: Option<Accepted>,
    (rivals, offered): (&[Rival], &[usize]),
) -> Vec<Accepted> {
    let first = winner.as_ref().map(|(rival, _)| rival.candidate);
    let mut all: Vec<Accepted> = winner.into_iter().collect();
    if first.is_some_and(|first| !own::is_apart(objective, first)) {
        return all;
    }
    let unconfirmed = state.unconfirmed.take();
    for joint in own::joints(objective, offered.iter().copied()) {
        if first.is_some_and(|first| own::shows_in(objective, first, joint)) {
            continue;
        }
        let here = rivals.iter().filter(|rival| own::shows_in(objective, rival.candidate, joint)).cloned();
        match judge_rivals(objective, state, here.collect()) {
            Some(found) => all.push(found),
            None => {
                let unconfirmed = state.unconfirmed.take();
                state.settled.push(SettledJoint { channels: joint.to_vec(), unconfirmed });
            }
        }
    }
    if all.is_empty() {
        let of_links = rivals.iter().filter(|rival| !own::is_apart(objective, rival.candidate)).cloned();
        all.extend(judge_rivals(objective, state, of_links.collect()));
    }
    state.unconfirmed = unconfirmed;
    all
}

/// The best of the candidates `offered`, and the starts that were screened for that.
fn first_rivals(
    objective: &mut Objective,
    state: &DiagnosisState,
    second_looks: &mut SecondLooks,
    offered: &[usize],
) -> (Vec<Rival>, Vec<StartPoint>) {
    let (rivals, mut starts) = from_short_parts(objective, state, &Derivation::Beginnings, offered);
    let mut rivals = best_of_each(rivals);
    let has_run_off = leaves_more_than(RUN_OFF, objective, state, &[]);
    for look in if has_run_off { [Look::InWindows, Look::AtTheWhole] } else { [Look::AtTheWhole, Look::InWindows] } {
        let is_far = leaves_more_than(FAR, objective, state, &rivals);
        let is_open = !explains_most(state, &rivals);
        let is_needed = match look {
            Look::AtTheWhole if has_run_off => is_far && is_open,
            Look::AtTheWhole => rivals.first().is_none_or(|leader| state.leaves_something(objective, &leader.fit)),
            Look::InWindows if is_open => is_far && second_looks.allow(objective),
            Look::InWindows => is_far && second_looks.allow_beside_most(objective),
        };
        if is_needed {
            let (others, screened) = match look {
                Look::AtTheWhole => from_the_whole(objective, state, offered),
                Look::InWindows => from_short_parts(objective, state, &Derivation::InWindows, offered),
            };
            rivals = best_of_each(rivals.into_iter().chain(others).collect());
            starts.extend(screened);
        }
    }
    (rivals, starts)
}

/// Candidates tried with the free parameters where the leader has moved them.
fn from_the_leader(objective: &Objective, state: &DiagnosisState, leader: &Rival, again: &[usize]) -> Vec<Rival> {
    let Some(drop_effect) = drop_effect(objective, leader, state).filter(|_| !again.is_empty()) else {
        return Vec::new();
    };
    let mut bases = vec![drop_effect];
    let starts = screen(objective, &mut bases, again);
    // The cheap steps of a race may leave a simpler candidate far behind: the best of them is fitted in any case.
    let simpler = again.iter().any(|&candidate| is_simpler(objective, leader.candidate, candidate));
    race(objective, &bases, &starts, (!simpler).then_some(&leader.fit))
}

/// Where a robot may tip over, no probe predicts a fall: if the leader leaves much, all candidates are simulated. What
/// the best of them leave may then be because the effect is at another site.
fn on_the_ground(
    objective: &Objective,
    state: &DiagnosisState,
    mut rivals: Vec<Rival>,
    offered: &[usize],
) -> Vec<Rival> {
    let candidates = objective.candidates();
    if let Some(leader) = rivals.first().filter(|_| leaves_much(objective, &rivals)) {
        let base = unbiased(objective, state);
        let late = last_chance_of_the_best(objective, &base, &not_fitted(objective, &rivals, offered), &leader.fit);
        rivals = best_of_each(rivals.into_iter().chain(late).collect());
    }
    let Some(leader) = rivals.first().filter(|_| leaves_much(objective, &rivals)) else { return rivals };
    let same = |candidate: &usize| {
        let named = |rival: &Rival| candidates[rival.candidate].effect == candidates[*candidate].effect;
        rivals.iter().take(OTHER_SITES).any(named)
    };
    let other_sites: Vec<usize> = not_fitted(objective, &rivals, offered).into_iter().filter(same).collect();
    let base = drop_effect(objective, leader, state).unwrap_or_else(|| state.fit.clone());
    let late = last_chance(objective, &base, &other_sites, &leader.fit);
    best_of_each(rivals.into_iter().chain(late).collect())
}

/// The free parameters at their given values, as long as nothing is found: what is missing may have biased their fit.
fn unbiased(objective: &Objective, state: &DiagnosisState) -> FitPoint {
    let origin = || vec![0.0; state.fit.u.len()];
    let given = state
        .chosen
        .is_empty()
        .then(|| FitPoint::at(objective, state.fit.active.clone(), origin(), &state.fit.step_error).ok());
    given.flatten().unwrap_or_else(|| state.fit.clone())
}

/// The candidates that were not fitted and that a typical size may do for.
fn not_fitted(objective: &Objective, rivals: &[Rival], offered: &[usize]) -> Vec<usize> {
    let fitted = |candidate: usize| rivals.iter().any(|rival| rival.candidate == candidate);
    let is_left = |candidate: &usize| !fitted(*candidate) && !is_searched(objective, *candidate);
    offered.iter().copied().filter(is_left).collect()
}

/// Whether there is a leader, and even it leaves more than noise.
fn leaves_much(objective: &Objective, rivals: &[Rival]) -> bool {
    rivals
        .first()
        .is_some_and(|leader| chi(leader.fit.squares(), objective.samples(LogSet::Learn)) > objective.noise_bound())
}

/// Whether the winner of the last ranking leaves far more on the held-out logs than on the training logs: it fits
/// these, and something else may explain both.
fn fails_elsewhere(objective: &Objective, state: &DiagnosisState, winner: &Rival) -> bool {
    let name = objective.candidates()[winner.candidate].name();
    let ranked = state.rounds.last().and_then(|ranked| ranked.iter().find(|one| one.name == name));
    let far_more = |ranked: &RankedCandidate, held_out: f64| held_out.powi(2) > FAR_MORE * ranked.train.powi(2);
    ranked.is_some_and(|ranked| ranked.held_out.is_some_and(|held_out| far_more(ranked, held_out)))
}

/// Whether the leader explains so much of the error that it is a step on the way, whatever it leaves.
fn explains_most(state: &DiagnosisState, rivals: &[Rival]) -> bool {
    rivals.first().is_some_and(|leader| leader.fit.squares() < MODEST * state.fit.squares())
}

/// Whether the leader, or the base where there is none, leaves an error above this many noise floors.
fn leaves_more_than(floors: f64, objective: &Objective, state: &DiagnosisState, rivals: &[Rival]) -> bool {
    let fit = rivals.first().map_or(&state.fit, |leader| &leader.fit);
    chi(fit.squares(), objective.samples(LogSet::Learn)) > floors
}

/// The best of the candidates `offered` on whole logs, and the starts that were screened for that.
fn from_the_whole(objective: &Objective, state: &DiagnosisState, offered: &[usize]) -> (Vec<Rival>, Vec<StartPoint>) {
    let mut bases = vec![state.fit.clone()];
    if state.chosen.is_empty() && !objective.description.free.is_empty() {
        let origin = vec![0.0; state.fit.u.len()];
        // Without this base, candidates are screened from the other one alone.
        bases.extend(FitPoint::at(objective, state.fit.active.clone(), origin, &state.fit.step_error));
    }
    let starts = screen(objective, &mut bases, offered);
    (race(objective, &bases, &starts, None), starts)
}

/// Candidates to try again with the free parameters where the leader has moved them: similar ones that were not fitted,
/// so that no effect is called certain that a similar one explains as well, unless so much is left that none is;
/// similar ones with fewer parameters, whose search may only have failed to reach that point; and all that were
/// `screened`.
fn to_be_tried_again(
    objective: &Objective,
    leader: &Rival,
    rivals: &[Rival],
    screened: &[StartPoint],
    offered: &[usize],
) -> Vec<usize> {
    let near = chi(leader.fit.squares(), objective.samples(LogSet::Learn)) <= RUN_OFF;
    let similar = |candidate: &usize| {
        let fitted = rivals.iter().any(|rival| rival.candidate == *candidate);
        let is_similar = objective.candidates()[leader.candidate].similar.contains(candidate);
        (near && is_similar && !fitted) || is_simpler(objective, leader.candidate, *candidate)
    };
    let was_screened = |candidate: &usize| screened.iter().any(|start| start.candidate == *candidate);
    offered.iter().copied().filter(|candidate| similar(candidate) || was_screened(candidate)).collect()
}

/// Whether a candidate is similar to another one and has fewer parameters.
fn is_simpler(objective: &Objective, of: usize, candidate: usize) -> bool {
    let candidates = objective.candidates();
    candidates[of].similar.contains(&candidate)
        && candidates[candidate].parameters().count() < candidates[of].parameters().count()
}

/// The leader's point without its effect: from there, probes respond to the missing effect rather than to how the
/// free parameters have compensated for it. `None` where that cannot be simulated.
fn drop_effect(objective: &Objective, leader: &Rival, state: &DiagnosisState) -> Option<FitPoint> {
    let mut u = leader.fit.u.clone();
    objective.candidates()[leader.candidate].parameters().for_each(|parameter| u[parameter] = state.fit.u[parameter]);
    FitPoint::at(objective, state.fit.active.clone(), u, &state.fit.step_error).ok()
}

/// The best fit of each candidate, best first.
fn best_of_each(mut rivals: Vec<Rival>) -> Vec<Rival> {
    rivals.sort_by(|a, b| a.fit.cost.total_cmp(&b.fit.cost));
    let mut seen = Vec::new();
    rivals.retain(|rival| {
        let first = !seen.contains(&rival.candidate);
        seen.push(rival.candidate);
        first
    });
    rivals
}
