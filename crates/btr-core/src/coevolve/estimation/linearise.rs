//! The information of a real test about S, by statistical linearisation.
//!
//! Simulations drawn from a belief run on a test, and their errors, in multiples of the noise, are regressed on their
//! points in S. The slopes give the test's information. The regression's residuals are the part of the motion that the
//! belief's width makes unpredictable: a foot that lands earlier, a walk that grows chaotic, curvature. They count as
//! further noise, sample by sample and with the correlation that the ensemble shows, so that a chaotic test teaches
//! with its beginning while the belief is wide, and with more and more of it as the belief narrows. Linearising a
//! likelihood about the posterior itself, again and again, is the approach of D. M. Steinberg and E. V. Bonilla,
//! "Extended and Unscented Gaussian Processes" (NeurIPS 2014); the unpredictable part is btr's.
//!
//! Whether a test is explained is a posterior predictive check: simulations that took no part in a regression take the
//! robot's place (A. Gelman, X.-L. Meng, H. Stern, "Posterior predictive assessment of model fitness via realized
//! discrepancies", Statistica Sinica 6, 1996).

use super::ensemble::Ensemble;
use super::errors::EnsembleErrors;
use super::metric::NoiseMetric;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Folds of the cross-validation of an ensemble's regression.
const FOLDS: usize = 8;
/// The quantile of the left-out simulations' excess up to which a robot's errors count as explained.
const PREDICTED: f64 = 0.9;

/// The information of one test about S, linearised at the ensemble's mean.
pub(crate) struct TestInformation {
    /// Expected curvature of half its chi-squared.
    pub information: DMatrix<f64>,
    /// Slope of half its chi-squared at the ensemble's mean.
    pub gradient: DVector<f64>,
    /// Covariance of the gradient's error beyond what `information` accounts for.
    pub excess: DMatrix<f64>,
}

impl TestInformation {
    pub(crate) fn of(ensemble: &Ensemble, errors: &EnsembleErrors) -> Self {
        let count = errors.gram.nrows();
        let metric = NoiseMetric::of(&ensemble.projection, &errors.gram, ensemble.freedom);
        let average = DVector::from_element(count, 1.0 / count as f64);
        let information = metric.product(&ensemble.slopes, &ensemble.slopes);
        let gradient = metric.product(&ensemble.slopes, &DMatrix::from_columns(&[average])).column(0).into_owned();
        // The weights count the unpredictable part as noise already.
        let excess = unpredicted_covariance(ensemble, errors).map_or_else(
            || DMatrix::zeros(gradient.len(), gradient.len()),
            |covariance| covariance + &errors.gradient_noise - &information,
        );
        TestInformation { information, gradient, excess }
    }
}

/// A regression's prediction of a test at one point of S.
pub(crate) struct Prediction {
    /// chi-squared, with the unpredictable part counted as noise.
    pub chi2: f64,
    /// Effective number of samples of `chi2`.
    pub samples: f64,
    /// The [`PREDICTED`] quantile of how much chi-squared of a left-out member exceeds what noise leaves: the
    /// unpredictable part is not as normal as assumed, and has more directions than there are members.
    pub excess: f64,
    /// Minus twice the logarithm of the likelihood, less a constant. Calling more of the motion unpredictable lowers
    /// chi-squared but does not raise the likelihood.
    pub deviance: f64,
}

impl Prediction {
    pub(crate) fn at(ensemble: &Ensemble, errors: &EnsembleErrors, point: &DVector<f64>) -> Self {
        let metric = NoiseMetric::of(&ensemble.projection, &errors.gram, ensemble.freedom);
        let combined = DMatrix::from_columns(&[ensemble.weights_at(point)]);
        let chi2 = metric.product(&combined, &combined)[(0, 0)];
        let deviance = chi2 + errors.log_variances + metric.log_determinant;
        let mut excesses: Vec<f64> = left_out(ensemble, errors).iter().flat_map(LeftOut::excesses).collect();
        excesses.sort_by(f64::total_cmp);
        let last = excesses.len().saturating_sub(1) as f64;
        let excess = excesses.get((PREDICTED * last) as usize).copied().unwrap_or(0.0);
        Prediction { chi2, samples: errors.samples, excess, deviance }
    }

