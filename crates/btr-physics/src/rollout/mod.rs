//! The simulation loop: a robot, what is put into its world, a drive; out comes a log.

pub(crate) mod batch;
mod control;
mod prepare;
mod record;
pub mod restart;

use crate::drive::Drive;
use crate::effects::PlacedEffect;
use crate::robot::Robot;
use crate::setup::{Setup, setup_error};
use batch::{PreparedRollout, StateHook, unled};
use btr_core::log::Log;
use btr_core::world::WorldError;

/// Runs `drive` on `robot` with `effects` and logs what happens, from the start state on.
///
/// The first sample is the start state; torques there are those of the first command, foot forces and accelerations those
/// of the first step. The same arguments give the same bits, on any thread.
///
/// # Errors
/// [`WorldError::Setup`] for sites that match nothing and times that do not fit; [`WorldError::BlewUp`] when the state stops
/// being finite or moves absurdly fast.
pub fn simulate(
    robot: &Robot,
    effects: &[PlacedEffect],
    setup: &Setup,
    drive: &dyn Drive,
    noise_seed: Option<u64>,
) -> Result<Log, WorldError> {
    simulate_led(robot, effects, setup, drive, noise_seed, unled())
}

/// A robot in its world, and what it is told.
#[derive(Clone, Copy)]
pub struct RolloutRequest<'a> {
    /// In its start state.
    pub robot: &'a Robot,
    /// What acts beside it.
    pub effects: &'a [PlacedEffect],
    /// Everything else about the run.
    pub setup: &'a Setup,
    /// What the joints are told.
    pub drive: &'a dyn Drive,
    /// For noisy sensors.
    pub noise_seed: Option<u64>,
}

/// What [`simulate`] gives for each candidate, bit by bit, on the calling thread. Candidates that follow each other and
/// only differ in numbers (of the robot, of effects, of the world) and in what they are told are simulated side by side
/// in the machine's vector registers, as far as they run on the default engine and no joint's motion is prescribed:
/// hand over eight or more at once.
pub fn simulate_all(candidates: &[RolloutRequest]) -> Vec<Result<Log, WorldError>> {
    let runs =
        candidates.iter().map(|c| PreparedRollout::new(c.robot, c.effects, c.setup, c.drive, c.noise_seed, unled()));
    batch::simulate_all(runs.collect())
}

/// The same where somebody may move the robot to another state: `lead` is called after every step with the time in s, once the
/// sensors have been read; and once before the first.
pub(crate) fn simulate_led(
    robot: &Robot,
    effects: &[PlacedEffect],
    setup: &Setup,
    drive: &dyn Drive,
    noise_seed: Option<u64>,
    lead: StateHook,
) -> Result<Log, WorldError> {
    let run = PreparedRollout::new(robot, effects, setup, drive, noise_seed, lead)?;
    let mut engine = run.engine();
    batch::together(engine.as_mut(), vec![run])
        .pop()
        .unwrap_or_else(|| Err(setup_error("nothing was simulated".to_owned())))
}
