//! What could not be told from a finding when it was found, compared again once the other findings are known.

use crate::diagnose::own;
use crate::diagnose::refit::{Rival, race};
use crate::diagnose::report::RivalProbability;
use crate::diagnose::state::DiagnosisState;
use crate::diagnose::thresholds::{DECISIVE, HELD_OUT_FALL, LEARNT_FALL, TIE};
use crate::fit::measure::{ComparisonMeasure, held_out_squares};
use crate::fit::{FitPoint, Objective};

impl DiagnosisState {
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
            let behind = |fit: &FitPoint| measure.criterion(fit) - measure.criterion(&self.fit);
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
        race(objective, &[self.less(objective, &[index])?], &starts, None).into_iter().next()
    }

    /// Whether the present fit leaves clearly less than a rival on the training logs, and no more on the held-out ones.
    fn explains_clearly_more(&self, objective: &Objective, rival: &Rival) -> bool {
        let learnt = |fit: &FitPoint| own::learnt(objective, rival.candidate, fit);
        let held_out = || held_out_squares(objective, &rival.fit.u);
        learnt(&rival.fit) > (1.0 + LEARNT_FALL) * learnt(&self.fit)
            && self.held_out.is_none_or(|now| held_out().is_none_or(|then| now <= (1.0 + HELD_OUT_FALL) * then))
    }
}
