//! How well readings are predicted by their neighbours.

use crate::signal::noise::{NoiseEstimate, quantum};
use crate::signal::stats::{quantile, robust_std};

/// Deviation of the difference between a reading with white noise and its prediction by the two readings on each side,
/// whose weights are 2/3 and -1/6, in standard deviations of the noise.
const PREDICTION: f64 = 1.394;
/// Readings further apart than this many usual steps do not predict each other.
pub(super) const APART: f64 = 3.5;
/// Least standard deviation, as a share of the range of nine in ten readings.
const FINEST: f64 = 1e-5;
/// Share of the steps between two readings that are as small as the encoder's, ...
const SMALL: f64 = 0.05;
/// ... if there are more than these; otherwise the encoder is assumed to have 12 bits for a turn.
const FEW: usize = 4;

/// Standard deviation of the noise of `values` that glitches hardly change. [`NoiseEstimate`] takes blocks of samples,
/// and counts glitches as noise if there is one in most blocks; the median of single departures from predictions is the
/// alternative. It is no less than `resolution`, that of the readings' quantisation.
pub(super) fn deviation(clock_s: &[f64], values: &[f64], resolution: f64) -> Option<f64> {
    let by_blocks = NoiseEstimate::of(values)?.sigma();
    let departs = |i: usize| {
        let nodes = [i, i + 1, i + 3, i + 4].map(|k| (clock_s[k], values[k]));
        values[i + 2] - lagrange(clock_s[i + 2], &nodes)
    };
    let by_samples = robust_std((0..values.len().saturating_sub(4)).map(departs))? / PREDICTION;
    Some(by_samples.min(by_blocks).max(resolution))
}

/// Standard deviation of the readings' quantisation: the encoder's step is among the smallest between two readings.
pub(super) fn resolution(readings: &[f64]) -> Option<f64> {
    let least = FINEST * range(readings)?;
    let steps: Vec<f64> =
        readings.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > least).collect();
    let assumed = std::f64::consts::TAU / 4096.0;
    let step = if steps.len() > FEW { quantile(steps, SMALL)? } else { assumed };
    Some(least.max(step / 12.0_f64.sqrt()))
}

/// The same for errors beside a simulation: there the motion's own steps do not count, and only a step that all
/// readings are multiples of is the encoder's.
pub(super) fn quantisation(readings: &[f64]) -> Option<f64> {
    let present = readings.iter().copied().filter(|x| x.is_finite());
    Some((FINEST * range(readings)?).max(quantum(present.collect()).unwrap_or(0.0) / 12.0_f64.sqrt()))
}

/// The range of nine in ten readings.
pub(super) fn range(readings: &[f64]) -> Option<f64> {
    let present = || readings.iter().copied().filter(|x| x.is_finite()).collect();
    Some(quantile(present(), 0.95)? - quantile(present(), 0.05)?)
}

/// The polynomial through points of increasing time, at another time (J.-L. Lagrange).
pub(super) fn lagrange(at: f64, points: &[(f64, f64)]) -> f64 {
    let weight = |k: usize| {
        let others = points.iter().enumerate().filter(|(other, _)| *other != k);
        others.map(|(_, (t, _))| (at - t) / (points[k].0 - t)).product::<f64>()
    };
    points.iter().enumerate().map(|(k, (_, x))| weight(k) * x).sum()
}

/// Whether a series with noise of this standard deviation is so finely resolved that it is not exactly zero, nor
/// the same twice, by chance.
pub(super) fn is_fine(readings: &[f64], sigma: f64) -> bool {
    /// Largest step of the readings, in standard deviations.
    const STEP: f64 = 0.03;
    quantum(readings.iter().copied().filter(|x| x.is_finite()).collect()).is_none_or(|step| step < STEP * sigma)
}

/// Whether two readings are the same, bit by bit.
pub(super) fn is_same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits()
}

pub(super) fn median_step_s(clock_s: &[f64]) -> Option<f64> {
    quantile(clock_s.windows(2).map(|pair| pair[1] - pair[0]).collect(), 0.5)
}

/// Most samples of a glitch on a clock of this step.
pub(super) fn longest(step_s: f64) -> usize {
    /// In s, and in samples of a slow log.
    const LONGEST: (f64, usize) = (0.05, 3);
    ((LONGEST.0 / step_s).round() as usize).max(LONGEST.1)
}
