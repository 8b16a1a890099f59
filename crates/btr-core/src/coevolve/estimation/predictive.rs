//! Predictive checks: whether errors are at the noise, and whether they are as simulations predict of each other.

use super::ensemble::Ensemble;
use super::errors::EnsembleErrors;
use super::linearise::Prediction;

/// chi-squared per sample may exceed 1 by so many of its standard errors, and by [`ROUNDED`] for the rounding of
/// sensors' statements.
const STANDARD_ERRORS: f64 = 5.0;
const ROUNDED: f64 = 0.01;
/// Largest chi of a single test that counts as explained: many tests that are explained would hide one that is not. A
/// chaotic motion comes near it now and then, as its unpredictable part is not as normal as assumed.
const WORST: f64 = 1.1;

/// An ensemble and its errors on one test.
pub(in crate::coevolve) struct TestView {
    pub ensemble: Ensemble,
    pub errors: EnsembleErrors,
}

/// Sums over some tests.
struct Sums {
    chi2: f64,
    samples: f64,
    excess: f64,
}

impl Sums {
    fn of(tests: &[Prediction]) -> Self {
        let add = |sums: Sums, test: &Prediction| Sums {
            chi2: sums.chi2 + test.chi2,
            samples: sums.samples + test.samples,
            excess: sums.excess + test.excess,
        };
        tests.iter().fold(Sums { chi2: 0.0, samples: 0.0, excess: 0.0 }, add)
    }

    fn as_predicted(&self) -> bool {
        self.chi2 <= noise_alone(self.samples) + self.excess
    }
}

/// The largest chi-squared that noise alone leaves of so many samples.
fn noise_alone(samples: f64) -> f64 {
    samples * (1.0 + ROUNDED + STANDARD_ERRORS * (2.0 / samples).sqrt())
}

/// Whether chi-squared is what noise and the unpredictable part leave.
pub(super) fn explained(tests: &[Prediction]) -> bool {
    let sums = Sums::of(tests);
    sums.chi2 <= noise_alone(sums.samples) && tests.iter().all(|test| test.chi2 <= WORST.powi(2) * test.samples)
}

/// Whether each test, and all of them together, are as simulations predict of each other.
pub(super) fn as_predicted(tests: &[Prediction]) -> bool {
    !tests.is_empty()
        && (0..tests.len()).all(|k| Sums::of(&tests[k..=k]).as_predicted())
        && Sums::of(tests).as_predicted()
}

/// The check of tests before anything is learnt from them: all differences within the ensemble count as noise.
pub(in crate::coevolve) struct PriorPredictive {
    /// Root of chi-squared per sample.
    pub chi: f64,
    /// Whether that is what noise leaves.
    pub at_noise: bool,
    /// Whether it is as simulations predict of each other.
    pub as_predicted: bool,
}

impl PriorPredictive {
    /// Of an ensemble on some tests.
    pub(in crate::coevolve) fn of(views: &[Option<TestView>]) -> Self {
        let tests: Vec<Prediction> = views.iter().flatten().map(|view| Prediction::of_mean(&view.errors)).collect();
        let sums = Sums::of(&tests);
        PriorPredictive {
            chi: (sums.chi2 / sums.samples).sqrt(),
            at_noise: sums.chi2 <= noise_alone(sums.samples),
            as_predicted: as_predicted(&tests),
        }
    }
}
