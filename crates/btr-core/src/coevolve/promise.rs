//! Prediction intervals of a controller's real fitness, and the reality gap.

use super::ledger::{Entry, Ledger};
use crate::signal::stats;
use crate::signal::student::student_95;
use serde::{Deserialize, Serialize};

/// Number of draws from the posterior. The next draw lies between the least and the greatest of n with probability
/// (n − 1)/(n + 1), here 95 %, whatever the distribution is.
pub(crate) const DRAWS: usize = 39;

/// A 95 % prediction interval of a controller's fitness, from its fitness in [`DRAWS`] simulations of the posterior;
/// `None` where one of them failed.
pub(crate) fn interval(draws: &[f64]) -> Option<[f64; 2]> {
    let known = draws.iter().all(|fitness| fitness.is_finite()) && !draws.is_empty();
    let least = draws.iter().copied().fold(f64::INFINITY, f64::min);
    let most = draws.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    known.then_some([least, most])
}

/// The reality gap: real fitness minus predicted fitness, over the real tests of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RealityGap {
    /// Mean over the tests, in the unit of fitness; below zero where reality falls short.
    pub mean: f64,
    /// 95 % interval of that mean (Student's t); `None` for fewer than three tests.
    pub ci95: Option<[f64; 2]>,
    /// Number of tests with a prediction and a fitness.
    pub tests: usize,
    /// Number of tests whose fitness lies in the predicted interval, and number of tests with an interval.
    pub within: [usize; 2],
}

impl RealityGap {
    /// Over a ledger; `None` where no test had a prediction.
    pub fn of(ledger: &Ledger) -> Option<Self> {
        let gap = |entry: &Entry| Some(entry.fitness()? - entry.promised?);
        let gaps: Vec<f64> = ledger.entries().iter().filter_map(gap).filter(|gap| gap.is_finite()).collect();
        let with_interval = |entry: &Entry| Some((entry.fitness()?, entry.promised_ci95?));
        let kept: Vec<bool> = ledger
            .entries()
            .iter()
            .filter_map(with_interval)
            .map(|(fitness, [least, most])| (least..=most).contains(&fitness))
            .collect();
        let mean = stats::mean(&gaps);
        let half = student_95(gaps.len()).map(|t| t * spread(&gaps, mean) / (gaps.len() as f64).sqrt());
        (!gaps.is_empty()).then(|| RealityGap {
            mean,
            ci95: half.map(|half| [mean - half, mean + half]),
            tests: gaps.len(),
            within: [kept.iter().filter(|kept| **kept).count(), kept.len()],
        })
    }
}

/// Standard deviation about a mean that was estimated.
fn spread(x: &[f64], mean: f64) -> f64 {
    (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (x.len() as f64 - 1.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_promise_holds_all_its_draws() {
        assert_eq!(interval(&[0.8, 1.1, 0.9]), Some([0.8, 1.1]));
        assert_eq!(interval(&[f64::NEG_INFINITY, 1.1]), None);
    }
}
