//! Diagnosis of a disengaged run: which physical effect its simulations lack, according to its real tests. This is the
//! paper's abduction over what the robot did, and the first half of its re-parametrisation.

mod ask;
mod by_posterior;
mod cause;
mod cause_search;
mod explanation;
mod extended;
mod simplify;

pub use cause::Cause;
