//! The noise of a prescribed motion in what is estimated from it.
//!
//! Least squares make the inertias that a motion moves too small where its accelerations hold noise: noise is
//! acceleration that needs no torque (errors in variables). How much too small is found by giving the motion as much
//! noise again: J. R. Cook and L. A. Stefanski, "Simulation-Extrapolation Estimation in Parametric Measurement Error
//! Models", Institute of Statistics Mimeograph Series 2224, North Carolina State University, 1992.
//!
//! If that changes the residual by d, the noise that is there adds about d·d to the squares, more with each kilogram.
//! What remains of the squares without d·d is least at the true parameters. The fit moves to that point by one
//! Gauss-Newton step, as the torques that a motion requires are linear in masses, inertias and friction.

use crate::fit::derivative::columns;
use crate::fit::measure::held_out_squares;
use crate::fit::objective::{LogSet, Objective, blocks};
use crate::fit::residual_vector::chi;
use crate::fit::solve::FitPoint;
use crate::residual_model::{Derivation, FitParameter, Parametrisation};
use btr_core::optimize::QuadraticModel;
use nalgebra::{DMatrix, DVector};

/// How often the motion gets as much noise again.
const DRAWS: usize = 4;
/// Largest share of noise in what tells a combination of parameters. One that has more is not corrected.
const MOST: f64 = 0.5;
/// Largest rise of the cost, in rises that a linear model predicts, ...
const AS_PREDICTED: f64 = 2.0;
/// ... or where it is below this.
const NOTHING: f64 = 1.0;

impl FitPoint {
    /// The fit at the estimates that there would be without the noise of a prescribed motion, with the Jacobian of such
    /// a motion. `None` where nothing is corrected: other motions, or more than noise would be left.
    pub(crate) fn without_attenuation(&self, objective: &Objective) -> Option<FitPoint> {
        if !objective.description.is_decoupled || objective.is_stopped() || self.active.is_empty() {
            return None;
        }
        let (parameters, jacobian) = (objective.parameters(), self.jacobian.as_ref()?);
        let QuadraticModel { curvature, gradient } = self.quadratic_model(objective, jacobian);
        let noise = told_by_motion(&self.noise_of_motion(objective)?, &curvature)?;
        let corrected =
            QuadraticModel { curvature: &curvature - noise.curvature, gradient: &gradient - noise.gradient };
        let step = self.step_within_bounds(parameters, &corrected)?;
        let mut u = self.u.clone();
        for (&k, by) in self.active.iter().zip(step.iter()) {
            u[k] = parameters[k].clamp(after(&parameters[k], u[k], *by));
        }
        let moved = self.at_points(objective, vec![u]).pop()?;
        let predicted = 2.0 * gradient.dot(&step) + step.dot(&(&curvature * &step));
        let is_linear = moved.cost - self.cost <= (AS_PREDICTED * predicted).max(NOTHING);
        let (with_noise, without) = (curvature.cholesky()?.l(), corrected.curvature.cholesky()?.l());
        let factor = with_noise.tr_solve_lower_triangular(&without.transpose())?;
        let jacobian = Some(jacobian * factor);
        (is_linear && moved.leaves_noise(objective)).then_some(FitPoint { jacobian, ..moved })
    }

    /// Whether no more than noise is left, of training and of held-out logs.
    fn leaves_noise(&self, objective: &Objective) -> bool {
        let is_noise = |squares: f64, logs| chi(squares, objective.samples(logs).max(1)) <= objective.noise_bound();
        is_noise(self.squares(), LogSet::Learn)
            && held_out_squares(objective, &self.u).is_none_or(|squares| is_noise(squares, LogSet::HeldOut))
    }

    /// What the noise of the motion adds to the products of the Jacobian's columns, and to their products with the
    /// residual.
    fn noise_of_motion(&self, objective: &Objective) -> Option<QuadraticModel> {
        let here = columns(objective, &self.u, &self.active, &self.residual, &self.step_error);
        let (mut curvature, mut gradient) = (DMatrix::zeros(here.len(), here.len()), DVector::zeros(here.len()));
        for draw in 0..DRAWS {
            let of_draw = self.noise_of_draw(objective, &here, draw)?;
            curvature += of_draw.curvature / DRAWS as f64;
            gradient += of_draw.gradient / DRAWS as f64;
        }
        (!objective.model.is_cancelled()).then_some(QuadraticModel { curvature, gradient })
    }

