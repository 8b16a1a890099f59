//! What could not be told from a finding when it was found, compared again once the other findings are known.

use crate::LadderStep;
use crate::diagnose::own;
use crate::diagnose::refit::{FOLLOWER, Rival, race};
use crate::diagnose::report::{RivalPoint, RivalProbability};
use crate::diagnose::state::DiagnosisState;
use crate::diagnose::thresholds::{DECISIVE, HELD_OUT_FALL, LEARNT_FALL, TIE};
use crate::fit::measure::{ComparisonMeasure, held_out_squares};
use crate::fit::{FitPoint, Objective};
use crate::residual_model::Needs;

impl DiagnosisState {
    /// Compares each finding with what did nearly as well when it was found: what was missing then may have decided. It
    /// gives way to one that explains more, or as much with fewer parameters, and what cannot be told from it is
    /// declared. What the held-out logs contradict is passed over.
    pub(in crate::diagnose) fn compare_again(&mut self, objective: &mut Objective, on_step: &dyn Fn(&LadderStep)) {
        for index in 0..self.chosen.len() {
            let mut later = index + 1..self.chosen.len();
            let is_compared = !self.chosen[index].is_granted;
            let is_changed = later.any(|later| self.may_depend_on(objective, index, later));
            if objective.is_stopped() || is_compared && !is_changed {
                continue;
            }
            let mut rivals = self.close_rivals(objective, index);
            let is_ahead = rivals.first().is_some_and(|(_, behind)| *behind < -TIE);
            if is_ahead && self.follow_rival(objective, index, &rivals[0].0) {
                rivals = self.close_rivals(objective, index);
            }
            let takes_over = |(rival, behind): &&(Rival, f64)| {
                *behind < -TIE || rival.fit.active.len() < self.fit.active.len() && *behind <= TIE
            };
            if let Some((rival, behind)) = rivals.iter().find(takes_over).cloned() {
                objective.set_stoppable(false);
                self.rename(objective, index, rival, behind);
                self.ladder.last().into_iter().for_each(on_step);
                objective.set_stoppable(true);
            }
            self.declare_alike(objective, index, &rivals);
            self.chosen[index].is_granted = false;
        }
    }

    /// What was taken for granted and not compared with similar effects any more cannot be told from them.
    pub(in crate::diagnose) fn share_uncompared(&mut self, objective: &Objective) {
        let candidates = objective.candidates();
        let chosen: Vec<usize> = self.chosen.iter().map(|found| found.candidate).collect();
        for found in self.chosen.iter_mut().filter(|found| found.is_granted) {
            let others =
                found.close.iter().filter(|other| !chosen.contains(other)).map(|&other| candidates[other].name());
            let new = others.filter(|name| !found.alike.contains(name)).map(|name| (name, 1.0)).collect();
            found.share_with(new);
        }
    }

    /// What did nearly as well as a finding when it was found, fitted in its place beside the others, each with how far
    /// it is behind; the best first.
    fn close_rivals(&self, objective: &Objective, index: usize) -> Vec<(Rival, f64)> {
        let (candidates, found) = (objective.candidates(), &self.chosen[index]);
        let is_new = |&c: &usize| {
            candidates[c].needs == Needs::Nothing && !found.alike.contains(&candidates[c].name()) && !self.is_chosen(c)
        };
        let close = found.close.iter().copied().filter(is_new);
        let fitted = close.filter_map(|candidate| self.in_place(objective, index, candidate));
        let borne_out = fitted.filter(|rival| self.is_borne_out(objective, rival.candidate, &rival.fit));
        let measure = ComparisonMeasure::of(objective, &self.fit);
        let with_distance = |rival: Rival| {
            let behind = measure.behind(&rival.fit, &self.fit);
            (rival, behind)
        };
        let mut rivals: Vec<(Rival, f64)> = borne_out.map(with_distance).collect();
        rivals.sort_by(|(_, a), (_, b)| a.total_cmp(b));
        rivals
    }

    /// Fits the findings once more from where a rival of one of them has moved all else, and says whether that leaves
    /// less, on training logs and not more on held-out ones: a search that has stopped early is no evidence for the
    /// rival.
    fn follow_rival(&mut self, objective: &Objective, index: usize, rival: &Rival) -> bool {
        let candidates = objective.candidates();
        let found = self.chosen[index].candidate;
        let acts_through = |needs: &Needs| match needs {
            Needs::Nothing => false,
            Needs::OneOf(others) => others.contains(&found),
            Needs::Instance(first) => *first == found,
        };
        let mut u = rival.fit.u.clone();
        candidates[rival.candidate].parameters().for_each(|k| u[k] = 0.0);
        let own = self.chosen.iter().map(|other| other.candidate);
        let own = own.filter(|&c| c == found || acts_through(&candidates[c].needs));
        own.flat_map(|c| candidates[c].parameters()).for_each(|k| u[k] = self.fit.u[k]);
        let Ok(mut fit) = FitPoint::at(objective, self.fit.active.clone(), u, &self.fit.step_error) else {
            return false;
        };
        fit.solve(objective, FOLLOWER);
        let is_better = fit.cost < self.fit.cost && self.is_borne_out(objective, found, &fit);
        if is_better {
            self.fit = fit;
            self.renew_last_step(objective);
        }
        is_better
    }

