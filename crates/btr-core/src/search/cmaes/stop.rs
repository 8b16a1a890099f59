//! When a run of CMA-ES has stopped moving: the tests of the tutorial's section B.3 (N. Hansen, arXiv:1604.00772).

use serde::{Deserialize, Serialize};

/// Why a run has nothing more to find.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CmaStop {
    /// Its steps are too small to matter.
    SmallSteps,
    /// The axes of its distribution are too unlike to compute with.
    UnlikeAxes,
    /// The latest costs are equal to 12 digits.
    FlatCosts,
    /// The newest costs are no better than much older ones.
    Stagnation,
    /// Nothing succeeds.
    Failures,
}

/// The best costs of past generations, newest last, and how long everything has failed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct CostHistory {
    costs: Vec<f64>,
    failures: u32,
}

/// Generations in a row without a single success after which another place is tried.
const PATIENCE: u32 = 10;
/// Costs are remembered for this many generations at most.
const MEMORY: usize = 20_000;

impl CostHistory {
    /// Notes the best cost of a generation; infinite when everything failed.
    pub(super) fn see(&mut self, cost: f64) {
        if cost == f64::INFINITY {
            self.failures = self.failures.saturating_add(1);
            return;
        }
        self.failures = 0;
        if self.costs.len() == MEMORY {
            self.costs.remove(0);
        }
        self.costs.push(cost);
    }

    /// Ends when nothing succeeds, when the latest costs are equal to 12 digits, or when the newest fifth of a long
    /// history is in its median no better than the oldest fifth.
    pub(super) fn ended(&self, dims: usize, lambda: usize) -> Option<CmaStop> {
        let per_generation = dims as f64 / lambda as f64;
        let short = 10 + (30.0 * per_generation).ceil() as usize;
        let long = 120 + (30.0 * per_generation).ceil() as usize;
        let seen = self.costs.len();
        if self.failures >= PATIENCE {
            Some(CmaStop::Failures)
        } else if seen >= short && flat(&self.costs[seen - short..]) {
            Some(CmaStop::FlatCosts)
        } else if seen >= long && ageing(&self.costs[seen - (seen * 3 / 10).max(long)..]) {
            Some(CmaStop::Stagnation)
        } else {
            None
        }
    }
}

fn flat(costs: &[f64]) -> bool {
    let (low, high) = costs.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), c| (l.min(*c), h.max(*c)));
    high - low <= 1e-12 * high.abs().max(low.abs())
}

fn ageing(costs: &[f64]) -> bool {
    let fifth = costs.len() / 5;
    median(&costs[costs.len() - fifth..]) >= median(&costs[..fifth])
}

fn median(costs: &[f64]) -> f64 {
    let mut sorted = costs.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn history(costs: impl Iterator<Item = f64>) -> CostHistory {
        let mut history = CostHistory::default();
        costs.for_each(|cost| history.see(cost));
        history
    }

    #[test]
    fn progress_goes_on() {
        assert_eq!(history((0..1000).map(|i| 0.9f64.powi(i))).ended(5, 8), None);
        assert_eq!(CostHistory::default().ended(5, 8), None);
    }

    #[test]
    fn equal_costs_noise_and_failures_stop() {
        assert_eq!(history((0..40).map(|_| 3.0)).ended(5, 8), Some(CmaStop::FlatCosts));
        assert_eq!(history((0..1000).map(|i| f64::from(i * 7919 % 101))).ended(5, 8), Some(CmaStop::Stagnation));
        assert_eq!(history((0..10).map(|_| f64::INFINITY)).ended(5, 8), Some(CmaStop::Failures));
        assert_eq!(history((0..9).map(|_| f64::INFINITY)).ended(5, 8), None);
    }
}
