//! Simulations of a larger S compared with an ensemble on one test.

use super::ensemble::Ensemble;
use super::errors::WhitenedErrors;
use super::metric::{NoiseMetric, add_scaled, dot};
use crate::optimize::Residuals;
use crate::search::UnitPoint;
use nalgebra::{DMatrix, DVector};

/// An ensemble on one test, with which further simulations are compared: see [`along`](ProbedTest::along).
pub(crate) struct ProbedTest {
    ensemble: Ensemble,
    weighted: WhitenedErrors,
    /// Members' combinations: the slopes, and where the regression has the point.
    here: DMatrix<f64>,
    /// The errors there.
    errors: Vec<f64>,
}

impl ProbedTest {
    /// Of members with their residuals, about a point of the cube.
    pub(crate) fn of(members: &[UnitPoint], residuals: &[Residuals], at: &DVector<f64>) -> Option<Self> {
        let ensemble = Ensemble::of(members)?;
        let weighted = WhitenedErrors::of(&ensemble, residuals)?;
        let here = ensemble.weights_at(at);
        let mut errors = vec![0.0; weighted.variances.len()];
        for (row, share) in weighted.rows.iter().zip(here.iter()) {
            add_scaled(&mut errors, row, *share);
        }
        let here = DMatrix::from_columns(&[here]);
        Some(ProbedTest { ensemble, weighted, here, errors })
    }

    fn noise(&self) -> NoiseMetric<'_> {
        NoiseMetric::of(&self.ensemble.projection, &self.weighted.gram, self.ensemble.freedom)
    }

    /// chi-squared at the point.
    pub(crate) fn chi2(&self) -> f64 {
        self.noise().product(&self.here, &self.here)[(0, 0)]
    }

    /// Expected curvature of half of chi-squared in S.
    pub(crate) fn information(&self) -> DMatrix<f64> {
        self.noise().product(&self.ensemble.slopes, &self.ensemble.slopes)
    }

    /// Slope of half of chi-squared in S at the point.
    pub(crate) fn gradient(&self) -> DVector<f64> {
        self.noise().product(&self.ensemble.slopes, &self.here).column(0).into_owned()
    }

    /// The change of the errors from the point to a simulation with these: its product with itself, with the errors at
    /// the point, and with the slopes of S. `None` where it cannot be compared.
    pub(crate) fn along(&self, residuals: &Residuals) -> Option<(f64, f64, DVector<f64>)> {
        let flat = residuals.concat();
        let WhitenedErrors { rows, samples, scale, variances, .. } = &self.weighted;
        let samples = samples.iter().zip(variances).zip(&self.errors);
        let change = samples.map(|((&k, variance), error)| scale * flat[k] / (1.0 + variance).sqrt() - error);
        let change: Vec<f64> = change.collect();
        let products = DVector::from_iterator(rows.len(), rows.iter().map(|row| dot(row, &change)));
        let noise = self.noise();
        let seen = &self.ensemble.projection * &products;
        let weighted = &noise.weight * &seen;
        let with = |combined: &DMatrix<f64>| {
            combined.transpose() * &products - (&noise.projected * combined).transpose() * &weighted
        };
        let own = dot(&change, &change) - seen.dot(&weighted);
        own.is_finite().then(|| (own, with(&self.here)[0], with(&self.ensemble.slopes)))
    }
}
