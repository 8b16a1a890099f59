//! Fitting the numbers in doubt to measurements.

mod derivative;
mod estimate;
mod fitted;
#[cfg(test)]
pub(crate) mod fixture;
mod identifiable;
pub(crate) mod measure;
mod objective;
mod settle;
mod shared_rollouts;
mod solve;
mod start_search;
mod start_states;

pub use derivative::columns;
pub use estimate::{Estimate, NullDirection, estimates, null_directions};
pub(crate) use fitted::RESTARTS;
pub use fitted::{FitResult, fitted};
pub use identifiable::{Identifiable, Sensitivity, identifiable};
pub use measure::{ComparisonMeasure, NOISE};
pub use objective::{FINE_ENOUGH, FINEST, LogSet, Objective, ResidualVector, corrected, squares};
pub use shared_rollouts::{rows_near, shared};
pub use solve::{FitPoint, FitStop, SearchBudget, cost};
pub use start_search::nearest_starts;
