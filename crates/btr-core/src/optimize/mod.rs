//! Local optimisation where a cost is a sum of squares.

mod damped;
mod least_squares;

pub use damped::QuadraticModel;
pub use least_squares::{LeastSquares, Linear, Residuals};
