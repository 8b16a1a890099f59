//! An experiment ready to run.

use super::build::Builder;
use super::file::{RealitySection, RealitySource};
use super::logs::scenarios::ScenarioSet;
use super::source::{FileError, Source};
use crate::execution::ExecutionContext;
use crate::reality::{FunctionReality, Revealing, RobotFunction};
use btr_core::coevolve::Plan;
use btr_core::distance::DistanceSpec;
use btr_core::log::Log;
use btr_physics::model::Model;
use std::path::Path;
use std::sync::Arc;

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
    /// How long it is worked on, and by whom.
    pub context: Arc<ExecutionContext>,
    pub(super) source: Source,
    robot: Option<RobotFunction>,
}

impl Experiment {
    /// Builds the experiment; real tests are kept under `folder`.
    ///
    /// # Errors
    /// Whatever does not make sense, at its line.
    pub fn new(source: Source, seed: Option<u64>, folder: &Path) -> Result<Self, FileError> {
        Experiment::on(source, seed, folder, None, Arc::default())
    }

    /// The same with a robot of its own, whatever `[reality]` says, and with somebody who does the work.
    ///
    /// # Errors
    /// See [`new`](Self::new).
    pub fn on(
        source: Source,
        seed: Option<u64>,
        folder: &Path,
        robot: Option<RobotFunction>,
        context: Arc<ExecutionContext>,
    ) -> Result<Self, FileError> {
        let file = source.parse()?;
        let seed = seed.unwrap_or(file.seed);
        let plan = file.coevolve.clone().ok_or_else(|| missing(&source, "coevolve"))?;
        let builder = Builder { file: &file, source: &source };
        let section = match robot {
            Some(_) => RealitySection::Manual {},
            None => file.reality.clone().ok_or_else(|| missing(&source, "reality"))?,
        };
        let situations = builder.situations(&section)?;
        let (recorded, warnings) = (situations.logs.clone(), situations.warnings.clone());
        let model = Arc::new(builder.model(situations)?);
        builder.check_plan(&plan, &section, &model, &recorded)?;
        let reality = match &robot {
            Some(robot) => Box::new(FunctionReality::new(robot.clone(), model.clone(), builder.store(&model, folder))),
            None => builder.reality(&section, &model, &recorded, seed, folder)?,
        };
        let stated = model.setup.noise.by_channel();
        let (name, mut plan, mut distances) = (file.name.clone(), plan, file.distances.clone());
        std::iter::once(&mut plan.distance).chain(&mut distances).for_each(|distance| distance.with_noise(&stated));
        Ok(Experiment { name, seed, model, plan, reality, recorded, distances, warnings, context, source, robot })
    }

    /// Becomes the experiment of another text, with the same robot and the same hands.
    ///
    /// # Errors
    /// Whatever does not make sense, at its line.
    pub(crate) fn restart(&mut self, text: String, folder: &Path) -> Result<(), FileError> {
        let source = Source { text, ..self.source.clone() };
        *self = Experiment::on(source, Some(self.seed), folder, self.robot.clone(), self.context.clone())?;
        Ok(())
    }

    /// What identifies the experiment: its text with all settings, its seed, and whether a robot of its own stands for
    /// what the text says of reality. Which one that is nobody can tell.
    pub fn stamp(&self) -> String {
        let robot = if self.has_robot() { ", reality is a function" } else { "" };
        format!("# --seed {}{robot}\n{}", self.seed, self.source.text)
    }

    /// Whether a robot of its own stands for what the file says of reality.
    pub fn has_robot(&self) -> bool {
        self.robot.is_some()
    }

    /// What answers real tests.
    pub(crate) fn reality_source(&self) -> RealitySource {
        if self.has_robot() { RealitySource::Function } else { RealitySource::File }
    }

    /// Goes on with a larger S: `text` is the file with further parameters. Reality stays what it was, so that a hidden
    /// twin neither gains nor loses anything by what its simulations are given.
    ///
    /// # Errors
    /// Whatever does not make sense, at its line.
    pub fn enlarge(&mut self, text: String) -> Result<(), FileError> {
        let source = Source { text, ..self.source.clone() };
        let situations = ScenarioSet {
            scenarios: self.model.scenarios.clone(),
            learn: self.model.learn,
            logs: self.recorded.clone(),
            warnings: Vec::new(),
        };
        self.model = Arc::new(Builder { file: &source.parse()?, source: &source }.model(situations)?);
        self.source = source;
        Ok(())
    }

    /// The file it came from.
    pub fn source(&self) -> &Source {
        &self.source
    }
}

fn missing(source: &Source, section: &str) -> FileError {
    source.error(&[], &format!("there is no [{section}]"), Some(needs(section)))
}

fn needs(section: &str) -> String {
    match section {
        "coevolve" => "add [coevolve] with iterations and distance; robots/pendulum.toml is a short example",
        _ => "add [reality] with kind = \"twin\", \"logs\", \"command\" or \"manual\"",
    }
    .to_owned()
}
