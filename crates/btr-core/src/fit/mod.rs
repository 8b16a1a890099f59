//! Fitting the numbers in doubt to measurements.

mod bench;
mod estimate;
mod solve;

pub use bench::{Bench, Logs, Residual, corrected, squares};
pub use estimate::{Estimate, NullDirection, estimates, null_directions};
pub use solve::{Effort, Fit, columns, cost};
