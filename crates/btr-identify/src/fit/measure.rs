//! Comparison of fits: Schwarz's information criterion, with the number of independent samples that the residual's
//! autocorrelation leaves.

use super::objective::{LogSet, Objective};
use super::residual_vector::{ResidualVector, channels, corrected, squares};
use super::solve::FitPoint;
use btr_core::signal::stats::autocorrelation_time;

/// The residual statistics of a comparison: taken from the best fit, and the same for all rivals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComparisonMeasure {
    /// Variance of the residual, in multiples of the noise's; at least 1.
    variance: f64,
    /// Samples per independent sample: the integrated autocorrelation time.
    memory: f64,
    /// Number of samples.
    samples: f64,
}

impl ComparisonMeasure {
    /// Takes the statistics from the best fit, or the last.
    pub fn of(objective: &Objective, best: &FitPoint) -> Self {
        let samples = objective.samples(LogSet::Learn) as f64;
        ComparisonMeasure { variance: (best.squares() / samples).max(1.0), memory: memory(objective, best), samples }
    }

    /// The criterion B: lower is better. Differences above ten are decisive.
    pub fn criterion(&self, fit: &FitPoint) -> f64 {
        self.scaled(fit.squares()) + fit.active.len() as f64 * (self.samples / self.memory).ln()
    }

    /// What a sum of squares of such a residual contributes to B.
    pub fn scaled(&self, squares: f64) -> f64 {
        squares / self.inflation()
    }

    /// The factor of the covariance of estimates.
    pub(crate) fn inflation(&self) -> f64 {
        self.variance * self.memory
    }
}

/// Sum of squares at a point on the held-out logs, without the integrator's error as far as that is known; `None`
/// where they cannot be simulated there.
pub(crate) fn held_out_squares(objective: &Objective, u: &[f64]) -> Option<f64> {
    residual_without_step_error(objective, u, LogSet::HeldOut).map(|residual| squares(&residual))
}

/// The residual at a point, without the integrator's error where that makes it smaller; `None` where it cannot be
/// simulated.
pub(super) fn residual_without_step_error(objective: &Objective, u: &[f64], logs: LogSet) -> Option<ResidualVector> {
    let residual = objective.residual(u, logs).ok()?;
    if objective.description.is_chaotic {
        return Some(residual);
    }
    let error = objective.step_error(u, &residual, logs);
    let without = corrected(residual.clone(), &error);
    Some(if squares(&without) < squares(&residual) { without } else { residual })
}

/// Integrated autocorrelation time of the residual in samples, averaged over channels by their squares; at least 1.
fn memory(objective: &Objective, fit: &FitPoint) -> f64 {
    let logs = objective.logs(LogSet::Learn).iter().map(|&log| &objective.description.logs[log]);
    let (mut weighted, mut weight) = (0.0, 0.0);
    for rows in channels(logs) {
        let series = &fit.residual[rows];
        let squares = squares(series);
        weighted += squares * autocorrelation_time(series);
        weight += squares;
    }
    if weight > 0.0 { weighted / weight } else { 1.0 }
}
