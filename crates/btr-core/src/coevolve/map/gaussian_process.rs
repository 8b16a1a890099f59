//! A Gaussian process over descriptors: by how much reality differs from the map.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Weight of the variance's prior, in tests.
const FREEDOM: f64 = 4.0;
/// Variance that is there without any noise, as a share of the process' own: two tests may be at one place.
const JITTER: f64 = 1e-9;

/// Differences with a mean of 0 and a Matérn 5/2 kernel. Their variance is not known either: it has the prior that is
/// conjugate to it, around what is expected before any test.
pub(super) struct GaussianProcess {
    length_scale: f64,
    noise: f64,
    at: Vec<Vec<f64>>,
    /// Cholesky factor of the tests' covariance, for a process of variance 1, and the solution for their differences.
    solved: Option<(Cholesky<f64, Dyn>, DVector<f64>)>,
    /// The process' standard deviation, in the unit of fitness.
    deviation: f64,
}

/// Settings of a Gaussian process.
#[derive(Clone, Copy)]
pub(super) struct KernelSettings {
    pub length_scale: f64,
    /// Standard deviation of a test's noise, as a share of the process'.
    pub noise: f64,
}

impl GaussianProcess {
    /// Learns differences, each with its descriptor, in [0, 1] per axis; `deviation` is how large they are expected to
    /// be before any of them is known, `noise` is that of a test as a share of the process' standard deviation.
    pub(super) fn new(settings: KernelSettings, deviation: f64, tests: &[(&[f64], f64)]) -> Self {
        let KernelSettings { length_scale, noise } = settings;
        let at: Vec<Vec<f64>> = tests.iter().map(|(descriptor, _)| descriptor.to_vec()).collect();
        let mut process = GaussianProcess { length_scale, noise, at, solved: None, deviation };
        let differences = DVector::from_iterator(tests.len(), tests.iter().map(|(_, difference)| *difference));
        let covariance = DMatrix::from_fn(tests.len(), tests.len(), |i, j| {
            process.kernel(&process.at[i], &process.at[j]) + if i == j { noise * noise + JITTER } else { 0.0 }
        });
        let Some(factor) = covariance.cholesky().filter(|_| !tests.is_empty()) else { return process };
        let weights = factor.solve(&differences);
        let (seen, n) = (differences.dot(&weights), tests.len() as f64);
        process.deviation = ((FREEDOM * deviation * deviation + seen) / (FREEDOM + n)).sqrt();
        process.solved = Some((factor, weights));
        process
    }

    /// The difference to expect at a descriptor and its standard deviation, in the unit of fitness.
    pub(super) fn at(&self, descriptor: &[f64]) -> (f64, f64) {
        let Some((factor, weights)) = &self.solved else { return (0.0, self.deviation) };
        let near = DVector::from_iterator(self.at.len(), self.at.iter().map(|at| self.kernel(at, descriptor)));
        let left = 1.0 - near.dot(&factor.solve(&near));
        (near.dot(weights), self.deviation * left.max(0.0).sqrt())
    }

    /// The standard deviation of a test: that of the process plus the test's own noise.
    pub(super) fn of_a_test(&self, deviation: f64) -> f64 {
        deviation.hypot(self.noise * self.deviation)
    }

    /// Number of values whose mean has the same Student's t: the variance itself is estimated.
    pub(super) fn numbers(&self) -> usize {
        FREEDOM as usize + self.at.len() + 1
    }

    /// Matérn 5/2 with variance 1.
    fn kernel(&self, x: &[f64], y: &[f64]) -> f64 {
        let square: f64 = x.iter().zip(y).map(|(x, y)| (x - y).powi(2)).sum();
        let far = (5.0 * square).sqrt() / self.length_scale;
        (1.0 + far + far * far / 3.0) * (-far).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_reproduces_its_tests_and_predicts_nothing_far_away() {
        let tests: [(&[f64], f64); 2] = [(&[0.2, 0.2], -1.0), (&[0.8, 0.2], 0.5)];
        let process = GaussianProcess::new(KernelSettings { length_scale: 0.1, noise: 0.0 }, 1.0, &tests);
        for (descriptor, difference) in tests {
            let (mean, deviation) = process.at(descriptor);
            assert!((mean - difference).abs() < 1e-6 && deviation < 1e-3, "{mean} ± {deviation}");
        }
        let (mean, deviation) = process.at(&[0.2, 20.0]);
        assert!(mean.abs() < 1e-9 && (deviation - process.deviation).abs() < 1e-9);
        // Predictions weaken with the distance.
        let (near, far) = (process.at(&[0.2, 0.25]), process.at(&[0.2, 0.35]));
        assert!(near.0 < far.0 && far.0 < 0.0 && near.1 < far.1, "{near:?} {far:?}");
    }

    #[test]
    fn its_variance_is_between_the_prior_and_the_observed_one() {
        let deviation_after = |difference: f64| {
            let at: Vec<Vec<f64>> = (0..20).map(|k| vec![100.0 * f64::from(k)]).collect();
            let tests: Vec<(&[f64], f64)> = at.iter().map(|at| (at.as_slice(), difference)).collect();
            GaussianProcess::new(KernelSettings { length_scale: 0.1, noise: 0.0 }, 1.0, &tests).deviation
        };
        assert!((deviation_after(1.0) - 1.0).abs() < 1e-6);
        assert!((deviation_after(3.0) - (184.0_f64 / 24.0).sqrt()).abs() < 1e-6);
        assert!(deviation_after(0.1) > 0.1 && deviation_after(0.1) < 0.5);
    }

    #[test]
    fn noise_keeps_it_from_trusting_a_single_test() {
        let tests: [(&[f64], f64); 1] = [(&[0.5], -1.0)];
        let process = GaussianProcess::new(KernelSettings { length_scale: 0.4, noise: 1.0 }, 1.0, &tests);
        let (mean, deviation) = process.at(&[0.5]);
        assert!((mean + 0.5).abs() < 1e-6 && process.of_a_test(deviation) > process.deviation);
        // The same place twice is no reason to fail.
        assert!(
            GaussianProcess::new(KernelSettings { length_scale: 0.4, noise: 0.0 }, 1.0, &[tests[0], tests[0]])
                .solved
                .is_some()
        );
    }
}
