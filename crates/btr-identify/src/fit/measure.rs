//! Comparison of fits: Schwarz's information criterion, with the number of independent samples that the residual's
//! autocorrelation leaves.

use super::objective::{LogSet, Objective};
use super::residual_vector::{ResidualVector, channels, corrected, squares};
use super::solve::FitPoint;
use btr_core::signal::stats::autocorrelation_time;
use std::ops::Range;

/// The residual statistics of a comparison: taken from the best fit, and the same for all rivals.
#[derive(Clone, Debug, PartialEq)]
pub struct ComparisonMeasure {
    /// Variance of the residual, in multiples of the noise's; at least 1.
    variance: f64,
    /// Samples per independent sample: the integrated autocorrelation time.
    memory: f64,
    /// Number of samples.
    samples: f64,
    /// Where each channel is a question of its own: its rows, and its variance times its memory.
    channels: Vec<(Vec<Range<usize>>, f64)>,
}

impl ComparisonMeasure {
    /// Takes the statistics from the best fit, or the last.
    pub fn of(objective: &Objective, best: &FitPoint) -> Self {
        let samples = objective.samples(LogSet::Learn) as f64;
        let channels = if objective.description.is_decoupled { by_channel(objective, best) } else { Vec::new() };
        let variance = (best.squares() / samples).max(1.0);
        ComparisonMeasure { variance, memory: memory(objective, best), samples, channels }
    }

    /// The criterion B: lower is better. Differences above ten are decisive.
    pub fn criterion(&self, fit: &FitPoint) -> f64 {
        let of_channel = |(rows, inflation): &(Vec<Range<usize>>, f64)| {
            rows.iter().map(|rows| squares(&fit.residual[rows.clone()])).sum::<f64>() / inflation
        };
        let likelihood = match self.channels.as_slice() {
            [] => self.scaled(fit.squares()),
            channels => channels.iter().map(of_channel).sum(),
        };
        likelihood + fit.active.len() as f64 * (self.samples / self.memory).ln()
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
pub(crate) fn residual_without_step_error(objective: &Objective, u: &[f64], logs: LogSet) -> Option<ResidualVector> {
    let residual = objective.residual(u, logs).ok()?;
    if objective.description.is_chaotic {
        return Some(residual);
    }
    let error = objective.step_error(u, &residual, logs);
    let without = corrected(residual.clone(), &error);
    Some(if squares(&without) < squares(&residual) { without } else { residual })
}

/// For each channel its rows in all training logs, and the variance of the residual there, at least 1, times its
/// memory: what is missing in one must not count less because more is missing in another.
fn by_channel(objective: &Objective, fit: &FitPoint) -> Vec<(Vec<Range<usize>>, f64)> {
    let logs = || objective.logs(LogSet::Learn).iter().map(|&log| &objective.description.logs[log]);
    let mut names: Vec<&String> = logs().flat_map(|log| &log.channels).map(|channel| &channel.name).collect();
    names.sort();
    names.dedup();
    let of_channel = |name: &String| {
        let rows = objective.rows_near(LogSet::Learn, std::slice::from_ref(name));
        let samples: usize = rows.iter().map(Range::len).sum();
        let squared: Vec<f64> = rows.iter().map(|rows| squares(&fit.residual[rows.clone()])).collect();
        let whole: f64 = squared.iter().sum();
        let times = rows.iter().map(|rows| autocorrelation_time(&fit.residual[rows.clone()]));
        let weighted: f64 = times.zip(&squared).map(|(time, squares)| time * squares).sum();
        let memory = if whole > 0.0 { weighted / whole } else { 1.0 };
        (rows, (whole / samples.max(1) as f64).max(1.0) * memory)
    };
    names.into_iter().map(of_channel).collect()
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
