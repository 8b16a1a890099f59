//! A robot that changes during a run: a payload was added, a motor has worn.
//!
//! Where a belief about S predicted earlier tests and then fails on a fresh one, either the belief was overconfident,
//! or the robot has changed. It has changed if no simulation explains the old tests and the new ones together, and the
//! new ones alone contradict the belief. From then on only the new tests count.

use super::estimation::Posterior;
use super::ledger::Entry;
use crate::space::Space;
use serde::{Deserialize, Serialize};

/// A parameter has changed if its values before and after differ by so many of their standard deviations: of a hundred
/// unchanged parameters, one does in one of a hundred runs.
const CHANGED: f64 = 4.0;

/// The robot has changed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Drift {
    /// Number of the first real test that shows it: it happened between this one and the one before.
    pub before_test: usize,
    /// The iteration in which it was noticed.
    pub iteration: usize,
    /// Parameters of S that differ significantly by the tests since then, most certain first. Empty where S does not
    /// hold what has changed.
    pub changed: Vec<Change>,
    /// Whether a simulation of S explains the tests since then.
    pub explained: bool,
    /// The posterior of the robot before the change.
    pub(super) former: Posterior,
}

/// A parameter of S that has changed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// The parameter.
    pub parameter: String,
    /// Value before, in the units of S.
    pub before: f64,
    /// Value now.
    pub after: f64,
    /// The difference in multiples of its standard deviation.
    pub deviations: f64,
}

impl Drift {
    pub(super) fn seen(test: &Entry, former: Posterior) -> Self {
        let (before_test, iteration) = (test.trial.number, test.trial.iteration);
        Drift { before_test, iteration, changed: Vec::new(), explained: false, former }
    }

    /// Compares the posterior now with the one before.
    pub(super) fn compare(&mut self, space: &Space, now: &Posterior, explained: bool) {
        self.explained = explained;
        self.changed = if explained { changes(space, &self.former, now) } else { Vec::new() };
    }
}

/// Parameters of S in which two posteriors differ significantly.
pub(super) fn changes(space: &Space, former: &Posterior, now: &Posterior) -> Vec<Change> {
    let change = |(k, dim): (usize, &crate::space::Dim)| {
        let (before, after) = (former.mean()[k], now.mean()[k]);
        let deviations = (after - before).abs() / former.sd(k).hypot(now.sd(k)).max(f64::MIN_POSITIVE);
        let found = Change {
            parameter: dim.name.clone(),
            before: dim.from_unit(before),
            after: dim.from_unit(after),
            deviations,
        };
        (deviations > CHANGED).then_some(found)
    };
    // Dimensions that S has gained since have no value before.
    let mut changes: Vec<Change> =
        space.dims().iter().enumerate().take(former.mean().len()).filter_map(change).collect();
    changes.sort_by(|a, b| b.deviations.total_cmp(&a.deviations));
    changes
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::space::Dim;
    use nalgebra::{DMatrix, DVector};

    fn belief(mean: [f64; 2], sd: f64) -> Posterior {
        Posterior::new(DVector::from_row_slice(&mean), DMatrix::identity(2, 2) * sd.powi(2))
    }

    #[test]
    fn only_significant_differences_count_as_changes() {
        let space = Space::new(vec![Dim::new("a", "kg", 0.0, 2.0), Dim::new("b", "kg", 0.0, 2.0)]).unwrap();
        let changed = changes(&space, &belief([0.5, 0.5], 0.03), &belief([0.7, 0.8], 0.04));
        assert_eq!(changed.len(), 1);
        assert_eq!(changed[0].parameter, "b");
        assert!((changed[0].before - 1.0).abs() < 1e-12 && (changed[0].after - 1.6).abs() < 1e-12);
        assert!((changed[0].deviations - 6.0).abs() < 1e-9);
    }
}
