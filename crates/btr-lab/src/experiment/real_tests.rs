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
    /// The model with real tests as its scenarios, the first `learn` of them to learn from: what the robot was told,
    /// from where every test begins.
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
        let mut model = Builder { file: &file, source }.model(situations)?;
        if let Some((trial, _)) = tests.first() {
            // Where the base is when the motion begins is the drive's business.
            model.robot.start = self.model.beginning(&trial.controller, trial.scenario).map_err(refused)?.start;
        }
        Ok(model)
    }

    /// A real test's log from the test's beginning on, where it lost rows before its first one.
    ///
    /// # Errors
    /// A controller that does not fit.
    pub fn from_the_beginning(&self, trial: &Trial, log: &Log) -> Result<Log, WorldError> {
        match self.model.scenarios[trial.scenario].replay {
            Some(_) => Ok(log.clone()),
            // What a policy told the robot in rows that are lost, nobody knows.
            None if self.model.drive.senses() => Ok(log.clone()),
            None => Ok(with_lost_rows(log, &self.model.references(&trial.controller, trial.scenario)?)),
        }
    }

    /// What a real test asked and where it began.
    fn scenario(&self, trial: &Trial, log: &Log) -> Result<Scenario, WorldError> {
        let known = &self.model.scenarios[trial.scenario];
        if known.replay.is_some() {
            return Ok(known.clone());
        }
        let mut references = self.model.references(&trial.controller, trial.scenario)?;
        if self.model.drive.senses() {
            references = corrected_references(&references, log);
        }
        // References are led or held from tick to tick as the run has them; what a log says of that, sample by sample,
        // is held only where it is something else than what was asked for.
        let as_asked = quality::check_references(&references, log).is_none();
        let replay = match as_asked {
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
