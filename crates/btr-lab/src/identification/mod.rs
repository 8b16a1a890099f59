//! A model with recorded logs as a [`ResidualModel`](btr_identify::residual_model::ResidualModel): its free parameters,
//! and every effect of the library at every site where it can act.

mod assemble;
mod bare;
mod candidates;
mod catalogue;
mod contact;
mod glitches;
mod input;
mod log_parts;
mod measured;
mod problem;
mod problem_error;
mod regressor;
mod residuals;
mod searched;
mod simulated;
mod start;
mod torque_floors;

pub(crate) use catalogue::sites::{has_dry_friction, sites};
pub use input::{Doubt, ErrorUnit, FitOptions, FittedGlitch, NoiseFloor, StartModel, VerbInput, doubts};
pub use problem::IdentificationProblem;
pub use problem_error::ProblemError;
pub(crate) use start::moved::seen_starts;
