//! The inputs of a rollout.

use crate::drive::Drive;
use crate::effects::PlacedEffect;
use crate::engine::Dynamics;
use crate::robot::Robot;
use crate::setup::Setup;
use std::borrow::Cow;

/// Hook that may overwrite the robot's state during a rollout. It is called with the time in s after every step, once
/// the sensors have been read, and once before the first step.
pub type StateHook<'a> = Box<dyn FnMut(f64, &mut dyn Dynamics) + 'a>;

/// One rollout: a robot, its drive, and its settings. No effects, the default [`Setup`], noiseless sensors and no hook
/// unless stated.
pub struct RolloutRequest<'a> {
    pub(super) robot: &'a Robot,
    pub(super) drive: &'a dyn Drive,
    pub(super) effects: &'a [PlacedEffect],
    pub(super) setup: Cow<'a, Setup>,
    pub(super) noise_seed: Option<u64>,
    pub(super) hook: Option<StateHook<'a>>,
}

impl<'a> RolloutRequest<'a> {
    /// A rollout of `robot`, from its start state, with the references of `drive`.
    pub fn new(robot: &'a Robot, drive: &'a dyn Drive) -> Self {
        let setup = Cow::Owned(Setup::default());
        RolloutRequest { robot, drive, effects: &[], setup, noise_seed: None, hook: None }
    }

    /// Effects that act on the robot and its world.
    #[must_use]
    pub fn effects(self, effects: &'a [PlacedEffect]) -> Self {
        RolloutRequest { effects, ..self }
    }

    /// Times, sensors, ground and engine.
    #[must_use]
    pub fn setup(self, setup: &'a Setup) -> Self {
        RolloutRequest { setup: Cow::Borrowed(setup), ..self }
    }

    /// Seed of the sensors' noise; noiseless sensors without one.
    #[must_use]
    pub fn noise_seed(self, noise_seed: impl Into<Option<u64>>) -> Self {
        RolloutRequest { noise_seed: noise_seed.into(), ..self }
    }

    /// Hook that may overwrite the robot's state during the rollout.
    #[must_use]
    pub fn hook(self, hook: StateHook<'a>) -> Self {
        RolloutRequest { hook: Some(hook), ..self }
    }
}
