//! One cause for two findings: where two that were found one after the other explain the logs, one alone may as well.

use crate::LadderStep;
use crate::diagnose::refit::{CLOSE, Rival};
use crate::diagnose::state::DiagnosisState;
use crate::diagnose::thresholds::TIE;
use crate::fit::measure::ComparisonMeasure;
use crate::fit::{Objective, SearchBudget};
use crate::residual_model::Needs;

impl DiagnosisState {
    /// Puts one candidate in the place of two findings where it explains as much, and the held-out logs do not
    /// contradict it: a load beyond its link's end passes for a longer link first, and what that leaves for a centre of
    /// mass. Tried is what came close to the later of the two, and is similar to one of them.
    pub(in crate::diagnose) fn one_for_two(&mut self, objective: &mut Objective, on_step: &dyn Fn(&LadderStep)) {
        if self.leaves_something(objective, &self.fit) {
            return;
        }
        let mut later = 1;
        while later < self.chosen.len() && !objective.is_stopped() {
            let both = (0..later).find_map(|earlier| Some((earlier, self.instead_of_both(objective, earlier, later)?)));
            let Some((earlier, (rival, costs))) = both else {
                later += 1;
                continue;
            };
            objective.set_stoppable(false);
            let gone = self.chosen.remove(earlier);
            later -= 1;
            let found = &mut self.chosen[later];
            let both = format!("{}@{} + {}@{}", gone.effect, gone.site, found.effect, found.site);
            found.take_over(&gone);
            found.turn_into(rival.candidate, &objective.candidates()[rival.candidate]);
            // What the later one could not be told from was said of it beside the other one.
            found.alike.clear();
            found.rivals.clear();
            self.put_in_place(objective, later, rival, (costs, both));
            self.ladder.last().into_iter().for_each(on_step);
            objective.set_stoppable(true);
            later = later.max(1);
        }
    }

    /// The candidate that alone explains as much as two findings, with its fit and how far it is behind.
    fn instead_of_both(&self, objective: &Objective, earlier: usize, later: usize) -> Option<(Rival, f64)> {
        let (candidates, found) = (objective.candidates(), &self.chosen[later]);
        let is_similar = |c: usize| {
            let similar = |index: usize| candidates[self.chosen[index].candidate].similar.contains(&c);
            similar(earlier) || similar(later)
        };
        let is_tried = |&c: &usize| candidates[c].needs == Needs::Nothing && !self.is_chosen(c) && is_similar(c);
        let tried: Vec<usize> = found.close.iter().copied().filter(is_tried).collect();
        let needed = [earlier, later].iter().any(|&index| self.has_further_instances(objective, index));
        // What joints usually have is no part of a cause that shows in all channels.
        let usual = [earlier, later].iter().any(|&index| self.chosen[index].is_granted);
        if tried.is_empty() || needed || usual || !self.may_depend_on(objective, earlier, later) {
            return None;
        }
        let mut rival = self.replaced(objective, &[earlier, later], &tried)?;
        if rival.fit.squares() < CLOSE * self.fit.squares() {
            rival.fit.jacobian = None;
            rival.fit.solve(objective, SearchBudget::FULL);
        }
        let measure = ComparisonMeasure::of(objective, &self.fit);
        let costs = measure.behind(&rival.fit, &self.fit);
        (costs <= TIE && self.is_borne_out(objective, rival.candidate, &rival.fit)).then_some((rival, costs))
    }
}
