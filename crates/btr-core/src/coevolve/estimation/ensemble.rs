//! The points of an ensemble in S and the linear regression on them.

use super::metric::add_scaled;
use crate::search::UnitPoint;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A direction in which the members spread by no more than this has no slope.
const FLAT: f64 = 1e-12;
/// Samples per parallel job.
pub(super) const CHUNK: usize = 1024;

/// The points of an ensemble's members, and the matrices of a regression of their errors on these points.
pub(crate) struct Ensemble {
    /// Mean of the members.
    pub mean: DVector<f64>,
    /// The members' points, one per row.
    pub points: DMatrix<f64>,
    /// Weights of the members in the regression's slopes: one column per dimension of S.
    pub slopes: DMatrix<f64>,
    /// An orthonormal basis of the members' deviations from their mean.
    axes: DMatrix<f64>,
    /// Projection onto the regression's residuals.
    pub projection: DMatrix<f64>,
    /// Degrees of freedom of the residuals.
    pub freedom: f64,
}

impl Ensemble {
    /// Of points of the unit cube; `None` for fewer than three more than there are dimensions.
    pub(crate) fn of(members: &[UnitPoint]) -> Option<Self> {
        let dims = members.first()?.len();
        Self::at(DMatrix::from_fn(members.len(), dims, |i, k| members[i][k]))
    }

    /// Of points, one per row.
    pub(super) fn at(points: DMatrix<f64>) -> Option<Self> {
        let (count, dims) = points.shape();
        if count < dims + 3 {
            return None;
        }
        if dims == 0 {
            return Some(Self::constant(count));
        }
        let mean = points.row_mean().transpose();
        let mut deviations = points.clone();
        deviations.row_iter_mut().for_each(|mut point| point -= mean.transpose());
        let parts = deviations.svd(true, true);
        let (axes, across) = (parts.u?, parts.v_t?);
        let inverse = parts.singular_values.map(|width| if width > FLAT { 1.0 / width } else { 0.0 });
        let slopes = &axes * DMatrix::from_diagonal(&inverse) * across;
        let centring = DMatrix::identity(count, count).add_scalar(-1.0 / count as f64);
        let projection = centring - &axes * axes.transpose();
        Some(Ensemble { mean, points, slopes, axes, projection, freedom: (count - dims - 1) as f64 })
    }

    /// A regression on a constant alone: all differences between members are residuals.
    pub(super) fn constant(count: usize) -> Self {
        let none = DMatrix::zeros(count, 0);
        let projection = DMatrix::identity(count, count).add_scalar(-1.0 / count as f64);
        Ensemble {
            mean: DVector::zeros(0),
            points: none.clone(),
            slopes: none.clone(),
            axes: none,
            projection,
            freedom: count as f64 - 1.0,
        }
    }

    /// Weights of the members in the regression's prediction at a point.
    pub(crate) fn weights_at(&self, point: &DVector<f64>) -> DVector<f64> {
        let average = DVector::from_element(self.points.nrows(), 1.0 / self.points.nrows() as f64);
        average + &self.slopes * (point - &self.mean)
    }

    /// The residual variance of each sample; `rows` holds the errors of each member.
    pub(super) fn residual_variances(&self, rows: &[Vec<f64>]) -> Vec<f64> {
        let chunk = |from: usize, variances: &mut [f64]| {
            let (mut sum, mut squares) = (vec![0.0; variances.len()], vec![0.0; variances.len()]);
            let mut along = vec![vec![0.0; variances.len()]; self.axes.ncols()];
            for (i, row) in rows.iter().enumerate() {
                let errors = &row[from..from + variances.len()];
                add_scaled(&mut sum, errors, 1.0);
                squares.iter_mut().zip(errors).for_each(|(sum, error)| *sum += error * error);
                for (k, along) in along.iter_mut().enumerate() {
                    add_scaled(along, errors, self.axes[(i, k)]);
                }
            }
            for (k, variance) in variances.iter_mut().enumerate() {
                let explained: f64 = along.iter().map(|along| along[k].powi(2)).sum();
                let about_mean = squares[k] - sum[k].powi(2) / rows.len() as f64;
                *variance = (about_mean - explained).max(0.0) / self.freedom;
            }
        };
        let mut variances = vec![0.0; rows[0].len()];
        variances.par_chunks_mut(CHUNK).enumerate().for_each(|(n, variances)| chunk(n * CHUNK, variances));
        variances
    }
}
