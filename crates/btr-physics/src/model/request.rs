//! A rollout of a model.

use super::parameter::Target;
use super::{Model, Scenario};
use crate::effects::PlacedEffect;
use crate::rollout::StateHook;
use btr_core::world::{Job, TimeStep};

/// One rollout of a [`Model`]: its nominal controller, its own values, no further effects, its own time step, noiseless
/// sensors and no hook unless stated. See [`Model::request`].
pub struct ModelRequest<'a> {
    pub(super) s: &'a [f64],
    pub(super) scenario: &'a Scenario,
    pub(super) controller: Option<&'a [f64]>,
    pub(super) values: &'a [(Target, f64)],
    pub(super) effects: &'a [PlacedEffect],
    pub(super) time_step: TimeStep,
    pub(super) noise_seed: Option<u64>,
    pub(super) hook: Option<StateHook<'a>>,
}

impl<'a> ModelRequest<'a> {
    /// A rollout of point `s` of S in a scenario.
    pub fn new(s: &'a [f64], scenario: &'a Scenario) -> Self {
        let (values, effects, time_step) = (&[][..], &[][..], TimeStep::USUAL);
        ModelRequest { s, scenario, controller: None, values, effects, time_step, noise_seed: None, hook: None }
    }

    /// A point of C.
    #[must_use]
    pub fn controller(self, c: &'a [f64]) -> Self {
        ModelRequest { controller: Some(c), ..self }
    }

    /// Values that replace the model's own. Those that a scenario states win over these.
    #[must_use]
    pub fn values(self, values: &'a [(Target, f64)]) -> Self {
        ModelRequest { values, ..self }
    }

    /// Effects in addition to those of the model.
    #[must_use]
    pub fn effects(self, effects: &'a [PlacedEffect]) -> Self {
        ModelRequest { effects, ..self }
    }

    /// The model's own time step or a finer one; the log's sampling period stays the same.
    #[must_use]
    pub fn time_step(self, time_step: TimeStep) -> Self {
        ModelRequest { time_step, ..self }
    }

    /// Seed of the noise of the model's sensors; noiseless sensors without one.
    #[must_use]
    pub fn noise_seed(self, noise_seed: impl Into<Option<u64>>) -> Self {
        ModelRequest { noise_seed: noise_seed.into(), ..self }
    }

    /// Hook that may overwrite the robot's state during the rollout; it is called after the scenario's own restarts.
    #[must_use]
    pub fn hook(self, hook: StateHook<'a>) -> Self {
        ModelRequest { hook: Some(hook), ..self }
    }
}

impl Model {
    /// A rollout of point `s` of S in one of the model's scenarios.
    pub fn request<'a>(&'a self, s: &'a [f64], scenario: usize) -> ModelRequest<'a> {
        ModelRequest::new(s, &self.scenarios[scenario])
    }

    /// The rollout of a job of the search.
    pub fn job<'a>(&'a self, job: &Job<'a>) -> ModelRequest<'a> {
        self.request(job.s, job.scenario).controller(job.c)
    }
}
