//! Real tests as scenarios of an experiment's model.

use super::build::Builder;
use super::loaded::Experiment;
use super::logs::scenarios::ScenarioSet;
use super::source::FileError;
use crate::reality::commands::{corrected_references, with_commands, with_lost_rows};
use btr_core::log::Log;
use btr_core::world::{Trial, WorldError};
use btr_identify::quality;
use btr_physics::drive::Replay;
use btr_physics::model::{Model, Scenario};
use std::sync::Arc;

impl Experiment {
    /// The model with real tests as its scenarios, the first `learn` of them for training: the commands of the robot,
    /// from the initial state of each test.
    ///
    /// # Errors
    /// A controller that does not fit.
    pub fn replaying(&self, tests: &[(&Trial, &Log)], learn: usize) -> Result<Model, FileError> {
        let (file, source) = (self.source.parse()?, &self.source);
        let refused = |e: WorldError| source.error(&["drive"], &e.to_string(), None);
        let scenarios = tests.iter().map(|(trial, log)| self.scenario(trial, log)).collect::<Result<_, _>>();
        // The setup is the run's own; it must not change with the clock of a log.
        let logs = self.recorded.clone();
        let situations = ScenarioSet { scenarios: scenarios.map_err(refused)?, learn, logs, warnings: Vec::new() };
        let mut model = Builder::driven_like(&self.model, &file, source).model(situations)?;
        if let Some((trial, _)) = tests.first() {
            // The initial pose of the base depends on the drive.
            model.robot.start = self.model.beginning(&trial.controller, trial.scenario).map_err(refused)?.start;
        }
        Ok(model)
    }

    /// A real test's log, with the rows added that were lost before its first one.
    ///
    /// # Errors
    /// A controller that does not fit.
    pub fn from_the_beginning(&self, trial: &Trial, log: &Log) -> Result<Log, WorldError> {
        match self.model.scenarios[trial.scenario].replay {
            Some(_) => Ok(log.clone()),
            // The commands of a policy in lost rows are unknown.
            None if self.model.drive.senses() => Ok(log.clone()),
            None => Ok(with_lost_rows(log, &self.model.references(&trial.controller, trial.scenario)?)),
        }
    }

    /// The scenario of a real test: its commands and its initial state.
    fn scenario(&self, trial: &Trial, log: &Log) -> Result<Scenario, WorldError> {
        let known = &self.model.scenarios[trial.scenario];
        if known.replay.is_some() {
            return Ok(known.clone());
        }
        let mut references = self.model.references(&trial.controller, trial.scenario)?;
        if self.model.drive.senses() {
            references = corrected_references(&references, log);
        }
        // References are interpolated or held from tick to tick as in the run. Commands of the log are held sample by
        // sample, and used only if they differ from the references.
        let as_requested = quality::check_references(&references, log).is_none();
        let replay = match as_requested {
            true => Replay::new(&references, &self.model.robot),
            false => Replay::new(&with_commands(log, &references), &self.model.robot),
        };
        let start = self
            .model
            .beginning(&trial.controller, trial.scenario)?
            .movable()
            .map(|(_, link)| (link.joint.start, 0.0))
            .collect();
        Ok(Scenario {
            name: format!("test {}", trial.number),
            replay: Some(Arc::new(replay)),
            duration_s: log.duration_s(),
            start,
            ..known.clone()
        })
    }
}
