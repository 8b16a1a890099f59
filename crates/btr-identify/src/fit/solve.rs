//! Bounded least squares with priors: the Levenberg-Marquardt method on finite differences, with Broyden updates
//! between Jacobians, because a Jacobian costs a rollout per parameter and log.

use super::objective::{LogSet, Objective, blocks};
use super::residual_vector::{ResidualVector, chi, corrected, squares};
use crate::residual_model::FitParameter;
use btr_core::optimize::QuadraticModel;
use btr_core::world::WorldError;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use std::ops::Range;

/// The most Jacobians and steps of one call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SearchBudget {
    /// Jacobians by finite differences.
    pub jacobians: usize,
    /// Attempted steps.
    pub steps: usize,
}

impl SearchBudget {
    /// Until convergence.
    pub const FULL: SearchBudget = SearchBudget { jacobians: 5, steps: 20 };
    /// Budget in a race: no Jacobians, a few steps.
    pub const RACE: SearchBudget = SearchBudget { jacobians: 0, steps: 6 };
}

/// Why a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FitStop {
    /// The search converged.
    Converged,
    /// The budget is spent.
    Effort,
    /// No direction lowers the cost, or no nearby point can be simulated.
    Stuck,
}

/// A Jacobian is renewed when the cost has fallen below this share of its value where the Jacobian was taken.
const WORN: f64 = 0.3;
/// A fall of the cost by a smaller share, or by a smaller amount, is a stall.
const STALL: (f64, f64) = (1e-4, 0.02);
/// The damping, relative to the diagonal: its start value, its factors on success and failure, and its limit.
const DAMPING: (f64, f64, f64, f64) = (1e-3, 0.2, 8.0, 1e4);

/// A point with its residual and Jacobian.
#[derive(Clone, Debug)]
pub struct FitPoint {
    /// The free parameters, as indices; all others keep their values.
    pub active: Vec<usize>,
    /// One coordinate per parameter of the model.
    pub u: Vec<f64>,
    /// Residual on the training logs, step error included.
    pub residual: ResidualVector,
    /// Sum of squares of the residual and of the priors.
    pub cost: f64,
    /// The integrator's error of each residual; constant during a search.
    pub step_error: ResidualVector,
    /// d residual / d coordinate of each active parameter, where it is known.
    pub jacobian: Option<DMatrix<f64>>,
    /// Whether the Jacobian was taken here by differences, and not carried over.
    pub fresh: bool,
}

/// The point after a step.
struct Trial {
    u: Vec<f64>,
    /// The change of each active parameter.
    moved: DVector<f64>,
    residual: ResidualVector,
    cost: f64,
}

impl FitPoint {
    /// A fit at a point; without a `step_error`, none is assumed.
    ///
    /// # Errors
    /// The reason of the first failing rollout on a training log.
    pub fn at(
        objective: &Objective,
        active: Vec<usize>,
        u: Vec<f64>,
        step_error: &[f64],
    ) -> Result<FitPoint, WorldError> {
        let residual = objective.residual(&u, LogSet::Learn)?;
        let step_error = if step_error.is_empty() { vec![0.0; residual.len()] } else { step_error.to_vec() };
        let residual = corrected(residual, &step_error);
        let cost = cost(objective.parameters(), &active, &u, &residual);
        Ok(FitPoint { active, u, residual, cost, step_error, jacobian: None, fresh: false })
    }

    /// Sum of squares of the residual alone.
    pub fn squares(&self) -> f64 {
        squares(&self.residual)
    }

