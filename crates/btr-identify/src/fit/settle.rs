//! The last part of a fit: to the middle of what its logs leave open.

use super::objective::{LogSet, Objective};
use super::residual_vector::{ResidualVector, corrected};
use super::solve::{FitPoint, cost};
use crate::residual_model::FitParameter;
use btr_core::world::WorldError;
use nalgebra::{DMatrix, DVector};

/// Steps to the middle of what is left open, as long as each lowers the cost by this much, and which shares of each are tried.
const SETTLING: usize = 12;
const WORTH_A_STEP: f64 = 0.1;
const SHARES: [f64; 3] = [1.0, 0.5, 0.2];
/// The shares of a step after which its bend is looked at, and the most that it may bend.
const AHEAD: [f64; 2] = [0.1, 0.2];
const BENT: f64 = 0.75;
/// Slopes are renewed where less than this share of the promised fall came, ...
const KEPT: f64 = 0.5;
/// ... but so often at most.
const RENEWALS: usize = 2;

impl FitPoint {
    /// To the middle of what the logs leave open, with slopes as wide as that: a search for a lower error stops
    /// anywhere along a direction that hardly matters to it, an estimate must not. The way there is curved (a common
    /// factor of masses, gains and friction), so steps go in proportion and follow what is left of the curve:
    /// M. K. Transtrum and J. P. Sethna, "Improvements to the Levenberg-Marquardt algorithm for nonlinear least-squares
    /// minimization", arXiv:1201.5885.
    pub fn settle(&mut self, objective: &Objective) {
        self.differentiate_widely(objective);
        let mut renewals = 0;
        for _ in 0..SETTLING {
            let (fall, promised) = match self.settling_step(objective) {
                Some((to, promised)) => {
                    let (fall, jacobian) = (self.cost - to.cost, self.jacobian.take());
                    *self = FitPoint { jacobian, ..to };
                    (fall, promised)
                }
                None if self.fresh => return,
                None => (0.0, f64::INFINITY),
            };
            // Slopes that promised more than came are not those of here.
            if fall < KEPT * promised && promised > WORTH_A_STEP && renewals < RENEWALS {
                self.differentiate_widely(objective);
                renewals += 1;
            } else if fall < WORTH_A_STEP {
                return;
            }
        }
    }

    /// The best point on the way to where the local model is least, if it is better than here, and by how much the cost
    /// should fall on the way.
    fn settling_step(&self, objective: &Objective) -> Option<(FitPoint, f64)> {
        let (parameters, jacobian) = (objective.parameters(), self.jacobian.as_ref()?);
        let (straight, pinned) = self.bounded_step(parameters, jacobian)?;
        let promised = self.promised(parameters, jacobian, &straight);
        let bend = self.bend(objective, jacobian, &straight, &pinned);
        let curved = bend.map(|bend| SHARES.map(|share| &straight * share + &bend * share.powi(2)));
        let steps = SHARES.map(|share| &straight * share).into_iter().chain(curved.into_iter().flatten());
        let points = steps.map(|step| self.point_along(parameters, &step)).collect();
        let best = self.elsewhere(objective, points).into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
        best.filter(|best| best.cost < self.cost).map(|best| (best, promised))
    }

    /// The same fit at other points, without slopes; those where the simulation fails are left out.
    fn elsewhere(&self, objective: &Objective, points: Vec<Vec<f64>>) -> Vec<FitPoint> {
        let there = objective.residuals(&points, LogSet::Learn);
        let fit = |(u, residual): (Vec<f64>, Result<ResidualVector, WorldError>)| {
            let residual = corrected(residual.ok()?, &self.step_error);
            let cost = cost(objective.parameters(), &self.active, &u, &residual);
            let (active, step_error) = (self.active.clone(), self.step_error.clone());
            Some(FitPoint { active, u, residual, cost, step_error, jacobian: None, fresh: false })
        };
        points.into_iter().zip(there).filter_map(fit).collect()
    }

    /// By how much the local model's cost falls with a step.
    fn promised(&self, parameters: &[FitParameter], jacobian: &DMatrix<f64>, step: &DVector<f64>) -> f64 {
        let prior = |(&k, by): (&usize, &f64)| (2.0 * self.u[k] * by + by * by) / parameters[k].spread.powi(2);
        let change = jacobian * step;
        let priors: f64 = self.active.iter().zip(step.iter()).map(prior).sum();
        -(2.0 * change.dot(&DVector::from_column_slice(&self.residual)) + change.norm_squared() + priors)
    }

