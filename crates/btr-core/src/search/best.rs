//! The best point reported to a search.

use super::{UnitPoint, sample};
use serde::{Deserialize, Serialize};

/// The best point so far; empty until an evaluation has succeeded.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Best(Option<(UnitPoint, f64)>);

impl Best {
    /// Updates the best point from an evaluated population. Of equal costs the first one stays; failures (infinite or
    /// NaN) do not count.
    pub(crate) fn see(&mut self, population: &[UnitPoint], costs: &[f64]) {
        for (point, &cost) in population.iter().zip(costs) {
            let better = self.0.as_ref().is_none_or(|(_, best)| cost < *best);
            if cost.is_finite() && better {
                self.0 = Some((point.clone(), cost));
            }
        }
    }

    /// Whether it can be the best of points in `dims` dimensions.
    pub(crate) fn is_of(&self, dims: usize) -> bool {
        self.0.as_ref().is_none_or(|(point, cost)| sample::is_on_cube(dims, point) && cost.is_finite())
    }

    /// The point and its cost.
    pub(crate) fn get(&self) -> Option<(&[f64], f64)> {
        self.0.as_ref().map(|(point, cost)| (point.as_slice(), *cost))
    }
}
