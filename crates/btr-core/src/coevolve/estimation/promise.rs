//! What a simulation promises of a controller before it is tried, and by how much reality falls short of that.

use crate::coevolve::ledger::{Entry, Ledger};
use crate::signal::stats;
use serde::{Deserialize, Serialize};

/// So many draws from the posterior have the next one between their least and their greatest with 95 %: (n − 1)/(n + 1),
/// whatever the distribution is.
pub(crate) const DRAWS: usize = 39;

/// A 95 % prediction interval of a controller's fitness, from its fitness in [`DRAWS`] simulations of the posterior; `None`
/// where one of them failed.
pub(crate) fn interval(draws: &[f64]) -> Option<[f64; 2]> {
    let known = draws.iter().all(|fitness| fitness.is_finite()) && !draws.is_empty();
    let least = draws.iter().copied().fold(f64::INFINITY, f64::min);
    let most = draws.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    known.then_some([least, most])
}

/// The reality gap: real fitness less what was promised, over the real tests of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RealityGap {
    /// Mean over the tests, in the unit of fitness; below zero where reality falls short.
    pub mean: f64,
    /// 95 % interval of that mean (Student's t); `None` for fewer than three tests.
    pub ci95: Option<[f64; 2]>,
    /// How many tests had a promise and came to an end.
    pub tests: usize,
    /// How many of those with an interval ended within it, and how many there are.
    pub within: [usize; 2],
}

impl RealityGap {
    /// Over a ledger; `None` where no test had a promise.
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

/// The 97.5 % point of Student's t for a mean of so many numbers: of its tables for few, of its expansion about the normal
/// distribution's in the inverse of the degrees of freedom for more, which is exact to three digits there.
pub(crate) fn student_95(count: usize) -> Option<f64> {
    const FEW: [f64; 8] = [4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262];
    let z: f64 = 1.959_964;
    let freedom = count.checked_sub(1)? as f64;
    match count {
        0..3 => None,
        3..11 => FEW.get(count - 3).copied(),
        _ => {
            let first = (z.powi(3) + z) / 4.0;
            let second = (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0;
            let third = (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0;
            Some(z + first / freedom + second / freedom.powi(2) + third / freedom.powi(3))
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_promise_holds_all_its_draws() {
        assert_eq!(interval(&[0.8, 1.1, 0.9]), Some([0.8, 1.1]));
        assert_eq!(interval(&[f64::NEG_INFINITY, 1.1]), None);
    }

    #[test]
    fn students_t_joins_its_tables() {
        // Tables: 2.228 for ten degrees of freedom, 2.086 for twenty, 2.009 for fifty.
        for (count, table) in [(11, 2.228), (21, 2.086), (51, 2.009)] {
            assert!((student_95(count).unwrap() - table).abs() < 1e-3, "{count}");
        }
    }
}
