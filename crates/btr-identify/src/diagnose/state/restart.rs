//! Restarts of a search that may have stopped before a jump of the error.

use super::DiagnosisState;
use crate::diagnose::own;
use crate::diagnose::refit::FOLLOWER;
use crate::fit::{FitPoint, Objective, SearchBudget};

/// How far parameters are perturbed to restart a search: amplitudes by this share, shapes by this much of their
/// coordinate...
const PERTURBATION: (f64, f64) = (0.15, 0.5);
/// ... and how often at most, while the cost falls below this share each time.
const PERTURBATIONS: usize = 3;
const LOWER: f64 = 0.99;
/// The budget for each restart.
const NEARBY: SearchBudget = SearchBudget { jacobians: 0, steps: 6 };

impl DiagnosisState {
    /// The error jumps where a joint switches between sticking and slipping, and a search stops before a jump: restarts
    /// the search on either side of where each of the latest effect's parameters ended, as long as that lowers the
    /// cost.
    pub(super) fn perturb(&mut self, objective: &Objective, candidate: usize) {
        for _ in 0..PERTURBATIONS {
            if objective.description.is_chaotic || !self.leaves_something(objective, &self.fit) {
                return;
            }
            if self.fit.jacobian.is_none() {
                self.fit.differentiate(objective);
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
                // The slopes from where the search ended will do: they are corrected with every step.
                fit.jacobian.clone_from(&self.fit.jacobian);
                own::solve(objective, candidate, &mut fit, NEARBY);
                Some(fit)
            });
            let best = perturbed.min_by(|a, b| a.cost.total_cmp(&b.cost));
            let Some(mut best) = best.filter(|best| best.cost < LOWER * self.fit.cost) else { return };
            own::solve(objective, candidate, &mut best, FOLLOWER);
            self.fit = best;
        }
    }
}