    /// The same fit restricted to some rows of the residual, in their order.
    pub(crate) fn in_rows(&self, rows: &[Range<usize>]) -> FitPoint {
        let jacobian = self.jacobian.as_ref().map(|jacobian| {
            let rows: Vec<usize> = rows.iter().cloned().flatten().collect();
            jacobian.select_rows(&rows)
        });
        let of = |all: &[f64]| rows.iter().flat_map(|rows| &all[rows.clone()]).copied().collect::<Vec<f64>>();
        let (residual, step_error) = (of(&self.residual), of(&self.step_error));
        let cost = self.cost - self.squares() + squares(&residual);
        FitPoint {
            active: self.active.clone(),
            u: self.u.clone(),
            residual,
            cost,
            step_error,
            jacobian,
            fresh: self.fresh,
        }
    }

    /// Takes the integrator's error at this point into account, with a finer time step where it is large on the
    /// training or held-out logs; not where the error has no order (chaos, or a rotor that meets its flank a step
    /// earlier), so that extrapolation from half the step increases the error. Returns the root mean square of the
    /// error on the training logs, in multiples of the noise floor.
    pub fn renew_step_error(&mut self, objective: &mut Objective) -> f64 {
        let mut bare = self.bare();
        let (error, size) = loop {
            // Where half the step diverges, the error is unknown.
            let halved = objective.halved(&self.u, LogSet::Learn).unwrap_or_else(|_| bare.clone());
            let error = objective.beyond(&bare, &halved);
            let size = chi(squares(&error), objective.samples(LogSet::Learn));
            if !objective.refine(size, |objective| self.held_out_step_error(objective)) {
                break (error, size);
            }
            bare = halved;
        };
        let extrapolated = corrected(bare.clone(), &error);
        let orderly = !objective.description.is_chaotic && squares(&extrapolated) < squares(&bare);
        (self.residual, self.step_error) = match orderly {
            true => (extrapolated, error),
            false => (bare, vec![0.0; error.len()]),
        };
        self.cost = cost(objective.parameters(), &self.active, &self.u, &self.residual);
        size
    }

    /// The integrator's error on the held-out logs; 0 without such, or where they cannot be simulated.
    pub(crate) fn held_out_step_error(&self, objective: &Objective) -> f64 {
        let usual = objective.residual(&self.u, LogSet::HeldOut).unwrap_or_default();
        let error = objective.step_error(&self.u, &usual, LogSet::HeldOut);
        chi(squares(&error), objective.samples(LogSet::HeldOut))
    }

    /// The residual as simulated.
    pub(super) fn bare(&self) -> ResidualVector {
        self.residual.iter().zip(&self.step_error).map(|(r, e)| r - e).collect()
    }

    /// Lowers the cost as far as the budget allows.
    pub fn solve(&mut self, objective: &Objective, budget: SearchBudget) -> FitStop {
        let (start, better, worse, hopeless) = DAMPING;
        let (mut damping, mut spent) = (start, 0);
        let mut cost_at_jacobian = self.cost;
        let mut renewal = self.jacobian.is_none();
        for _ in 0..budget.steps {
            renewal |= !self.fresh && self.cost < WORN * cost_at_jacobian && spent < budget.jacobians;
            if renewal {
                if spent == budget.jacobians {
                    return FitStop::Effort;
                }
                self.differentiate(objective);
                (spent, cost_at_jacobian, damping) = (spent + 1, self.cost, start);
            }
            let Some(trial) = self.step(objective, damping) else {
                return if self.fresh { FitStop::Converged } else { FitStop::Stuck };
            };
            let fall = self.cost - trial.cost;
            let stalled = fall < STALL.0 * self.cost || fall < STALL.1;
            if fall > 0.0 {
                self.go_to(objective, trial);
                damping *= better;
            } else {
                damping *= worse;
            }
            // A stall at the point of the Jacobian ends the search; at other points the Jacobian may be outdated.
            let exhausted = fall > 0.0 || damping > hopeless;
            if stalled && exhausted && (self.fresh || spent == budget.jacobians) {
                return if spent == budget.jacobians && !self.fresh { FitStop::Effort } else { FitStop::Converged };
            }
            renewal = (stalled && exhausted) || (fall <= 0.0 && !self.fresh && spent < budget.jacobians);
        }
        FitStop::Effort
    }

