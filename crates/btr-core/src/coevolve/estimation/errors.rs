//! The errors of an ensemble on one real test.
//!
//! Errors have tens of thousands of samples, ensembles some tens of members: all that the rest of the estimate needs of
//! a test is the Gram matrix of its members' errors.

use super::ensemble::{CHUNK, Ensemble};
use super::metric::{NoiseMetric, add_scaled, dot};
use crate::optimize::Residuals;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Members' errors on one test, each sample divided by its noise and by its unpredictable part.
pub(crate) struct WhitenedErrors {
    /// One row per member.
    pub rows: Vec<Vec<f64>>,
    /// The samples of the residuals that are finite for all members.
    pub samples: Vec<usize>,
    /// Factor from residuals to multiples of the noise.
    pub scale: f64,
    /// Unpredictable variance of each sample, in multiples of the noise variance.
    pub variances: Vec<f64>,
    /// Inner products of the rows.
    pub gram: DMatrix<f64>,
}

impl WhitenedErrors {
    /// Of each member's residuals, whose squares add up to chi-squared per sample; `None` without any.
    pub(crate) fn of(ensemble: &Ensemble, residuals: &[Residuals]) -> Option<Self> {
        let flat: Vec<Vec<f64>> = residuals.iter().map(|blocks| blocks.concat()).collect();
        let length = flat.first()?.len();
        let samples: Vec<usize> = (0..length).filter(|&k| flat.iter().all(|errors| errors[k].is_finite())).collect();
        if samples.is_empty() {
            return None;
        }
        let scale = (flat[0].iter().filter(|error| !error.is_nan()).count() as f64).sqrt();
        let row = |errors: &Vec<f64>| samples.iter().map(|&k| scale * errors[k]).collect();
        let mut rows: Vec<Vec<f64>> = flat.iter().map(row).collect();
        let variances = ensemble.residual_variances(&rows);
        for row in &mut rows {
            row.iter_mut().zip(&variances).for_each(|(error, variance)| *error /= (1.0 + variance).sqrt());
        }
        let gram = gram_of(&rows);
        Some(WhitenedErrors { rows, samples, scale, variances, gram })
    }
}

/// What is kept of an ensemble's errors on one test.
pub(crate) struct EnsembleErrors {
    /// Inner products of the members' whitened errors.
    pub(super) gram: DMatrix<f64>,
    /// Covariance of the gradient by the sensors' noise alone.
    pub(super) gradient_noise: DMatrix<f64>,
    /// Effective number of samples; unpredictable ones count for less.
    pub(super) samples: f64,
    /// Root mean square of the unpredictable part, in multiples of the noise.
    unpredictable: f64,
    /// Sum of ln(1 + variance) over the samples: the likelihood's penalty for calling them unpredictable.
    pub(super) log_variances: f64,
}

impl EnsembleErrors {
    /// Of each member's residuals, whose squares add up to chi-squared per sample; `None` without any.
    pub(crate) fn of(ensemble: &Ensemble, residuals: &[Residuals]) -> Option<Self> {
        let WhitenedErrors { rows, variances, gram, .. } = WhitenedErrors::of(ensemble, residuals)?;
        let gradient_noise = gradient_noise(ensemble, &rows, &variances, &gram);
        let samples = variances.iter().map(|variance| 1.0 / (1.0 + variance)).sum();
        let unpredictable = (variances.iter().sum::<f64>() / variances.len() as f64).sqrt();
        let log_variances = variances.iter().map(|variance| variance.ln_1p()).sum();
        Some(EnsembleErrors { gram, gradient_noise, samples, unpredictable, log_variances })
    }

    /// Effective number of samples that were compared; unpredictable ones count for less.
    pub(crate) fn samples(&self) -> f64 {
        self.samples
    }

    /// Root mean square of the errors' spread that no point of S accounts for, in multiples of the noise.
    pub(crate) fn unpredictable(&self) -> f64 {
        self.unpredictable
    }
}

/// Covariance of the gradient of half chi-squared by the sensors' noise alone, whose variance is a share 1 / (1 +
/// variance) of the total one of each sample.
fn gradient_noise(ensemble: &Ensemble, rows: &[Vec<f64>], variances: &[f64], gram: &DMatrix<f64>) -> DMatrix<f64> {
    let metric = NoiseMetric::of(&ensemble.projection, gram, ensemble.freedom);
    let combined = &ensemble.slopes - &ensemble.projection * &metric.weight * &metric.projected * &ensemble.slopes;
    let dims = combined.ncols();
    let chunk = |(n, variances): (usize, &[f64])| {
        let columns = combined.column_iter().map(|shares| {
            let mut column = vec![0.0; variances.len()];
            let from = n * CHUNK;
            for (row, share) in rows.iter().zip(shares.iter()) {
                add_scaled(&mut column, &row[from..from + variances.len()], *share);
            }
            column.iter_mut().zip(variances).for_each(|(x, variance)| *x /= (1.0 + variance).sqrt());
            column
        });
        let columns: Vec<Vec<f64>> = columns.collect();
        DMatrix::from_fn(dims, dims, |i, j| dot(&columns[i], &columns[j]))
    };
    let chunks: Vec<DMatrix<f64>> = variances.par_chunks(CHUNK).enumerate().map(chunk).collect();
    chunks.iter().sum()
}

fn gram_of(rows: &[Vec<f64>]) -> DMatrix<f64> {
    let products = |i: usize| (0..=i).map(|j| dot(&rows[i], &rows[j])).collect();
    let half: Vec<Vec<f64>> = (0..rows.len()).into_par_iter().map(products).collect();
    DMatrix::from_fn(rows.len(), rows.len(), |i, j| half[i.max(j)][i.min(j)])
}
