//! The last part of a fit: moves the estimates to the middle of what the logs leave open.

use super::objective::{LogSet, Objective};
use super::residual_vector::{ResidualVector, corrected};
use super::solve::{FitPoint, cost};
use crate::residual_model::FitParameter;
use btr_core::optimize::QuadraticModel;
use btr_core::world::WorldError;
use nalgebra::{DMatrix, DVector};

/// Most steps, as long as each lowers the cost by this much, and the shares of each step that are tried.
const SETTLING: usize = 12;
const WORTH_A_STEP: f64 = 0.1;
const SHARES: [f64; 3] = [1.0, 0.5, 0.2];
/// The shares of a step at which its curvature is measured, and the largest correction relative to the step.
const AHEAD: [f64; 2] = [0.1, 0.2];
const BENT: f64 = 0.75;
/// The Jacobian is renewed where the cost falls by less than this share of the predicted fall, ...
const KEPT: f64 = 0.5;
/// ... but at most this often.
const RENEWALS: usize = 2;

impl FitPoint {
    /// Moves to the minimum of the cost along poorly determined directions, with differences as wide as the uncertainty
    /// there: a search for a lower error stops anywhere along such a direction, but an estimate must be in its middle.
    /// The valley is curved (a common factor of masses, gains and friction), so steps are proportional, with a
    /// second-order correction (geodesic acceleration):
    /// M. K. Transtrum and J. P. Sethna, "Improvements to the Levenberg-Marquardt algorithm for nonlinear least-squares
    /// minimization", arXiv:1201.5885.
    pub fn settle(&mut self, objective: &Objective) {
        self.differentiate_widely(objective);
        let mut renewals = 0;
        for _ in 0..SETTLING {
            let (fall, predicted) = match self.settling_step(objective) {
                Some((to, predicted)) => {
                    let (fall, jacobian) = (self.cost - to.cost, self.jacobian.take());
                    *self = FitPoint { jacobian, ..to };
                    (fall, predicted)
                }
                None if self.fresh => return,
                None => (0.0, f64::INFINITY),
            };
            // If the cost falls less than predicted, the Jacobian does not hold at this point.
            if fall < KEPT * predicted && predicted > WORTH_A_STEP && renewals < RENEWALS {
                self.differentiate_widely(objective);
                renewals += 1;
            } else if fall < WORTH_A_STEP {
                return;
            }
        }
    }

    /// The best point along the step to the local model's minimum, if its cost is lower, and by how much the cost
    /// should fall.
    fn settling_step(&self, objective: &Objective) -> Option<(FitPoint, f64)> {
        let (parameters, jacobian) = (objective.parameters(), self.jacobian.as_ref()?);
        let (straight, pinned) = self.bounded_step(objective, jacobian)?;
        let predicted = self.predicted_fall(parameters, jacobian, &straight);
        let bend = self.bend(objective, jacobian, &straight, &pinned);
        let curved = bend.map(|bend| SHARES.map(|share| &straight * share + &bend * share.powi(2)));
        let steps = SHARES.map(|share| &straight * share).into_iter().chain(curved.into_iter().flatten());
        let points = steps.map(|step| self.point_along(parameters, &step)).collect();
        let best = self.at_points(objective, points).into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
        best.filter(|best| best.cost < self.cost).map(|best| (best, predicted))
    }

    /// The same fit at other points, without Jacobians; those where the simulation fails are left out.
    pub(super) fn at_points(&self, objective: &Objective, points: Vec<Vec<f64>>) -> Vec<FitPoint> {
        let residuals = objective.residuals(&points, LogSet::Learn);
        let fit = |(u, residual): (Vec<f64>, Result<ResidualVector, WorldError>)| {
            let residual = corrected(residual.ok()?, &self.step_error);
            let cost = cost(objective.parameters(), &self.active, &u, &residual);
            let (active, step_error) = (self.active.clone(), self.step_error.clone());
            Some(FitPoint { active, u, residual, cost, step_error, jacobian: None, fresh: false })
        };
        points.into_iter().zip(residuals).filter_map(fit).collect()
    }

