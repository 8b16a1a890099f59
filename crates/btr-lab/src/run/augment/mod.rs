//! What a run asks when it disengages: which physical effect its simulations lack, by the real tests it has. The paper's
//! abduction over what the robot did, and the first half of its re-parametrisation.

mod ask;
mod by_posterior;
mod cause;
mod extended;

pub use cause::Cause;
