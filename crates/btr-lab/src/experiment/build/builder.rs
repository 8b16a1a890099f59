//! Builds a model from a file.

use crate::experiment::file::{File, RealitySection};
use crate::experiment::logs::listed::from_logs;
use crate::experiment::logs::scenarios::ScenarioSet;
use crate::experiment::source::{FileError, Source};
use crate::suggest;
use btr_core::text::Text;
use btr_physics::drive::DrivePlan;
use btr_physics::model::Model;
use std::cell::OnceCell;
use std::sync::atomic::AtomicU64;

/// Builds a model from a file.
pub(crate) struct Builder<'a> {
    pub(crate) file: &'a File,
    pub(crate) source: &'a Source,
    /// The file's drive, once it is known: a log that it replays is read once.
    pub(super) drive: OnceCell<DrivePlan>,
}

impl<'a> Builder<'a> {
    pub(crate) fn new(file: &'a File, source: &'a Source) -> Self {
        Builder { file, source, drive: OnceCell::new() }
    }

    /// The same for a file with the drive of a model that was built before.
    pub(crate) fn driven_like(model: &Model, file: &'a File, source: &'a Source) -> Self {
        Builder { file, source, drive: OnceCell::from(model.drive.clone()) }
    }
}

impl Builder<'_> {
    /// One scenario per recorded log; a single one for other realities.
    pub(crate) fn situations(&self, reality: &RealitySection) -> Result<ScenarioSet, FileError> {
        match reality {
            RealitySection::Logs(logs) => from_logs(logs, self.file, self.source, &self.robot()?),
            _ => Ok(ScenarioSet::single(self.file.simulation.duration_s)),
        }
    }

    pub(crate) fn model(&self, situations: ScenarioSet) -> Result<Model, FileError> {
        let robot = self.robot()?;
        let setup = self.setup(&robot, &situations.logs)?;
        self.check_durations(&robot, &setup, &situations.scenarios)?;
        let effects = self.effects(&self.file.effects, "effects", &robot)?;
        let (free, simulations) = self.parameters(&robot, &effects, &setup)?;
        let drive = self.drive(&robot)?;
        Ok(Model {
            fitness: self.fitness(&robot)?,
            robot,
            effects,
            setup,
            targets: free.targets,
            simulations,
            prior_sds: free.prior_sds,
            drive,
            scenarios: situations.scenarios,
            learn: situations.learn,
            rollouts: AtomicU64::new(0),
        })
    }

    pub(crate) fn error(&self, keys: &[&str], message: impl std::fmt::Display, help: Option<Text>) -> FileError {
        self.source.error(keys, &message.to_string(), help)
    }

    pub(crate) fn unknown<'b>(
        &self,
        keys: &[&str],
        what: &str,
        wrong: &str,
        known: impl IntoIterator<Item = &'b str>,
    ) -> FileError {
        self.error(keys, format!("there is no {what} `{wrong}`"), Some(suggest::remedy(wrong, known)))
    }
}