    /// The same of one draw; `here` are the columns without it.
    fn noise_of_draw(&self, objective: &Objective, here: &[Vec<f64>], draw: usize) -> Option<QuadraticModel> {
        let noisier = objective.model.derive(&Derivation::WithNoisierMotion(draw))?;
        let noisier = objective.going_on(noisier.as_ref(), &self.u);
        let residual = noisier.residual(&self.u, LogSet::Learn).ok()?;
        let mut columns = columns(&noisier, &self.u, &self.active, &residual, &vec![0.0; residual.len()]);
        objective.count(&noisier);
        for (column, here) in columns.iter_mut().zip(here) {
            column.iter_mut().zip(here).for_each(|(noisier, here)| *noisier -= here);
        }
        let change: Vec<f64> = residual.iter().zip(self.bare()).map(|(noisier, here)| noisier - here).collect();
        let changes = self.jacobian_of(&columns);
        let curvature = objective.curvature(&changes, objective.logs(LogSet::Learn), &self.active);
        Some(QuadraticModel { curvature, gradient: blocks::gradient(&changes, &change) })
    }
}

/// The part of what noise adds that is less than `MOST` of the whole curvature along each of its directions.
fn told_by_motion(noise: &QuadraticModel, curvature: &DMatrix<f64>) -> Option<QuadraticModel> {
    let root = curvature.clone().cholesky()?.l();
    // Coordinates in which the whole curvature is one.
    let half = root.solve_lower_triangular(&noise.curvature)?;
    let shares = root.solve_lower_triangular(&half.transpose())?.symmetric_eigen();
    let mut directions = &root * &shares.eigenvectors;
    let mut along = shares.eigenvectors.tr_mul(&root.solve_lower_triangular(&noise.gradient)?);
    for (k, &share) in shares.eigenvalues.iter().enumerate() {
        let kept = share <= MOST;
        directions.column_mut(k).scale_mut(if kept { share.max(0.0).sqrt() } else { 0.0 });
        along[k] = if kept { along[k] } else { 0.0 };
    }
    let gradient = &root * shares.eigenvectors * along;
    Some(QuadraticModel { curvature: &directions * directions.transpose(), gradient })
}

