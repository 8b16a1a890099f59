//! Fitting the numbers in doubt to measurements.

mod bench;
mod derivative;
mod estimate;
mod fitted;
mod identifiable;
pub(crate) mod judge;
#[cfg(test)]
pub(crate) mod made;
mod nearest;
mod settle;
mod solve;
mod start;
mod together;

pub use bench::{FINE_ENOUGH, FINEST, LogSet, Objective, ResidualVector, corrected, squares};
pub use derivative::columns;
pub use estimate::{Estimate, NullDirection, estimates, null_directions};
pub(crate) use fitted::LOOKS;
pub use fitted::{FitResult, fitted};
pub use identifiable::{Identifiable, Sensitivity, identifiable};
pub use judge::{ComparisonMeasure, NOISE};
pub use nearest::nearest_starts;
pub use solve::{FitPoint, FitStop, SearchBudget, cost};
pub use together::{rows_near, shared};