    /// The same, by some of the active parameters alone.
    pub(crate) fn solve_among(
        &mut self,
        objective: &Objective,
        is_free: &dyn Fn(usize) -> bool,
        budget: SearchBudget,
    ) -> FitStop {
        let free: Vec<usize> = (0..self.active.len()).filter(|&k| is_free(self.active[k])).collect();
        self.jacobian = self.jacobian.take().map(|jacobian| jacobian.select_columns(&free));
        let active = std::mem::take(&mut self.active);
        self.active = free.iter().map(|&k| active[k]).collect();
        self.cost = cost(objective.parameters(), &self.active, &self.u, &self.residual);
        let stop = self.solve(objective, budget);
        (self.active, self.jacobian, self.fresh) = (active, None, false);
        self.cost = cost(objective.parameters(), &self.active, &self.u, &self.residual);
        stop
    }

    /// The last part of a search, where short differences lead no further: uses differences as wide as the remaining
    /// uncertainty.
    pub fn polish(&mut self, objective: &Objective) {
        self.differentiate_widely(objective);
        self.solve(objective, SearchBudget { jacobians: 0, steps: 8 });
    }

    /// The point after a damped step; `None` without a nonzero step. A point that cannot be simulated has an infinite
    /// cost, so that the caller increases the damping.
    fn step(&self, objective: &Objective, damping: f64) -> Option<Trial> {
        let parameters = objective.parameters();
        let jacobian = self.jacobian.as_ref()?;
        let step = self.direction(parameters, &self.quadratic_model(objective, jacobian), damping)?;
        let mut u = self.u.clone();
        for (k, &parameter) in self.active.iter().enumerate() {
            u[parameter] = parameters[parameter].clamp(u[parameter] + step[k]);
        }
        let moved = DVector::from_iterator(
            self.active.len(),
            self.active.iter().map(|&parameter| u[parameter] - self.u[parameter]),
        );
        if moved.norm_squared() < 1e-18 {
            return None;
        }
        let Ok(residual) = objective.residual(&u, LogSet::Learn) else {
            return Some(Trial { u, moved, residual: Vec::new(), cost: f64::INFINITY });
        };
        let residual = corrected(residual, &self.step_error);
        let cost = cost(parameters, &self.active, &u, &residual);
        Some(Trial { u, moved, residual, cost })
    }

    /// Goes to the point after a step, and updates the Jacobian.
    fn go_to(&mut self, objective: &Objective, Trial { u, moved, residual, cost }: Trial) {
        if let Some(jacobian) = &mut self.jacobian {
            let change = residual.iter().zip(&self.residual).map(|(a, b)| a - b);
            let difference = DVector::from_iterator(residual.len(), change) - &*jacobian * &moved;
            blocks::update(jacobian, &difference, &moved, &objective.blocks(&self.active));
        }
        (self.u, self.residual, self.cost, self.fresh) = (u, residual, cost, false);
    }

    /// The damped Gauss-Newton step in the parameters that are not held at a bound. A parameter is held where the
    /// step would carry it over its bound; the gradient alone does not show that where parameters are correlated.
    fn direction(&self, parameters: &[FitParameter], normal: &QuadraticModel, damping: f64) -> Option<DVector<f64>> {
        self.step_holding(parameters, normal, damping, |u, by, (least, most)| {
            ((u <= least && by < 0.0) || (u >= most && by > 0.0)).then_some(0.0)
        })
    }

    /// The Gauss-Newton step to the least squares within the bounds.
    pub(crate) fn step_within_bounds(
        &self,
        parameters: &[FitParameter],
        normal: &QuadraticModel,
    ) -> Option<DVector<f64>> {
        self.step_holding(parameters, normal, 0.0, |u, by, (least, most)| {
            let end = u + by;
            (end < least || end > most).then(|| end.clamp(least, most) - u)
        })
    }