    /// The fall of the cost with a step as predicted by the local model.
    fn predicted_fall(&self, parameters: &[FitParameter], jacobian: &DMatrix<f64>, step: &DVector<f64>) -> f64 {
        let prior = |(&k, by): (&usize, &f64)| (2.0 * self.u[k] * by + by * by) / parameters[k].prior_sd().powi(2);
        let change = jacobian * step;
        let priors: f64 = self.active.iter().zip(step.iter()).map(prior).sum();
        -(2.0 * change.dot(&DVector::from_column_slice(&self.residual)) + change.norm_squared() + priors)
    }

    /// The Gauss-Newton step within the bounds, and which parameters are pinned to a bound, with their steps.
    /// Parameters are pinned one by one, the one that exceeds its bound by most first, and the step of the others is
    /// solved again.
    fn bounded_step(&self, objective: &Objective, jacobian: &DMatrix<f64>) -> Option<(DVector<f64>, Vec<Option<f64>>)> {
        let parameters = objective.parameters();
        let normal = self.quadratic_model(objective, jacobian);
        let is_stair = |k: &usize| parameters[*k].is_searched();
        let mut pinned: Vec<Option<f64>> = self.active.iter().map(|k| is_stair(k).then_some(0.0)).collect();
        loop {
            let step = normal.step(0.0, &pinned)?;
            let beyond = |k: usize| {
                let (parameter, u) = (&parameters[self.active[k]], self.u[self.active[k]]);
                let bound = if step[k] < 0.0 { parameter.bounds.0 } else { parameter.bounds.1 };
                (((step[k] - (bound - u)) * step[k].signum()) / parameter.prior_sd(), bound - u)
            };
            let free = (0..pinned.len()).filter(|&k| pinned[k].is_none());
            let farthest = free.map(|k| (k, beyond(k))).max_by(|a, b| a.1.0.total_cmp(&b.1.0));
            match farthest {
                Some((k, (by, room))) if by > 0.0 => pinned[k] = Some(room),
                _ => return Some((step, pinned)),
            }
        }
    }

    /// The second-order correction of a step: along the corrected curve, the residual changes linearly. Pinned
    /// parameters stay where they are. `None` where the correction is too large.
    fn bend(
        &self,
        objective: &Objective,
        jacobian: &DMatrix<f64>,
        step: &DVector<f64>,
        pinned: &[Option<f64>],
    ) -> Option<DVector<f64>> {
        let parameters = objective.parameters();
        let residuals =
            objective.residuals(&AHEAD.map(|share| self.point_along(parameters, &(step * share))), LogSet::Learn);
        let [Ok(near), Ok(far)] = &residuals[..] else { return None };
        let (near_weight, far_weight, here_weight) = second_difference(AHEAD);
        let here = self.bare();
        let second = |row: usize| 0.5 * (near_weight * near[row] + far_weight * far[row] + here_weight * here[row]);
        let second = DVector::from_fn(here.len(), |row, _| second(row));
        let held: Vec<Option<f64>> = pinned.iter().map(|pinned| pinned.map(|_| 0.0)).collect();
        let gradient = jacobian.tr_mul(&second);
        let bend = QuadraticModel { gradient, ..self.quadratic_model(objective, jacobian) }.step(0.0, &held)?;
        (bend.norm() < BENT * step.norm()).then_some(bend)
    }
}