    /// Gauss and Newton's step where parameters that it would carry over a bound go as far as the bound, the one that would go
    /// farthest beyond first, and the others do what is best then; with those that do.
    fn bounded_step(
        &self,
        parameters: &[FitParameter],
        jacobian: &DMatrix<f64>,
    ) -> Option<(DVector<f64>, Vec<Option<f64>>)> {
        let gradient = self.gradient(parameters, jacobian);
        let mut pinned: Vec<Option<f64>> = vec![None; self.active.len()];
        loop {
            let step = self.solved(parameters, jacobian, 0.0, &pinned, gradient.clone())?;
            let beyond = |k: usize| {
                let (parameter, u) = (&parameters[self.active[k]], self.u[self.active[k]]);
                let bound = if step[k] < 0.0 { parameter.bounds.0 } else { parameter.bounds.1 };
                (((step[k] - (bound - u)) * step[k].signum()) / parameter.spread, bound - u)
            };
            let free = (0..pinned.len()).filter(|&k| pinned[k].is_none());
            let farthest = free.map(|k| (k, beyond(k))).max_by(|a, b| a.1.0.total_cmp(&b.1.0));
            match farthest {
                Some((k, (by, room))) if by > 0.0 => pinned[k] = Some(room),
                _ => return Some((step, pinned)),
            }
        }
    }

    /// By how much a step leaves the way on which the residual changes in proportion to it, the pinned parameters aside; none
    /// where it bends too much to be followed.
    fn bend(
        &self,
        objective: &Objective,
        jacobian: &DMatrix<f64>,
        step: &DVector<f64>,
        pinned: &[Option<f64>],
    ) -> Option<DVector<f64>> {
        let parameters = objective.parameters();
        let there =
            objective.residuals(&AHEAD.map(|share| self.point_along(parameters, &(step * share))), LogSet::Learn);
        let [Ok(near), Ok(far)] = &there[..] else { return None };
        let (near_weight, far_weight, here_weight) = second_difference(AHEAD);
        let here = self.bare();
        let second = |row: usize| 0.5 * (near_weight * near[row] + far_weight * far[row] + here_weight * here[row]);
        let second = DVector::from_fn(here.len(), |row, _| second(row));
        let held: Vec<Option<f64>> = pinned.iter().map(|pinned| pinned.map(|_| 0.0)).collect();
        let bend = self.solved(parameters, jacobian, 0.0, &held, jacobian.tr_mul(&second))?;
        (bend.norm() < BENT * step.norm()).then_some(bend)
    }
}

/// Weights of a second derivative from what is seen at two distances and here.
fn second_difference([near, far]: [f64; 2]) -> (f64, f64, f64) {
    let (near_weight, far_weight) = (2.0 / (near * (near - far)), 2.0 / (far * (far - near)));
    (near_weight, far_weight, -near_weight - far_weight)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::fit::{SearchBudget, estimates};
    use crate::fixture::{Made, parameter};
    use crate::residual_model::Parametrisation;

    const ROWS: usize = 200;
    /// What its mass, its gain and its friction are.
    const TRUTH: [f64; 3] = [2.0, 36.0, 0.4];

    /// A servo with friction: what is measured follows from gain over mass and from friction over mass alone.
    fn servo() -> Made {
        let of = |unit: &str, parameter: FitParameter| FitParameter { unit: unit.to_owned(), ..parameter };
        let factor =
            |origin| FitParameter { bounds: (-2.0, 2.0), ..parameter(Parametrisation::Exponential, origin, 0.3) };
        let friction = parameter(Parametrisation::Linear, 0.0, 0.1);
        let friction = FitParameter { bounds: (0.0, 30.0), spread: 33.0, amplitude: true, ..friction };
        let parameters = vec![of("kg", factor(2.0)), of("N.m/rad", factor(30.0)), of("N.m", friction)];
        Made::new(parameters, ROWS, |values| {
            let noise = |row: usize| ((row * row) as f64 * 0.7).sin() * std::f64::consts::SQRT_2;
            (0..ROWS).map(|row| swing(&TRUTH, row) + noise(row) - swing(values, row)).collect()
        })
    }

    fn swing(values: &[f64], row: usize) -> f64 {
        let ([mass, kp, friction], t) = ([values[0], values[1], values[2]], row as f64 * 0.02);
        100.0 * ((kp / mass).sqrt() * t).sin() - 300.0 * (friction / mass) * (1.3 * t).cos()
    }

    /// A fit that has gone downhill from somewhere along the factor.
    fn downhill(objective: &Objective, factor: f64) -> FitPoint {
        let parameters = objective.parameters();
        let u = parameters.iter().zip(TRUTH).map(|(parameter, value)| parameter.coordinate(factor * value)).collect();
        let mut fit = FitPoint::at(objective, vec![0, 1, 2], u, &[]).unwrap();
        fit.solve(objective, SearchBudget::FULL);
        fit
    }

    #[test]
    fn a_common_factor_that_is_not_told_is_found_in_its_middle() {
        let servo = servo();
        let objective = Objective::new(&servo);
        let mut ends = Vec::new();
        for factor in [0.8, 1.0, 1.3] {
            let mut fit = downhill(&objective, factor);
            fit.settle(&objective);
            let estimates = estimates(&objective, &fit, 1.0, true);
            for ((_, estimate), truth) in estimates.iter().zip(TRUTH) {
                let [least, most] = estimate.ci95.unwrap();
                assert!(least < truth && truth < most, "{factor}: {estimate:?}");
                assert!(most > 1.2 * least, "a factor that nothing tells leaves more open: {estimate:?}");
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
    fn knobs_go_to_their_bounds_one_by_one_and_the_others_make_the_best_of_it() {
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