    /// The ensemble's mean as the prediction, with all differences between members counted as noise.
    pub(crate) fn of_mean(errors: &EnsembleErrors) -> Self {
        Self::at(&Ensemble::constant(errors.gram.nrows()), errors, &DVector::zeros(0))
    }
}

/// Mean outer product of the gradients that left-out members cause by what no slope predicts. `None` for an ensemble
/// with too few members to leave some out.
fn unpredicted_covariance(ensemble: &Ensemble, errors: &EnsembleErrors) -> Option<DMatrix<f64>> {
    let gradients: Vec<DMatrix<f64>> = left_out(ensemble, errors).iter().map(LeftOut::gradients).collect();
    let count: usize = gradients.iter().map(DMatrix::ncols).sum();
    (count > 0).then(|| gradients.iter().map(|columns| columns * columns.transpose() / count as f64).sum())
}

/// Cross-validation: every member once with a regression that it took no part in. Empty for an ensemble with too few
/// members.
fn left_out(ensemble: &Ensemble, errors: &EnsembleErrors) -> Vec<LeftOut> {
    // Draws come in pairs about the mean, which stay together.
    let of_fold = |fold: usize| (0..ensemble.points.nrows()).partition(|i| i / 2 % FOLDS != fold);
    let folds: Vec<(Vec<usize>, Vec<usize>)> = (0..FOLDS).map(of_fold).collect();
    folds.par_iter().filter_map(|(training, test)| LeftOut::of(ensemble, errors, training, test)).collect()
}

/// Members that took no part in a regression: they take the robot's place.
struct LeftOut {
    regression: Ensemble,
    /// Inner products of the members that took part.
    gram: DMatrix<f64>,
    /// Inner products of each left-out member's prediction error (column) with the members that took part.
    products: DMatrix<f64>,
    /// Squared length of each left-out member's prediction error.
    squares: Vec<f64>,
}

impl LeftOut {
    fn of(ensemble: &Ensemble, errors: &EnsembleErrors, training: &[usize], test: &[usize]) -> Option<Self> {
        let regression = Ensemble::at(ensemble.points.select_rows(training))?;
        let with_training = errors.gram.select_rows(training);
        let gram = with_training.select_columns(training);
        let mut squares = Vec::with_capacity(test.len());
        let prediction_error = |&k: &usize| {
            let shares = regression.weights_at(&ensemble.points.row(k).transpose());
            let products = with_training.column(k) - &gram * &shares;
            squares.push(errors.gram[(k, k)] - shares.dot(&with_training.column(k)) - shares.dot(&products));
            products
        };
        let products = DMatrix::from_columns(&test.iter().map(prediction_error).collect::<Vec<_>>());
        Some(LeftOut { regression, gram, products, squares })
    }

    fn metric(&self) -> NoiseMetric<'_> {
        NoiseMetric::of(&self.regression.projection, &self.gram, self.regression.freedom)
    }

    /// The gradients, one per column, if each member were the robot and stood where the regression expects it.
    fn gradients(&self) -> DMatrix<f64> {
        let (metric, regression) = (self.metric(), &self.regression);
        let projected = &metric.weight * (&regression.projection * &self.products);
        regression.slopes.transpose() * &self.products
            - (&metric.projected * &regression.slopes).transpose() * projected
    }

    /// chi-squared of each member without any noise, if it were the robot and stood where the regression expects it.
    fn excesses(&self) -> Vec<f64> {
        let projected = &self.regression.projection * &self.products;
        let weighted = &self.metric().weight * &projected;
        let excess = |(k, square): (usize, &f64)| square - projected.column(k).dot(&weighted.column(k));
        self.squares.iter().enumerate().map(excess).collect()
    }
}
