//! One run of CMA-ES, from its start to its convergence.
//!
//! N. Hansen, "The CMA evolution strategy: a tutorial", arXiv:1604.00772; equation numbers are the tutorial's. The
//! covariance update is active: bad steps shrink the variance along their direction.

use super::stop::{CmaStop, CostHistory};
use super::weights::Weights;
use crate::random::{Rng, normal};
use crate::search::UnitPoint;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};

/// A distribution N(mean, sigma²·C) over unbounded points, and its memory.
///
/// **Bounds.** The unbounded axis is folded onto [0, 1] like a strip of paper (... 0 -> 1 -> 0 -> 1 ...). Compared with
/// repairing points and adding a penalty, every cost stays a true cost (nothing to weigh against it, infinite costs do
/// no harm), no point is drawn twice as resampling would, and an optimum on the bound becomes an ordinary optimum with
/// descent from both sides. pycma folds in the same way, except that it also rounds the crease.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Distribution {
    lambda: usize,
    generation: u32,
    mean: DVector<f64>,
    sigma: f64,
    covariance: DMatrix<f64>,
    /// Eigenvectors of the covariance, in columns.
    axes: DMatrix<f64>,
    /// Square roots of its eigenvalues.
    lengths: DVector<f64>,
    path_sigma: DVector<f64>,
    path_c: DVector<f64>,
    /// The steps y of the last proposed population, in units of sigma.
    steps: Vec<DVector<f64>>,
    history: CostHistory,
}

impl Distribution {
    /// A round distribution about `mean`; needs at least one dimension.
    pub(super) fn new(mean: UnitPoint, sigma: f64, lambda: usize) -> Self {
        let n = mean.len();
        Distribution {
            lambda: lambda.max(2),
            generation: 0,
            mean: DVector::from_vec(mean),
            sigma,
            covariance: DMatrix::identity(n, n),
            axes: DMatrix::identity(n, n),
            lengths: DVector::from_element(n, 1.0),
            path_sigma: DVector::zeros(n),
            path_c: DVector::zeros(n),
            steps: Vec::new(),
            history: CostHistory::default(),
        }
    }

    /// Whether it is a distribution over points in `n` dimensions, for populations of `lambda`. What is not drawn from
    /// may be no number: that ends the run.
    pub(super) fn is_of(&self, n: usize, lambda: usize) -> bool {
        let finite = |x: &f64| x.is_finite();
        let drawn = [&self.mean, &self.lengths].into_iter().chain(&self.steps);
        let paths = [&self.path_sigma, &self.path_c];
        self.lambda == lambda
            && self.sigma.is_finite()
            && drawn.into_iter().all(|vector| vector.len() == n && vector.iter().all(finite))
            && paths.into_iter().all(|path| path.len() == n)
            && [&self.axes, &self.covariance].into_iter().all(|matrix| matrix.shape() == (n, n))
            && self.axes.iter().all(finite)
    }

    /// Draws a population (eqs. 38-40), folded into the cube.
    pub(super) fn ask(&mut self, rng: &mut Rng) -> Vec<UnitPoint> {
        let n = self.mean.len();
        self.steps.clear();
        for _ in 0..self.lambda {
            let z = DVector::from_fn(n, |_, _| normal(rng));
            self.steps.push(&self.axes * z.component_mul(&self.lengths));
        }
        self.steps.iter().map(|y| (&self.mean + y * self.sigma).iter().map(|x| fold(*x)).collect()).collect()
    }

    /// Learns from the costs of the last proposed population. Nothing is learnt when there is none, when the costs are
    /// of another one, or when everything failed.
    pub(super) fn tell(&mut self, costs: &[f64]) {
        if costs.len() != self.steps.len() || costs.is_empty() {
            return;
        }
        let steps = std::mem::take(&mut self.steps);
        let cost = |i: usize| if costs[i].is_nan() { f64::INFINITY } else { costs[i] };
        let mut ranked: Vec<usize> = (0..costs.len()).collect();
        ranked.sort_by(|&a, &b| cost(a).total_cmp(&cost(b)));
        self.generation = self.generation.saturating_add(1);
        self.history.see(cost(ranked[0]));
        if cost(ranked[0]) == f64::INFINITY {
            return;
        }
        let weights = Weights::new(self.mean.len(), self.lambda);
        // A failure that ranks among the good for want of better ones pulls the mean nowhere.
        let succeeded = ranked.iter().take_while(|&&i| cost(i) < f64::INFINITY).count();
        let ranked: Vec<&DVector<f64>> = ranked.iter().map(|&i| &steps[i]).collect();
        self.learn(&weights, &ranked, succeeded.min(weights.mu));
    }

