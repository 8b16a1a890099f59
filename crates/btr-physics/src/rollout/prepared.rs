//! One rollout: from its request to its log, step by step.

use super::control::Control;
use super::prepare::{apply_static_effects, check, check_effects, check_linkages, check_sampling, sense};
use super::record::Recorder;
use super::request::{RolloutRequest, StateHook};
use crate::effects;
use crate::effects::PlacedEffect;
use crate::engine::Dynamics;
use crate::engine::articulated;
#[cfg(feature = "rapier")]
use crate::engine::rapier::Rapier;
use crate::robot::Robot;
use crate::setup::{EngineName, Setup};
use btr_core::log::Log;
use btr_core::world::WorldError;
use std::borrow::Cow;

/// A rollout that is ready to start.
pub(super) struct PreparedRollout<'a> {
    pub(super) robot: Cow<'a, Robot>,
    effects: Vec<PlacedEffect>,
    pub(super) setup: Cow<'a, Setup>,
    pub(super) control: Control<'a>,
    recorder: Recorder,
    noise_seed: Option<u64>,
    hook: Option<StateHook<'a>>,
    samples: usize,
    /// Physics steps per sample, and of the rest before time zero.
    steps_per_sample: usize,
    pub(super) rest_steps: usize,
    pub(super) failed: Option<WorldError>,
}

impl<'a> PreparedRollout<'a> {
    /// Checks the request and allocates all memory.
    ///
    /// # Errors
    /// See [`simulate`](super::simulate).
    pub(super) fn new(request: RolloutRequest<'a>) -> Result<Self, WorldError> {
        let RolloutRequest { robot, drive, effects, setup, noise_seed, hook } = request;
        let (samples, steps_per_sample) = setup.samples(robot)?;
        let effects = effects::in_force(effects)?;
        let (robot, setup) = apply_static_effects(robot, &effects, setup)?;
        check_effects(&effects, &setup)?;
        check_sampling(&robot, &setup)?;
        let control = Control::new(&robot, &effects, &setup, drive)?;
        check_linkages(&robot, &setup)?;
        let recorder = Recorder::new(&robot, &setup, samples);
        let rest_steps = (setup.rest_s / setup.dt_s).round() as usize;
        Ok(PreparedRollout {
            robot,
            effects,
            setup,
            control,
            recorder,
            noise_seed,
            hook,
            samples,
            steps_per_sample,
            rest_steps,
            failed: None,
        })
    }

    /// A physics engine for this rollout alone.
    ///
    /// # Errors
    /// An engine that this build does not have.
    pub(super) fn engine(&self) -> Result<Box<dyn Dynamics>, WorldError> {
        match self.setup.engine {
            EngineName::Auto => Ok(articulated::engine(&self.robot, &self.setup)),
            #[cfg(feature = "rapier")]
            EngineName::Rapier => Ok(Box::new(Rapier::new(&self.robot, &self.setup))),
            #[cfg(not(feature = "rapier"))]
            EngineName::Rapier => Err(crate::setup::setup_error(
                "this build has no engine \"rapier\": btr-physics was compiled without its feature `rapier`".to_owned(),
            )),
        }
    }

    /// Whether both can be simulated in one batch: equally many steps of equal length, on the default engine, without
    /// prescribed joints.
    pub(super) fn can_batch_with(&self, other: &PreparedRollout) -> bool {
        let steps =
            |run: &PreparedRollout| (run.samples, run.steps_per_sample, run.rest_steps, run.setup.dt_s.to_bits());
        let own = |run: &PreparedRollout| run.setup.engine == EngineName::Auto && !run.control.has_prescribed();
        steps(self) == steps(other) && own(self) && own(other)
    }

    /// Number of physics steps from time zero.
    pub(super) fn steps(&self) -> usize {
        (self.samples - 1) * self.steps_per_sample
    }

    pub(super) fn before_step(&mut self, step: usize, engine: &mut dyn Dynamics) {
        self.control.act(step as f64 * self.setup.dt_s - self.setup.dt_s, engine);
        if (step - 1).is_multiple_of(self.steps_per_sample) {
            self.recorder.correct_torques(&self.control);
        }
        self.recorder.before_step(engine);
    }

    pub(super) fn after_step(&mut self, step: usize, engine: &mut dyn Dynamics) {
        let time_s = step as f64 * self.setup.dt_s;
        if step > 0 {
            self.check(engine, time_s);
            if self.failed.is_some() {
                return;
            }
        }
        self.control.update_references(time_s, engine);
        if step == 1 {
            self.recorder.forces(engine, &self.control);
        }
        if step.is_multiple_of(self.steps_per_sample) {
            self.recorder.state(engine, &self.control);
            if step > 0 {
                self.recorder.forces(engine, &self.control);
            }
        }
        if let Some(hook) = &mut self.hook {
            hook(time_s, engine);
        }
    }

    /// Records whether the state is invalid. If a user's law returned a non-finite number, that is reported as the
    /// cause.
    pub(super) fn check(&mut self, engine: &dyn Dynamics, time_s: f64) {
        self.failed = check(engine, time_s).err().map(|error| self.control.trouble(&self.robot).unwrap_or(error));
    }

    pub(super) fn finish(mut self, engine: &mut dyn Dynamics) -> Result<Log, WorldError> {
        // A non-finite number of a law may not have reached the state, where a motor is not driven or does not use its
        // sensor.
        if let Some(error) = self.failed.or_else(|| self.control.trouble(&self.robot)) {
            return Err(error);
        }
        if self.control.knows_torques() {
            self.control.act((self.samples - 1) as f64 * self.steps_per_sample as f64 * self.setup.dt_s, engine);
            self.recorder.correct_torques(&self.control);
        }
        let sample_s = self.setup.dt_s * self.steps_per_sample as f64;
        self.recorder.finish(sample_s, self.noise_seed, |log| sense(&self.robot, &self.effects, log))
    }
}
