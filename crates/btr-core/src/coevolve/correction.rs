//! The linear estimate of the fitness discrepancy between reality and a fixed simulation.
//!
//! A baseline after Hemker, Stelzer, von Stryk and Sakamoto's interleaving of simulated and real fitness, as the paper
//! describes it (section 2.1.1): f_r(c) ≈ f_s(c) + w·(1, c), fitted to all real tests.

use crate::search::UnitPoint;
use nalgebra::{DMatrix, DVector};

/// Weight of the penalty that keeps the estimate at zero away from the tests, in squared unit-cube lengths.
const RIDGE: f64 = 1e-2;

/// Coefficients of the correction: the constant first, then one per controller parameter on the unit cube.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LinearCorrection {
    weights: Vec<f64>,
}

impl LinearCorrection {
    /// Ridge regression of the gaps f_r − f_s on the controllers, given on the unit cube.
    pub(super) fn fit(gaps: &[(UnitPoint, f64)]) -> Self {
        let finite = gaps.iter().filter(|(_, gap)| gap.is_finite());
        let data: Vec<(Vec<f64>, f64)> = finite.map(|(unit, gap)| (features(unit), *gap)).collect();
        let Some(dims) = data.first().map(|(x, _)| x.len()) else { return LinearCorrection::default() };
        let x = DMatrix::from_fn(data.len(), dims, |i, j| data[i].0[j]);
        let y = DVector::from_iterator(data.len(), data.iter().map(|(_, gap)| *gap));
        let normal = x.tr_mul(&x) + DMatrix::identity(dims, dims) * RIDGE;
        let weights = normal.cholesky().map(|c| c.solve(&x.tr_mul(&y)).as_slice().to_vec()).unwrap_or_default();
        LinearCorrection { weights }
    }

    /// What to add to the simulated fitness of a controller on the unit cube.
    pub fn at(&self, unit: &[f64]) -> f64 {
        self.weights.iter().zip(features(unit)).map(|(w, x)| w * x).sum()
    }
}

fn features(unit: &[f64]) -> Vec<f64> {
    std::iter::once(1.0).chain(unit.iter().map(|u| u - 0.5)).collect()
}