    /// Eqs. 41-47. The `good` first steps pull, those with negative weights push.
    fn learn(&mut self, k: &Weights, ranked: &[&DVector<f64>], good: usize) {
        let n = self.mean.len() as f64;
        let mut step = DVector::zeros(self.mean.len());
        for (w, y) in k.w.iter().zip(&ranked[..good]) {
            step.axpy(*w, y, 1.0);
        }
        self.mean.axpy(self.sigma, &step, 1.0);

        let whitened = &self.axes * self.whiten(&step);
        self.path_sigma =
            &self.path_sigma * (1.0 - k.c_sigma) + whitened * (k.c_sigma * (2.0 - k.c_sigma) * k.mu_eff).sqrt();
        let length = self.path_sigma.norm();
        let warm_up = (1.0 - (1.0 - k.c_sigma).powi(2).powf(f64::from(self.generation))).sqrt();
        let h_sigma = if length / warm_up < (1.4 + 2.0 / (n + 1.0)) * k.chi_n { 1.0 } else { 0.0 };
        self.path_c = &self.path_c * (1.0 - k.c_c) + step * (h_sigma * (k.c_c * (2.0 - k.c_c) * k.mu_eff).sqrt());

        self.learn_covariance(k, ranked, good, h_sigma);
        self.sigma *= ((k.c_sigma / k.d_sigma) * (length / k.chi_n - 1.0)).min(1.0).exp();
        // In a folded cube a step longer than its edge is as good as any other.
        self.sigma = self.sigma.min(1.0 / self.lengths.max());
    }

    /// Eq. 47: rank-one update along the path, rank-mu update along the steps.
    fn learn_covariance(&mut self, k: &Weights, ranked: &[&DVector<f64>], good: usize, h_sigma: f64) {
        let n = self.mean.len() as f64;
        let mut used = 0.0;
        let mut update = &self.path_c * self.path_c.transpose() * k.c_1;
        for (rank, (&w, y)) in k.w.iter().zip(ranked).enumerate() {
            if rank >= good && w >= 0.0 {
                continue;
            }
            used += w;
            let w = if w < 0.0 { w * n / self.whiten(y).norm_squared().max(f64::MIN_POSITIVE) } else { w };
            update.ger(k.c_mu * w, y, y, 1.0);
        }
        let stall = (1.0 - h_sigma) * k.c_c * (2.0 - k.c_c);
        let keep = 1.0 + k.c_1 * stall - k.c_1 - k.c_mu * used;
        self.covariance = &self.covariance * keep + update;
        self.decompose();
    }

    /// C = B·D²·Bᵀ. Rounding may leave eigenvalues at or below zero; they are kept a little above it. A matrix that
    /// does not decompose keeps the old axes, and [`Distribution::ended`] ends the run.
    fn decompose(&mut self) {
        let symmetric = (&self.covariance + self.covariance.transpose()) * 0.5;
        match SymmetricEigen::try_new(symmetric.clone(), f64::EPSILON, 1000) {
            Some(eigen) if eigen.eigenvalues.iter().all(|v| v.is_finite()) => {
                let least = eigen.eigenvalues.max() * 1e-16;
                self.lengths = eigen.eigenvalues.map(|v| v.max(least).sqrt());
                self.axes = eigen.eigenvectors;
                self.covariance = symmetric;
            }
            _ => self.lengths.fill(0.0),
        }
    }

    /// D⁻¹·Bᵀ·y.
    fn whiten(&self, y: &DVector<f64>) -> DVector<f64> {
        self.axes.tr_mul(y).component_div(&self.lengths)
    }

    /// Why the run has nothing more to find: its steps are too small to matter, its axes too unlike to compute with, or
    /// its costs have stopped moving.
    pub(super) fn ended(&self) -> Option<CmaStop> {
        const SMALLEST_STEP: f64 = 1e-11;
        const WORST_AXIS_RATIO: f64 = 1e7;
        let (longest, shortest) = (self.lengths.max(), self.lengths.min());
        // Written so that numbers which are none end the run.
        let moves = self.sigma * longest > SMALLEST_STEP;
        let even = longest < WORST_AXIS_RATIO * shortest;
        match (moves, even) {
            (false, _) => Some(CmaStop::SmallSteps),
            (true, false) => Some(CmaStop::UnlikeAxes),
            (true, true) => self.history.ended(self.mean.len(), self.lambda),
        }
    }

    /// The mean, folded into the cube, and the standard deviation along each dimension.
    pub(super) fn distribution(&self) -> (UnitPoint, Vec<f64>) {
        let mean = self.mean.iter().map(|x| fold(*x)).collect();
        let variances = self.covariance.diagonal();
        (mean, variances.iter().map(|variance| self.sigma * variance.max(0.0).sqrt()).collect())
    }
}

/// Folds the real axis onto [0, 1].
fn fold(x: f64) -> f64 {
    let x = x.rem_euclid(2.0);
    if x > 1.0 { 2.0 - x } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn folding_is_continuous_and_keeps_the_cube(x in -5.0..5.0f64, step in 0.0..0.1f64) {
            prop_assert!((0.0..=1.0).contains(&fold(x)));
            prop_assert!((fold(x) - fold(x + step)).abs() <= step + 1e-12);
            if (0.0..=1.0).contains(&x) {
                prop_assert_eq!(fold(x).to_bits(), x.to_bits());
            }
        }
    }
}
