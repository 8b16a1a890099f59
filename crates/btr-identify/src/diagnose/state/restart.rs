//! Restarts of a search that may have stopped in a local minimum.

use super::DiagnosisState;
use crate::diagnose::own;
use crate::diagnose::refit::{FOLLOWER, RESHAPED};
use crate::fit::{FitPoint, Objective, SearchBudget};

/// How far parameters are perturbed to restart a search: amplitudes by this share, shapes by this much of their
/// coordinate...
const PERTURBATION: (f64, f64) = (0.15, 0.5);
/// ... and how often at most, while the cost falls below this share each time.
const PERTURBATIONS: usize = 3;
const LOWER: f64 = 0.99;

impl DiagnosisState {
    /// The error jumps where a joint switches between sticking and slipping, and a search stops before a jump: restarts
    /// the search on either side of where each of the latest effect's parameters ended, as long as that lowers the
    /// cost.
    pub(super) fn perturb(&mut self, objective: &Objective, candidate: usize) {
        for _ in 0..PERTURBATIONS {
            if objective.description.is_chaotic || !self.leaves_something(objective, &self.fit) {
                return;
            }
            let effect = &objective.candidates()[candidate];
            let sides = effect.parameters().flat_map(|parameter| [-1.0, 1.0].map(|side| (parameter, side)));
            let perturbed = sides.filter_map(|(parameter, side)| {
                let mut u = self.fit.u.clone();
                let away = if effect.shapes.contains(&parameter) {
                    PERTURBATION.1
                } else {
                    PERTURBATION.0 * u[parameter].abs()
                };
                u[parameter] = objective.parameters()[parameter].clamp(u[parameter] + side * away);
                // A side that cannot be simulated is skipped.
                let mut fit = FitPoint::at(objective, self.fit.active.clone(), u, &self.fit.step_error).ok()?;
                own::solve(objective, candidate, &mut fit, RESHAPED);
                Some(fit)
            });
            let best = perturbed.min_by(|a, b| a.cost.total_cmp(&b.cost));
            let Some(mut best) = best.filter(|best| best.cost < LOWER * self.fit.cost) else { return };
            own::solve(objective, candidate, &mut best, FOLLOWER);
            self.fit = best;
        }
    }

    /// Free parameters that stand at a bound may have compensated for what was missing, and a search from there may not
    /// find back: restarts it with all of them at the model's values, and the effects as they were found.
    pub(super) fn release(&mut self, objective: &Objective) {
        let (parameters, free) = (objective.parameters(), &objective.description.free);
        let is_at_bound =
            |&k: &usize| self.fit.u[k] <= parameters[k].bounds.0 || self.fit.u[k] >= parameters[k].bounds.1;
        let is_needed = !objective.description.is_chaotic && self.leaves_something(objective, &self.fit);
        if !is_needed || !free.iter().any(is_at_bound) {
            return;
        }
        let mut u = self.fit.u.clone();
        free.iter().for_each(|&k| u[k] = 0.0);
        // Where that cannot be simulated, the fit stays.
        let released = FitPoint::at(objective, self.fit.active.clone(), u, &self.fit.step_error);
        let Ok(mut released) = released else { return };
        released.solve(objective, SearchBudget::FULL);
        if released.cost < LOWER * self.fit.cost {
            self.fit = released;
        }
    }
}
