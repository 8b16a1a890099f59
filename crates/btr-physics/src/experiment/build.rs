//! From what is written to what can be run.

use super::file::{File, RealitySection};
use super::parse::{FileError, Source, nearest};
use super::scenarios::{self, Situations};
use crate::model::Model;
use crate::reality::Revealing;
use btr_core::coevolve::{Coevolution, Plan, PlanError};
use btr_core::distance::DistanceSpec;
use btr_core::log::{Log, Role};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

/// Everything a run needs.
pub struct Experiment {
    /// What it is called.
    pub name: String,
    /// The seed of every random number.
    pub seed: u64,
    /// S, C and how they behave.
    pub model: Arc<Model>,
    /// The loop's plan.
    pub plan: Plan,
    /// Where the truth comes from.
    pub reality: Box<dyn Revealing>,
    /// Recorded logs in the order of the model's scenarios, held-out ones last; empty for other realities.
    pub recorded: Vec<Log>,
    /// Distances to identify with once more.
    pub distances: Vec<DistanceSpec>,
    /// What the readers of the recorded logs noticed and could live with.
    pub warnings: Vec<String>,
    source: Source,
}

impl Experiment {
    /// Builds the experiment; real tests are kept under `folder`.
    ///
    /// # Errors
    /// Whatever does not make sense, at its line.
    pub fn new(source: Source, seed: Option<u64>, folder: &Path) -> Result<Self, FileError> {
        let file = source.parse()?;
        let seed = seed.unwrap_or(file.seed);
        let missing = |section: &str| source.error(&[], &format!("there is no [{section}]"), Some(needs(section)));
        let plan = file.coevolve.clone().ok_or_else(|| missing("coevolve"))?;
        let reality = file.reality.clone().ok_or_else(|| missing("reality"))?;
        let builder = Builder { file: &file, source: &source };
        let situations = match &reality {
            RealitySection::Logs(logs) => scenarios::from_logs(logs, &file, &source, &builder.robot()?)?,
            _ => Situations::single(file.simulation.duration_s),
        };
        let (recorded, warnings) = (situations.logs.clone(), situations.warnings.clone());
        let model = Arc::new(builder.model(situations)?);
        builder.check_plan(&plan, &reality, &model, &recorded)?;
        let reality = builder.reality(&reality, &model, &recorded, seed, folder)?;
        let (name, distances) = (file.name.clone(), file.distances.clone());
        Ok(Experiment { name, seed, model, plan, reality, recorded, distances, warnings, source })
    }

    /// What identifies the experiment: its text with all settings, and its seed.
    pub fn stamp(&self) -> String {
        format!("# --seed {}\n{}", self.seed, self.source.text)
    }

    /// The file it came from.
    pub fn source(&self) -> &Source {
        &self.source
    }
}

fn remedy(error: &PlanError) -> String {
    match error {
        PlanError::NoControllerSearch(_) => {
            "controllers = { generations = 10, search = { algorithm = \"ga\", population = 20 } }; or set them in [drive]"
        }
        PlanError::NoSimulatorSearch(_) => {
            "simulators = { generations = 20, search = { algorithm = \"cma_es\", population = 12 } }; or empty [parameters]"
        }
        PlanError::NothingToControl => "give [drive] a search, or take method = \"back_to_reality\"",
        PlanError::NoIterations => "iterations = 10",
    }
    .to_owned()
}

fn needs(section: &str) -> String {
    match section {
        "coevolve" => "add [coevolve] with iterations and distance; robots/pendulum.toml is a short example",
        _ => "add [reality] with kind = \"twin\", \"logs\", \"command\" or \"manual\"",
    }
    .to_owned()
}

/// A file on its way to a model.
pub(super) struct Builder<'a> {
    pub(super) file: &'a File,
    pub(super) source: &'a Source,
}

