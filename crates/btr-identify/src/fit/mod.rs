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

pub use bench::{Bench, FINE_ENOUGH, FINEST, Logs, Residual, corrected, squares};
pub use derivative::columns;
pub use estimate::{Estimate, NullDirection, estimates, null_directions};
pub(crate) use fitted::LOOKS;
pub use fitted::{Fitted, fitted};
pub use identifiable::{Identifiable, Sensitivity, identifiable};
pub use judge::{Measure, NOISE};
pub use nearest::nearest_starts;
pub use solve::{Effort, Ended, Fit, cost};
pub use together::{rows_near, shared};
