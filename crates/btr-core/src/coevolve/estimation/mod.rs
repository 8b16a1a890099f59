//! The posterior over a space of simulations, estimated from real tests.
//!
//! A turn draws an ensemble from a belief, runs it on every test and linearises the tests about it ([`linearise`]). The
//! belief moves and narrows by a bounded factor per turn, until a turn leaves it where it was ([`problem`]).

mod abduction;
mod ensemble;
mod errors;
mod linearise;
mod metric;
mod posterior;
mod predictive;
mod probe;
mod problem;
#[cfg(test)]
mod tests;

pub use abduction::{Abduction, Extension, FittedExtension, Suspect};
pub(super) use ensemble::Ensemble;
pub(super) use errors::EnsembleErrors;
pub(super) use linearise::TestInformation;
pub(super) use posterior::root;
pub use posterior::{Belief, Estimated, Explanation, OpenDirection, Posterior};
pub(super) use predictive::PriorPredictive;
pub use problem::EstimateError;
pub(super) use problem::{EstimationProblem, TurnResult, WIDENING};