/// A coordinate after a step in which the parameter's value is linear.
fn after(parameter: &FitParameter, u: f64, by: f64) -> f64 {
    match parameter.law {
        Parametrisation::Exponential => {
            let value = parameter.value(u) + parameter.slope(u) * by;
            // As far as a step in proportion where the value would end below zero.
            if value / parameter.value(u) > 0.0 { parameter.coordinate(value) } else { u + by }
        }
        _ => u + by,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::fit::SearchBudget;
    use crate::fixture::{SyntheticModel, parameter};
    use crate::residual_model::{ModelDescription, ResidualModel, ResidualRequest, TimeStep};
    use btr_core::random::stream;
    use btr_core::world::WorldError;
    use rand::RngExt;
    use std::sync::Arc;

    const ROWS: usize = 20_000;
    const TRUTH: [f64; 2] = [2.0, 0.7];

    /// Two inertias that noisy motions move, of which the torque is measured with noise of 1. The motions without noise
    /// have a root mean square of 1.
    struct Shaken {
        law: Parametrisation,
        /// Of each motion.
        noise: [f64; 2],
        /// Largest error that counts as noise, which that of the motion adds to.
        noise_bound: f64,
        motions: Vec<[f64; 2]>,
        torques: Arc<[f64]>,
    }

    fn normal(seed: u64) -> impl FnMut() -> f64 {
        let mut rng = stream(seed, &[7]);
        move || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
    }

    impl Shaken {
        fn new(law: Parametrisation, noise: [f64; 2]) -> Self {
            let mut of_torque = normal(1);
            let waves = |row: f64| [(0.31 * row).sin(), (0.17 * row).cos()].map(|x| x * 2.0_f64.sqrt());
            let motions: Vec<[f64; 2]> = (0..ROWS).map(|row| waves(row as f64)).collect();
            let torque = |motion: &[f64; 2]| motion[0] * TRUTH[0] + motion[1] * TRUTH[1] + of_torque();
            let torques = motions.iter().map(torque).collect();
            Shaken { law, noise, noise_bound: 2.6, motions, torques }.again(2)
        }

        fn again(&self, seed: u64) -> Self {
            let mut normal = normal(seed);
            let noisy = |motion: &[f64; 2]| [0, 1].map(|k| motion[k] + self.noise[k] * normal());
            Shaken { motions: self.motions.iter().map(noisy).collect(), torques: self.torques.clone(), ..*self }
        }

        /// The values by least squares, and those without the noise's part.
        fn estimates(&self) -> (Vec<f64>, Option<Vec<f64>>) {
            let objective = Objective::new(self);
            let mut fit = FitPoint::at(&objective, vec![0, 1], vec![0.0; 2], &[]).unwrap();
            fit.solve(&objective, SearchBudget::FULL);
            fit.settle(&objective);
            let values = |fit: &FitPoint| objective.parameters().iter().zip(&fit.u).map(|(p, u)| p.value(*u)).collect();
            (values(&fit), fit.without_attenuation(&objective).as_ref().map(values))
        }
    }

    impl ResidualModel for Shaken {
        fn description(&self) -> ModelDescription {
            let origin = if self.law == Parametrisation::Linear { 0.0 } else { 1.0 };
            let base = SyntheticModel::new(vec![parameter(self.law, origin, 1.0); 2], ROWS, |_| Vec::new());
            ModelDescription { is_decoupled: true, noise_bound: self.noise_bound, ..base.description() }
        }

        fn residuals(&self, requests: &[ResidualRequest], _: TimeStep) -> Vec<Result<Vec<f64>, WorldError>> {
            let parameters = self.description().parameters;
            let left = |u: &[f64]| {
                let [first, second] = [0, 1].map(|k| parameters[k].value(u[k]));
                let rows = self.motions.iter().zip(self.torques.iter());
                rows.map(|(motion, torque)| torque - motion[0] * first - motion[1] * second).collect()
            };
            requests.iter().map(|request| Ok(left(request.u))).collect()
        }

        fn derive(&self, derivation: &Derivation) -> Option<Box<dyn ResidualModel>> {
            let Derivation::WithNoisierMotion(draw) = derivation else { return None };
            Some(Box::new(self.again(10 + *draw as u64)))
        }
    }

    fn is_near(found: &[f64], expected: [f64; 2]) -> bool {
        found.iter().zip(expected).all(|(found, expected)| (found / expected - 1.0).abs() < 0.02)
    }

    #[test]
    fn estimates_are_those_of_a_motion_without_noise() {
        for law in [Parametrisation::Linear, Parametrisation::Exponential] {
            let (by_least_squares, corrected) = Shaken::new(law, [0.5, 0.1]).estimates();
            // The squares of the noise are added to those of the motion.
            assert!(is_near(&by_least_squares, [TRUTH[0] / 1.25, TRUTH[1] / 1.01]), "{by_least_squares:?}");
            assert!(is_near(corrected.as_ref().unwrap(), TRUTH), "{law:?}: {corrected:?}");
        }
    }

    /// The squares of what is more noise than motion say too little.
    #[test]
    fn what_noise_tells_more_than_motion_is_left_as_it_is_and_the_rest_is_corrected() {
        let (by_least_squares, corrected) = Shaken::new(Parametrisation::Linear, [1.2, 0.5]).estimates();
        let corrected = corrected.unwrap();
        assert!((corrected[0] / by_least_squares[0] - 1.0).abs() < 0.02, "{by_least_squares:?} {corrected:?}");
        assert!((corrected[1] / TRUTH[1] - 1.0).abs() < 0.04, "{corrected:?}");
    }

    /// The error at the corrected values is larger than that of least squares.
    #[test]
    fn nothing_is_corrected_where_more_than_noise_would_be_left() {
        let corrected_below = |noise_bound: f64| {
            let shaken = Shaken { noise_bound, ..Shaken::new(Parametrisation::Linear, [0.5, 0.1]) };
            shaken.estimates().1.is_some()
        };
        // The errors are 1.34 by least squares, and 1.42 at the true inertias.
        assert!(!corrected_below(1.38));
        assert!(corrected_below(1.5));
    }
}
