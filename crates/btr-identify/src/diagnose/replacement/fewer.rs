//! One cause for two findings: where two that were found one after the other explain the logs, one alone may as well.

use crate::LadderStep;
use crate::diagnose::refit::{CLOSE, Rival};
use crate::diagnose::state::DiagnosisState;
use crate::diagnose::thresholds::{HELD_OUT_FALL, TIE};
use crate::fit::measure::held_out_squares;
use crate::fit::{Objective, SearchBudget};

impl DiagnosisState {
    /// Puts one candidate in the place of two findings where it explains as much, and the held-out logs do not
    /// contradict it: a load beyond its link's end passes for a longer link first, and what that leaves for a centre of
    /// mass. Tried is what could hardly be told from the later of the two, and is similar to one of them.
    pub(in crate::diagnose) fn one_for_two(&mut self, objective: &Objective, on_step: &dyn Fn(&LadderStep)) {
        if self.leaves_something(objective, &self.fit) {
            return;
        }
        let mut later = 1;
        while later < self.chosen.len() {
            let both = (0..later).find_map(|earlier| Some((earlier, self.instead_of_both(objective, earlier, later)?)));
            match both {
                Some((earlier, rival)) => {
                    let gone = self.chosen.remove(earlier);
                    let costs = self.behind(objective, &rival.fit);
                    self.rename(objective, later - 1, rival, costs);
                    self.chosen[later - 1].take_over(&gone);
                    self.ladder.last().into_iter().for_each(on_step);
                }
                None => later += 1,
            }
        }
    }

    /// The candidate that alone explains as much as two findings, with its fit.
    fn instead_of_both(&self, objective: &Objective, earlier: usize, later: usize) -> Option<Rival> {
        let (candidates, found) = (objective.candidates(), &self.chosen[later]);
        let of_either = |c: &usize| {
            let similar = |index: usize| candidates[self.chosen[index].candidate].similar.contains(c);
            similar(earlier) || similar(later)
        };
        let tried: Vec<usize> = found.close.iter().copied().filter(|c| !self.is_chosen(*c)).filter(of_either).collect();
        if tried.is_empty() || !self.may_depend_on(objective, earlier, later) {
            return None;
        }
        let confirms = |rival: &Rival, now: f64| {
            held_out_squares(objective, &rival.fit.u).is_some_and(|then| then <= (1.0 + HELD_OUT_FALL) * now)
        };
        let mut rival = self.replaced(objective, &[earlier, later], &tried)?;
        if rival.fit.squares() < CLOSE * self.fit.squares() {
            rival.fit.jacobian = None;
            rival.fit.solve(objective, SearchBudget::FULL);
        }
        Some(rival)
            .filter(|rival| self.behind(objective, &rival.fit) <= TIE)
            .filter(|rival| self.held_out.is_none_or(|now| confirms(rival, now)))
    }
}
