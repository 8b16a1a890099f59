//! The simulation loop: from a robot, its drive and its setup to a log.
//!
//! A [`RolloutRequest`] describes a rollout; [`simulate`] runs one and [`simulate_all`] many. [`joint_torques()`]
//! computes what acts in the joints of a prescribed motion.
//!
//! - The same request gives the same bits, on any thread and in any batch.
//! - Candidates for one robot are simulated in batches, one per SIMD lane (8 with AVX-512, 4 with AVX2, detected at run
//!   time). The batch size affects only the time taken. Robots with prescribed joints and runs on Rapier are simulated
//!   one by one.
//! - A controller's references depend on the controller alone, not on the simulated parameters.

mod batch;
mod control;
mod joint_control;
mod joint_torques;
mod neighbours;
mod prepare;
mod prepared;
mod record;
mod request;
pub mod restart;

pub use batch::lanes;
pub use joint_torques::joint_torques;
pub(crate) use prepare::apply_static_effects;
pub use request::{RolloutRequest, StateHook};

use crate::setup::setup_error;
use btr_core::log::Log;
use btr_core::world::WorldError;
use prepared::PreparedRollout;

/// Simulates one rollout and logs it, from the start state on.
///
/// The first sample is the start state. Its torques are those of the first command, its foot forces and accelerations
/// those of the first step. The same request gives the same bits, on any thread.
///
/// # Errors
/// [`WorldError::Setup`] for sites that match nothing and inconsistent times; [`WorldError::Diverged`] when the state
/// stops being finite or a velocity exceeds any plausible value.
pub fn simulate(request: RolloutRequest) -> Result<Log, WorldError> {
    let mut logs = simulate_all(vec![request]);
    logs.pop().unwrap_or_else(|| Err(setup_error("nothing was simulated".to_owned())))
}

/// Simulates several rollouts on the calling thread. Each log is what [`simulate`] gives for its request, bit by bit.
///
/// Consecutive requests that differ only in values (of the robot, of effects, of the world) and in their references are
/// simulated in one batch, in SIMD lanes, if they run on the default engine and no joint's motion is prescribed. A call
/// with eight or more requests is therefore faster than as many calls.
pub fn simulate_all(requests: Vec<RolloutRequest>) -> Vec<Result<Log, WorldError>> {
    batch::simulate_all(requests.into_iter().map(PreparedRollout::new).collect())
}
