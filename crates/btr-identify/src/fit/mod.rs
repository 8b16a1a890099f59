//! Fitting the free parameters to measurements: an objective, a bounded search, start states, and estimates with
//! intervals.

mod dead;
mod derivative;
mod estimate;
mod fitted;
pub(crate) mod measure;
mod objective;
mod remaining;
pub(crate) mod residual_vector;
mod rollouts;
pub(crate) mod second_look;
mod settle;
mod sharpen;
mod solve;
mod start;
mod time_step;

pub use crate::residual_model::NOISE;
pub use derivative::columns;
pub(crate) use estimate::NINETY_FIVE;
pub use estimate::{
    Coordinate, Estimate, Identifiable, Intervals, Marginal, NullDirection, Posterior, Sensitivity, estimates,
    identifiable, null_directions,
};
pub use fitted::{FitResult, FitStart, StartValues, fitted, fitted_from};
pub(crate) use fitted::{RESTARTS, withheld};
pub use measure::ComparisonMeasure;
pub use objective::{LogSet, Objective, StopSignal};
pub use remaining::{Degree, RelativeError, RemainingError};
pub(crate) use remaining::{relative_errors, remaining};
pub use residual_vector::{ResidualVector, corrected, squares};
pub use rollouts::{rows_near, shared};
pub use solve::{FitPoint, FitStop, SearchBudget, cost};
pub use start::nearest_starts;
pub use time_step::{extrapolation, finer_step};
