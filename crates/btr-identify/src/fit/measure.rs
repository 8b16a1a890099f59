//! Comparison of fits: Schwarz's information criterion, with the number of independent samples that the residual's
//! autocorrelation leaves.

use super::objective::{LogSet, Objective};
use super::residual_vector::{ResidualVector, channels, corrected, squares};
use super::solve::FitPoint;
use crate::residual_model::MeasuredChannel;
use btr_core::signal::stats::autocorrelation_time;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

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
        let stretches = stretches(objective, best);
        let channels = if objective.description.is_decoupled { by_channel(&stretches) } else { Vec::new() };
        let variance = (best.squares() / samples).max(1.0);
        ComparisonMeasure { variance, memory: memory(&stretches), samples, channels }
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

    /// How far a fit is behind another one, in units of B: negative where it is better.
    pub fn behind(&self, fit: &FitPoint, other: &FitPoint) -> f64 {
        self.criterion(fit) - self.criterion(other)
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
    held_out(objective, u).map(|residual| squares(&residual))
}

/// The same as a residual. Points are judged again and again, so the latest ones are kept.
pub(crate) fn held_out(objective: &Objective, u: &[f64]) -> Option<Arc<ResidualVector>> {
    objective.judged().get(u).or_else(|| {
        judge(objective, &[u]);
        objective.judged().get(u)
    })
}

/// Simulates the held-out logs at points at once, for what is asked of them next.
pub(crate) fn judge(objective: &Objective, points: &[&[f64]]) {
    let unknown: Vec<&[f64]> = points.iter().copied().filter(|u| objective.judged().get(u).is_none()).collect();
    let residuals = without_step_error(objective, &unknown, LogSet::HeldOut);
    objective.judged().keep(unknown.iter().zip(residuals).filter_map(|(u, residual)| Some((*u, residual?))));
}

/// The residuals at points, without the integrator's error where that makes them smaller; `None` where one cannot be
/// simulated.
pub(crate) fn without_step_error(
    objective: &Objective,
    points: &[&[f64]],
    logs: LogSet,
) -> Vec<Option<ResidualVector>> {
    let points: Vec<Vec<f64>> = points.iter().map(|u| u.to_vec()).collect();
    let residuals = objective.residuals(&points, logs).into_iter().map(Result::ok);
    if objective.description.is_chaotic {
        return residuals.collect();
    }
    let simulated: Vec<(Vec<f64>, Option<ResidualVector>)> = points.into_iter().zip(residuals).collect();
    let known = simulated.iter().filter(|(_, residual)| residual.is_some()).map(|(u, _)| u.clone());
    let mut halved = objective.all_halved(&known.collect::<Vec<_>>(), logs).into_iter();
    let smaller = |residual: ResidualVector, halved: Result<ResidualVector, _>| {
        let Ok(halved) = halved else { return residual };
        let without = corrected(residual.clone(), &objective.beyond(&residual, &halved));
        if squares(&without) < squares(&residual) { without } else { residual }
    };
    let each = simulated.into_iter().map(|(_, residual)| Some(smaller(residual?, halved.next()?)));
    each.collect()
}

/// A channel of a training log in the residual.
struct Stretch<'a> {
    channel: &'a str,
    rows: Range<usize>,
    squares: f64,
    /// How many samples its variance is of. Where each joint is a question of its own, those that are present: all
    /// torques of a joint that stands may be missing.
    samples: usize,
    /// Integrated autocorrelation time in samples.
    time: f64,
}

/// The channels of all training logs.
fn stretches<'a>(objective: &'a Objective, fit: &FitPoint) -> Vec<Stretch<'a>> {
    let logs = || objective.logs(LogSet::Learn).iter().map(|&log| &objective.description.logs[log]);
    let measured = logs().flat_map(|log| &log.channels);
    let named: Vec<(&MeasuredChannel, Range<usize>)> = measured.zip(channels(logs())).collect();
    let apart = objective.description.is_decoupled;
    let stretch = |(channel, rows): (&'a MeasuredChannel, Range<usize>)| {
        let series = &fit.residual[rows.clone()];
        let samples = if apart { channel.present } else { rows.len() };
        let (squares, time) = (squares(series), autocorrelation_time(series));
        Stretch { channel: &channel.name, squares, samples, time, rows }
    };
    named.into_par_iter().map(stretch).collect()
}

/// For each channel its rows in all training logs, and the variance of the residual there, at least 1, times its
/// memory: what is missing in one must not count less because more is missing in another.
fn by_channel(stretches: &[Stretch]) -> Vec<(Vec<Range<usize>>, f64)> {
    let mut names: Vec<&str> = stretches.iter().map(|stretch| stretch.channel).collect();
    names.sort_unstable();
    names.dedup();
    let of_channel = |name: &str| {
        let of_logs = || stretches.iter().filter(move |stretch| stretch.channel == name);
        let samples: usize = of_logs().map(|stretch| stretch.samples).sum();
        let whole: f64 = of_logs().map(|stretch| stretch.squares).sum();
        let rows = of_logs().map(|stretch| stretch.rows.clone()).collect();
        (rows, (whole / samples.max(1) as f64).max(1.0) * memory(of_logs()))
    };
    names.into_iter().map(of_channel).collect()
}

/// Integrated autocorrelation time of the residual in samples, averaged over channels by their squares; at least 1.
fn memory<'a>(stretches: impl IntoIterator<Item = &'a Stretch<'a>>) -> f64 {
    let (mut weighted, mut weight) = (0.0, 0.0);
    for stretch in stretches {
        weighted += stretch.squares * stretch.time;
        weight += stretch.squares;
    }
    if weight > 0.0 { weighted / weight } else { 1.0 }
}