    /// Declares those of some fitted rivals that cannot be told from a finding, which shares its probability with them.
    fn declare_alike(&mut self, objective: &Objective, index: usize, rivals: &[(Rival, f64)]) {
        let candidates = objective.candidates();
        let chosen = self.chosen[index].candidate;
        let measure = ComparisonMeasure::of(objective, &self.fit);
        let behind = |rival: &Rival| measure.behind(&rival.fit, &self.fit);
        let others = rivals.iter().map(|(rival, _)| rival).filter(|rival| rival.candidate != chosen);
        let alike: Vec<&Rival> = others.filter(|rival| behind(rival) <= DECISIVE).collect();
        if alike.is_empty() {
            return;
        }
        let belief = |rival: &Rival| (-behind(rival).max(-TIE) / 2.0).exp();
        let beliefs = alike.iter().map(|rival| (candidates[rival.candidate].name(), belief(rival))).collect();
        self.chosen[index].share_with(beliefs);
        if self.rivals.is_empty() {
            let now = RivalPoint { candidate: chosen, u: self.fit.u.clone() };
            let others = alike.iter().map(|rival| RivalPoint { candidate: rival.candidate, u: rival.fit.u.clone() });
            self.rivals = [now].into_iter().chain(others).collect();
        }
    }

    /// Takes from each finding the laws that were alike and now explain clearly less beside the others, and gives it
    /// their share of the probability. The latest one has been compared beside all others.
    pub(in crate::diagnose) fn tell_apart(&mut self, objective: &Objective) {
        for index in 0..self.chosen.len().saturating_sub(1) {
            let candidates = objective.candidates();
            let was_alike =
                |c: &usize| self.chosen[index].alike.contains(&candidates[*c].name()) && !self.is_chosen(*c);
            let alike: Vec<usize> = (0..candidates.len()).filter(was_alike).collect();
            let fitted: Vec<Option<Rival>> = alike.iter().map(|&c| self.in_place(objective, index, c)).collect();
            let measure = ComparisonMeasure::of(objective, &self.fit);
            let behind = |fit: &FitPoint| measure.behind(fit, &self.fit);
            let is_told = |rival: &Rival| behind(&rival.fit) > DECISIVE && self.explains_clearly_more(objective, rival);
            let told: Vec<String> =
                fitted.iter().flatten().filter(|r| is_told(r)).map(|r| candidates[r.candidate].name()).collect();
            if told.is_empty() {
                continue;
            }
            // What is still alike counts as much as a tie, at least; so does what could not be fitted again.
            let left = alike.iter().zip(&fitted).filter(|(_, rival)| rival.as_ref().is_none_or(|r| !is_told(r)));
            let belief = |r: &Rival| (-behind(&r.fit).clamp(-TIE, TIE) / 2.0).exp();
            let others: Vec<(String, f64)> =
                left.map(|(&c, rival)| (candidates[c].name(), rival.as_ref().map_or(1.0, belief))).collect();
            let total: f64 = 1.0 + others.iter().map(|(_, belief)| belief).sum::<f64>();
            self.rivals.retain(|rival| !told.contains(&candidates[rival.candidate].name()));
            if self.rivals.len() < 2 {
                self.rivals.clear();
            }
            let found = &mut self.chosen[index];
            found.alike.retain(|name| !told.contains(name));
            found.probability = found.probability.max(1.0 / total);
            let others = others.into_iter().map(|(name, belief)| (Some(name), belief / total));
            found.rivals = RivalProbability::likeliest(others);
        }
    }

    /// A candidate in the place of a finding, fitted beside the others from its values where they say where to begin.
    fn in_place(&self, objective: &Objective, index: usize, candidate: usize) -> Option<Rival> {
        let starts = self.carried_over(objective, index, &[candidate]);
        if starts.is_empty() {
            return self.replaced(objective, &[index], &[candidate]);
        }
        let mut base = self.less(objective, &[index])?;
        base.differentiate(objective);
        race(objective, &[base], &starts, None).into_iter().next()
    }

    /// Whether the present fit leaves clearly less than a rival on the training logs, and no more on the held-out ones.
    fn explains_clearly_more(&self, objective: &Objective, rival: &Rival) -> bool {
        let learnt = |fit: &FitPoint| own::learnt(objective, rival.candidate, fit);
        let held_out = || held_out_squares(objective, &rival.fit.u);
        learnt(&rival.fit) > (1.0 + LEARNT_FALL) * learnt(&self.fit)
            && self.held_out.is_none_or(|now| held_out().is_none_or(|then| now <= (1.0 + HELD_OUT_FALL) * then))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::diagnose::beginning::with_one_found;
    use crate::fixture::{SyntheticModel, parameter};
    use crate::residual_model::Parametrisation;
    use std::f64::consts::PI;

    #[test]
    fn a_rival_is_not_ahead_of_a_finding_whose_search_has_stopped_early() {
        // Two effects that do the same. The gain has its least squares at 1, and a local minimum near 6.
        let residual = |values: &[f64]| {
            let (gain, size) = (values[0] - 1.0, values[1] + values[2] - 2.0);
            vec![20.0 * (PI * gain / 5.0).sin(), 2.0 * gain, 20.0 * size, 20.0 * size]
        };
        let linear = || parameter(Parametrisation::Linear, 0.0, 1.0);
        let model = SyntheticModel::new(vec![linear(), linear(), linear()], 4, residual);
        let model = model.with_candidate(1).with_candidate(2);
        let mut objective = Objective::new(&model);
        let mut state = with_one_found(&mut objective, 0, &[6.0, 1.0, 0.0]);
        let rival = Rival { candidate: 1, fit: with_one_found(&mut objective, 1, &[0.0, 0.0, 1.0]).fit };
        let behind =
            |state: &DiagnosisState| ComparisonMeasure::of(&objective, &state.fit).behind(&rival.fit, &state.fit);
        assert!(behind(&state) < -TIE, "{}", behind(&state));
        assert!(state.follow_rival(&objective, 0, &rival));
        assert!(behind(&state).abs() < TIE, "{}", behind(&state));
        assert!(!state.follow_rival(&objective, 0, &rival));
    }
}
