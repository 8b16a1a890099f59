//! The hidden twin: a simulation with hidden parameters and effects that replaces the robot.

use super::revealed::{Revealed, Revealing};
use super::store::{Store, StoreError, outcome_of};
use btr_core::world::{Outcome, Reality, Simulator, Trial};
use btr_io::Meta;
use btr_physics::model::Model;

/// A simulation whose parameters are hidden until the end of the run. It may change during the run.
pub struct TwinReality {
    /// Stages in order; the first one begins with the first test.
    stages: Vec<TwinStage>,
    /// Number of the last requested test.
    latest: usize,
    seed: u64,
    store: Store,
}

/// A stage of a twin: its state from some test on.
pub struct TwinStage {
    /// Number of its first real test.
    pub from_test: usize,
    /// Its model: effects, time step, noise.
    pub model: Model,
    /// Its parameters in S.
    pub parameters: Vec<f64>,
    /// The effects that the model of the experiment does not have.
    pub hidden: Vec<String>,
}

impl TwinReality {
    /// A twin with the stage `first`, followed by the stages `later` in the order of their first tests.
    pub fn new(first: TwinStage, mut later: Vec<TwinStage>, seed: u64, store: Store) -> Self {
        later.sort_by_key(|stage| stage.from_test);
        TwinReality { stages: std::iter::once(first).chain(later).collect(), latest: 0, seed, store }
    }

    fn in_test(&self, number: usize) -> &TwinStage {
        self.stages.iter().rfind(|stage| stage.from_test <= number).unwrap_or(&self.stages[0])
    }

    fn perform(&self, trial: &Trial) -> Result<Outcome, StoreError> {
        if let Some(before) = self.store.recall(trial)? {
            return Ok(before);
        }
        let noise = btr_core::random::derive(self.seed, &[trial.number as u64]);
        let TwinStage { model, parameters, .. } = self.in_test(trial.number);
        match model.simulate(model.request(parameters, trial.scenario).controller(&trial.controller).noise_seed(noise))
        {
            Ok(log) => {
                self.store.ask(trial, &log)?;
                self.store.keep(trial, &log, &Meta::default())
            }
            Err(why) => Ok(Outcome::Failed { why: why.to_string() }),
        }
    }
}

impl Reality for TwinReality {
    fn test(&mut self, trial: &Trial) -> Outcome {
        self.latest = self.latest.max(trial.number);
        outcome_of(self.perform(trial))
    }
}

impl Revealing for TwinReality {
    fn reveal(&self) -> Option<Revealed> {
        let TwinStage { model, parameters, hidden, .. } = self.in_test(self.latest);
        let names = model.simulations().dims().iter().map(|d| d.name.clone());
        Some(Revealed { parameters: names.zip(parameters.iter().copied()).collect(), effects: hidden.clone() })
    }
}
