//! The inner product in which errors are compared: the sensors' noise plus the unpredictable part of an ensemble's
//! errors.

use nalgebra::DMatrix;

/// An inner product of combinations of members' errors, weighted by the inverse of 1 + the covariance of the
/// regression's residuals (Woodbury's identity; the noise is white and of size 1).
pub(crate) struct NoiseMetric<'a> {
    gram: &'a DMatrix<f64>,
    /// The regression's residual projection times the Gram matrix.
    pub projected: DMatrix<f64>,
    pub weight: DMatrix<f64>,
    /// Logarithm of the covariance's determinant.
    pub log_determinant: f64,
}

impl<'a> NoiseMetric<'a> {
    /// From a regression's residual projection, the members' Gram matrix and the regression's degrees of freedom.
    pub(crate) fn of(projection: &DMatrix<f64>, gram: &'a DMatrix<f64>, freedom: f64) -> Self {
        let projected = projection * gram;
        let count = gram.nrows();
        let inner = DMatrix::identity(count, count) * freedom + &projected * projection;
        // Positive definite by construction; where rounding breaks that, nothing is discounted.
        let Some(factor) = inner.cholesky() else {
            return NoiseMetric { gram, projected, weight: DMatrix::zeros(count, count), log_determinant: 0.0 };
        };
        let log_determinant = factor.l_dirty().diagonal().iter().map(|x| 2.0 * x.ln() - freedom.ln()).sum();
        NoiseMetric { gram, projected, weight: factor.inverse(), log_determinant }
    }

    /// Products of two sets of combinations, column by column.
    pub(crate) fn product(&self, a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
        let (projected_a, projected_b) = (&self.projected * a, &self.projected * b);
        a.transpose() * self.gram * b - projected_a.transpose() * &self.weight * projected_b
    }
}

/// Dot product as eight sums side by side: with a single sum every addition would wait for the one before.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let ((xs, x_rest), (ys, y_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    for (x, y) in xs.iter().zip(ys) {
        for lane in 0..8 {
            sums[lane] += x[lane] * y[lane];
        }
    }
    sums.iter().sum::<f64>() + x_rest.iter().zip(y_rest).map(|(x, y)| x * y).sum::<f64>()
}

/// Adds a multiple of `numbers` to `sums`.
pub(crate) fn add_scaled(sums: &mut [f64], numbers: &[f64], multiple: f64) {
    sums.iter_mut().zip(numbers).for_each(|(sum, number)| *sum += multiple * number);
}
