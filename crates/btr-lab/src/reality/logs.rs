//! Recorded logs as reality: one log per scenario.

use super::revealed::Revealing;
use btr_core::log::Log;
use btr_core::world::{Behaviour, Outcome, Reality, Trial};
use btr_physics::model::task::Fitness;

/// Logs in the order of the scenarios.
pub struct RecordedReality {
    logs: Vec<Log>,
    fitness: Fitness,
}

impl RecordedReality {
    /// `logs[k]` is the recorded log of scenario k.
    pub fn new(logs: Vec<Log>, fitness: Fitness) -> Self {
        RecordedReality { logs, fitness }
    }
}

impl Reality for RecordedReality {
    fn test(&mut self, trial: &Trial) -> Outcome {
        let Some(log) = self.logs.get(trial.scenario) else {
            return Outcome::Failed { why: format!("there is no log for scenario {}", trial.scenario) };
        };
        match self.fitness.of(log) {
            Ok(fitness) => Outcome::Done(Behaviour { log: log.clone(), fitness }),
            Err(why) => Outcome::Failed { why: why.to_string() },
        }
    }
}

impl Revealing for RecordedReality {}