impl Builder<'_> {
    pub(super) fn model(&self, situations: Situations) -> Result<Model, FileError> {
        let robot = self.robot()?;
        let setup = self.setup(&robot, &situations.logs)?;
        let effects = self.effects(&self.file.effects, "effects", &robot)?;
        let (targets, simulations) = self.parameters(&robot, &effects, &setup)?;
        let drive = self.drive(&robot)?;
        Ok(Model {
            fitness: self.fitness(&robot)?,
            robot,
            effects,
            setup,
            targets,
            simulations,
            drive,
            scenarios: situations.scenarios,
            learn: situations.learn,
            rollouts: AtomicU64::new(0),
        })
    }

    /// Whether plan, model and reality fit together: better said now than after hours.
    fn check_plan(
        &self,
        plan: &Plan,
        reality: &RealitySection,
        model: &Model,
        recorded: &[Log],
    ) -> Result<(), FileError> {
        if matches!(reality, RealitySection::Logs(_)) && !model.drive.space().is_empty() {
            let help = "take search out of [drive]; whatever it says, the logs' own commands are replayed".to_owned();
            return Err(self.error(&["drive", "search"], "recorded logs leave no controllers to search", Some(help)));
        }
        if !self.file.distances.is_empty() && !model.drive.space().is_empty() {
            let help = "take search out of [drive], or distances out of the file".to_owned();
            let message = "other distances need a fixed drive: with each of them other controllers would be tried";
            return Err(self.error(&["distances"], message, Some(help)));
        }
        Coevolution::new(plan.clone(), 0, model).map_err(|e| self.error(&["coevolve"], &e, Some(remedy(&e))))?;
        let mut distances = std::iter::once(&plan.distance).chain(&self.file.distances);
        let refine = plan.simulators.as_ref().is_some_and(|phase| phase.refine > 0);
        if refine && distances.all(|distance| distance.build().as_squares().is_none()) {
            let help = "take distance = \"rmse\", or refine out of the file".to_owned();
            let message = "only a sum of squares can be refined by least squares";
            return Err(self.error(&["coevolve", "simulators", "refine"], message, Some(help)));
        }
        let distances = [(&["coevolve", "distance"][..], &plan.distance)];
        for (keys, distance) in distances.into_iter().chain(self.file.distances.iter().map(|d| (&["distances"][..], d)))
        {
            self.check_channels(keys, distance, model, recorded)?;
        }
        Ok(())
    }

    /// A distance restricted to channels that nobody has would call everything infinitely far apart.
    fn check_channels(
        &self,
        keys: &[&str],
        distance: &DistanceSpec,
        model: &Model,
        recorded: &[Log],
    ) -> Result<(), FileError> {
        let Some(channels) = distance.channels() else { return Ok(()) };
        let nominal = (model.simulations.nominal(), model.drive.space().nominal());
        // A model that blows up here says so in the run, where failures are counted.
        let Ok(log) = model.simulate(&nominal.0, &nominal.1, 0, None) else { return Ok(()) };
        let known: Vec<&str> = log.channels().filter(|(_, c)| c.role != Role::Truth).map(|(name, _)| name).collect();
        for log in std::iter::once(&log).chain(recorded) {
            if let Some(wrong) = channels.unmatched(log).first() {
                return Err(self.unknown(keys, "channel", wrong, known));
            }
        }
        Ok(())
    }

    pub(super) fn error(&self, keys: &[&str], message: impl std::fmt::Display, help: Option<String>) -> FileError {
        self.source.error(keys, &message.to_string(), help)
    }

    pub(super) fn unknown<'b>(
        &self,
        keys: &[&str],
        what: &str,
        wrong: &str,
        known: impl IntoIterator<Item = &'b str>,
    ) -> FileError {
        let known: Vec<&str> = known.into_iter().collect();
        let help = match nearest(wrong, known.iter().copied()) {
            Some(name) => format!("did you mean `{name}`?"),
            None => format!("known: {}", known.join(", ")),
        };
        self.error(keys, format!("there is no {what} `{wrong}`"), Some(help))
    }
}
