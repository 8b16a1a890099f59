//! Local optimisation where a cost is a sum of squares.

mod least_squares;

pub use least_squares::{LeastSquares, Linear, Residuals};
