//! What could not be told from a finding when it was found, compared again once the other findings are known.

use crate::LadderStep;
use crate::diagnose::own;
use crate::diagnose::refit::{Rival, race};
use crate::diagnose::report::RivalProbability;
use crate::diagnose::state::DiagnosisState;
use crate::diagnose::thresholds::{DECISIVE, HELD_OUT_FALL, LEARNT_FALL, TIE};
use crate::fit::measure::{ComparisonMeasure, held_out_squares};
use crate::fit::{FitPoint, Objective};

impl DiagnosisState {
    /// Compares each finding with what did nearly as well when it was found: what was missing then may have decided. It
    /// gives way to one that explains decisively more, or as much with fewer parameters, and what cannot be told from
    /// it is declared.
    pub(in crate::diagnose) fn compare_again(&mut self, objective: &Objective, on_step: &dyn Fn(&LadderStep)) {
        for index in 0..self.chosen.len().saturating_sub(1) {
            let rivals = self.close_rivals(objective, index);
            let takes_over = |rival: &&Rival| {
                let behind = self.behind(objective, &rival.fit);
                let is_simpler = rival.fit.active.len() < self.fit.active.len();
                behind < -DECISIVE || is_simpler && behind <= TIE
            };
            let steps = self.ladder.len();
            if let Some(rival) = rivals.iter().find(takes_over).cloned() {
                self.rename_if_it_will_do(objective, index, rival);
                self.ladder[steps..].iter().for_each(on_step);
            }
            self.declare_alike(objective, index, &rivals);
        }
    }

    /// What did nearly as well as a finding when it was found, fitted in its place beside the others, best first.
    fn close_rivals(&self, objective: &Objective, index: usize) -> Vec<Rival> {
        let found = &self.chosen[index];
        let is_known = |c: usize| found.alike.contains(&objective.candidates()[c].name()) || self.is_chosen(c);
        let close = found.close.iter().copied().filter(|&candidate| !is_known(candidate));
        let mut rivals: Vec<Rival> = close.filter_map(|candidate| self.in_place(objective, index, candidate)).collect();
        rivals.sort_by(|a, b| self.behind(objective, &a.fit).total_cmp(&self.behind(objective, &b.fit)));
        rivals
    }

    /// Declares those of some fitted rivals that cannot be told from a finding, which shares its probability with them.
    fn declare_alike(&mut self, objective: &Objective, index: usize, rivals: &[Rival]) {
        let candidates = objective.candidates();
        let chosen = self.chosen[index].candidate;
        let others = rivals.iter().filter(|rival| rival.candidate != chosen);
        let behind = others.map(|rival| (candidates[rival.candidate].name(), self.behind(objective, &rival.fit)));
        let alike: Vec<(String, f64)> = behind.filter(|(_, behind)| *behind <= DECISIVE).collect();
        let found = &mut self.chosen[index];
        found.alike.extend(
            alike.iter().map(|(name, _)| name.clone()).filter(|name| !found.alike.contains(name)).collect::<Vec<_>>(),
        );
        found.share_with(alike.into_iter().map(|(name, behind)| (name, (-behind / 2.0).exp())).collect());
    }

    /// How far a fit is behind the present one, in units of B.
    pub(super) fn behind(&self, objective: &Objective, fit: &FitPoint) -> f64 {
        let measure = ComparisonMeasure::of(objective, &self.fit);
        measure.criterion(fit) - measure.criterion(&self.fit)
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
            let behind = |fit: &FitPoint| self.behind(objective, fit);
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