/// Weights of a second derivative from the values at two distances and at zero.
fn second_difference([near, far]: [f64; 2]) -> (f64, f64, f64) {
    let (near_weight, far_weight) = (2.0 / (near * (near - far)), 2.0 / (far * (far - near)));
    (near_weight, far_weight, -near_weight - far_weight)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::fit::{Intervals, SearchBudget, estimates};
    use crate::fixture::{SyntheticModel, parameter};
    use crate::residual_model::Parametrisation;

    const ROWS: usize = 200;
    /// True mass, gain and friction.
    const TRUTH: [f64; 3] = [2.0, 36.0, 0.4];

    /// A servo with friction, whose measurement depends only on gain over mass and friction over mass.
    fn servo() -> SyntheticModel {
        let of = |unit: &str, parameter: FitParameter| FitParameter { unit: unit.to_owned(), ..parameter };
        let factor =
            |origin| FitParameter { bounds: (-2.0, 2.0), ..parameter(Parametrisation::Exponential, origin, 0.3) };
        let friction = parameter(Parametrisation::Linear, 0.0, 0.1);
        let friction = FitParameter { bounds: (0.0, 30.0), spread: 33.0, amplitude: true, ..friction };
        let parameters = vec![of("kg", factor(2.0)), of("N.m/rad", factor(30.0)), of("N.m", friction)];
        SyntheticModel::new(parameters, ROWS, |values| {
            let noise = |row: usize| ((row * row) as f64 * 0.7).sin() * std::f64::consts::SQRT_2;
            (0..ROWS).map(|row| swing(&TRUTH, row) + noise(row) - swing(values, row)).collect()
        })
    }

    fn swing(values: &[f64], row: usize) -> f64 {
        let ([mass, kp, friction], t) = ([values[0], values[1], values[2]], row as f64 * 0.02);
        100.0 * ((kp / mass).sqrt() * t).sin() - 300.0 * (friction / mass) * (1.3 * t).cos()
    }

    /// A fit searched from a point along the common factor.
    fn downhill(objective: &Objective, factor: f64) -> FitPoint {
        let parameters = objective.parameters();
        let u = parameters.iter().zip(TRUTH).map(|(parameter, value)| parameter.coordinate(factor * value)).collect();
        let mut fit = FitPoint::at(objective, vec![0, 1, 2], u, &[]).unwrap();
        fit.solve(objective, SearchBudget::FULL);
        fit
    }

    #[test]
    fn an_undetermined_common_factor_settles_in_its_middle() {
        let servo = servo();
        let objective = Objective::new(&servo);
        let mut ends = Vec::new();
        for factor in [0.8, 1.0, 1.3] {
            let mut fit = downhill(&objective, factor);
            fit.settle(&objective);
            let estimates = estimates(&objective, &fit, 1.0, Intervals::Given);
            for ((_, estimate), truth) in estimates.iter().zip(TRUTH) {
                let [least, most] = estimate.ci95.unwrap();
                assert!(least < truth && truth < most, "{factor}: {estimate:?}");
                assert!(most > 1.2 * least, "the interval includes the undetermined factor: {estimate:?}");
            }
            ends.push(fit);
        }
        let least = ends.iter().map(|fit| fit.cost).fold(f64::INFINITY, f64::min);
        for fit in &ends {
            assert!(fit.cost - least < WORTH_A_STEP, "{} is not the middle, {least} is", fit.cost);
            assert!((fit.u[0] - ends[0].u[0]).abs() < 0.1, "{:?} and {:?}", fit.u, ends[0].u);
        }
    }

    #[test]
    fn parameters_are_pinned_one_by_one_and_the_others_adapt() {
        let mut servo = servo();
        // The middle lies beyond this bound of the gain: mass and friction follow it there.
        servo.parameters[1].bounds.1 = servo.parameters[1].coordinate(31.0);
        let objective = Objective::new(&servo);
        let mut fit = downhill(&objective, 0.7);
        fit.settle(&objective);
        assert!((fit.u[1] - servo.parameters[1].bounds.1).abs() < 1e-9, "{:?}", fit.u);
        let ratio = servo.parameters[1].value(fit.u[1]) / servo.parameters[0].value(fit.u[0]);
        assert!((ratio / 18.0 - 1.0).abs() < 0.01, "{ratio}");
        assert!(fit.squares() < 1.1 * ROWS as f64, "{}", fit.squares());
    }

    #[test]
    fn a_second_difference_is_exact_for_parabolas() {
        let (near, far, here) = second_difference(AHEAD);
        let parabola = |x: f64| 3.0 * x * x - x + 2.0;
        let second = near * parabola(AHEAD[0]) + far * parabola(AHEAD[1]) + here * parabola(0.0);
        assert!((second - 6.0).abs() < 1e-9, "{second}");
    }
}