    /// A step in which more and more parameters are held: `hold` has the change at which one is held, from its
    /// coordinate, the change that the step would make, and its bounds.
    fn step_holding(
        &self,
        parameters: &[FitParameter],
        normal: &QuadraticModel,
        damping: f64,
        hold: impl Fn(f64, f64, (f64, f64)) -> Option<f64>,
    ) -> Option<DVector<f64>> {
        // No derivative leads down a stair.
        let is_stair = |k: &usize| parameters[*k].is_searched();
        let mut held: Vec<Option<f64>> = self.active.iter().map(|k| is_stair(k).then_some(0.0)).collect();
        loop {
            let step = normal.step(damping, &held)?;
            let by = |k: usize| hold(self.u[self.active[k]], step[k], parameters[self.active[k]].bounds);
            let free = (0..held.len()).filter(|&k| held[k].is_none());
            let more: Vec<(usize, f64)> = free.filter_map(|k| Some((k, by(k)?))).collect();
            if more.is_empty() {
                return Some(step);
            }
            more.into_iter().for_each(|(k, by)| held[k] = Some(by));
        }
    }

    /// The local quadratic model of half the cost.
    pub(crate) fn quadratic_model(&self, objective: &Objective, jacobian: &DMatrix<f64>) -> QuadraticModel {
        let curvature = objective.curvature(jacobian, objective.logs(LogSet::Learn), &self.active);
        let gradient = blocks::gradient(jacobian, &self.residual);
        self.with_priors(objective.parameters(), curvature, gradient)
    }

    fn with_priors(
        &self,
        parameters: &[FitParameter],
        mut curvature: DMatrix<f64>,
        mut gradient: DVector<f64>,
    ) -> QuadraticModel {
        for (k, &parameter) in self.active.iter().enumerate() {
            let information = parameters[parameter].prior_sd().powi(-2);
            curvature[(k, k)] += information;
            gradient[k] += information * self.u[parameter];
        }
        QuadraticModel { curvature, gradient }
    }
}

/// Sum of squares of residual and priors.
pub fn cost(parameters: &[FitParameter], active: &[usize], u: &[f64], residual: &[f64]) -> f64 {
    let prior: f64 = active.iter().map(|&parameter| (u[parameter] / parameters[parameter].prior_sd()).powi(2)).sum();
    squares(residual) + prior
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::parameter;
    use crate::residual_model::Parametrisation;

    #[test]
    fn a_bound_holds_only_the_parameter_that_the_step_would_carry_over_it() {
        let parameter = |most: f64| FitParameter {
            bounds: (-9.0, most),
            spread: 1e6,
            reach: 0.1,
            ..parameter(Parametrisation::Linear, 0.0, 1.0)
        };
        // Each alone would grow to lower the error, but the joint step decreases the first so that the second can grow.
        let jacobian = DMatrix::from_row_slice(2, 2, &[1.0, 0.99, 0.0, 0.14]);
        let residual = vec![-0.1, -6.4];
        assert!(jacobian.tr_mul(&DVector::from_column_slice(&residual)).max() < 0.0);
        let fit = FitPoint {
            active: vec![0, 1],
            u: vec![1.0, 1.0],
            cost: squares(&residual),
            step_error: vec![0.0; 2],
            residual,
            jacobian: None,
            fresh: false,
        };
        let gradient = jacobian.tr_mul(&DVector::from_column_slice(&fit.residual));
        let step = |most: [f64; 2]| {
            let parameters = most.map(parameter);
            let normal = fit.with_priors(&parameters, jacobian.tr_mul(&jacobian), gradient.clone());
            fit.direction(&parameters, &normal, 0.0).map(|step| (step[0], step[1]))
        };
        assert!(step([1.0, 9.0]).is_some_and(|(first, second)| first < 0.0 && second > 0.0));
        assert_eq!(step([1.0, 1.0]), Some((0.0, 0.0)));
    }
}
