//! Fitting the numbers in doubt to measurements.

mod bench;
mod solve;

pub use bench::{Bench, Logs, Residual, corrected, squares};
pub use solve::{Effort, Fit, columns, cost};
