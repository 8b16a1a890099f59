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
    /// The model with S and C.
    pub model: Arc<Model>,
    /// The loop's plan.
    pub plan: Plan,
    /// The reality that carries out real tests.
    pub reality: Box<dyn Revealing>,
    /// Recorded logs in the order of the model's scenarios, held-out ones last; empty for other realities.
    pub recorded: Vec<Log>,
    /// Further distances with which the identification is repeated.
    pub distances: Vec<DistanceSpec>,
    /// Warnings of the readers of the recorded logs.
    pub warnings: Vec<String>,
    /// Execution context: cancellation and workers.
    pub context: Arc<ExecutionContext>,
    pub(super) source: Source,
    robot: Option<RobotFunction>,
}

impl Experiment {
    /// Builds the experiment; real tests are kept under `folder`.
    ///
    /// # Errors
    /// An invalid file, at its line.
    pub fn new(source: Source, seed: Option<u64>, folder: &Path) -> Result<Self, FileError> {
        Experiment::on(source, seed, folder, None, Arc::default())
    }

    /// The same with a robot function that replaces `[reality]`, and with an execution context.
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
        let builder = Builder::new(&file, &source);
        let section = match robot {
            Some(_) => RealitySection::Manual {},
            None => file.reality.clone().ok_or_else(|| missing(&source, "reality"))?,
        };
        let situations = builder.situations(&section)?;
        let recorded = situations.logs.clone();
        let warnings = [builder.robot_with_warnings()?.1, situations.warnings.clone()].concat();
        let model = Arc::new(builder.model(situations)?);
        builder.check_plan(&plan, &section, &model, &recorded)?;
        let reality = match &robot {
            Some(robot) => Box::new(FunctionReality::new(robot.clone(), model.clone(), builder.store(&model, folder))),
            None => builder.reality(&section, &model, &recorded, seed, folder, &context)?,
        };
        let stated = model.setup.noise.by_channel();
        let (name, mut plan, mut distances) = (file.name.clone(), plan, file.distances.clone());
        std::iter::once(&mut plan.distance).chain(&mut distances).for_each(|distance| distance.with_noise(&stated));
        Ok(Experiment { name, seed, model, plan, reality, recorded, distances, warnings, context, source, robot })
    }

    /// Replaces the experiment by that of another text, with the same robot function and execution context.
    ///
    /// # Errors
    /// An invalid file, at its line.
    pub(crate) fn restart(&mut self, text: String, folder: &Path) -> Result<(), FileError> {
        let source = Source { text, ..self.source.clone() };
        *self = Experiment::on(source, Some(self.seed), folder, self.robot.clone(), self.context.clone())?;
        Ok(())
    }

    /// Identifies the experiment: its text with all settings, its seed, and whether a robot function replaces
    /// `[reality]`. The function itself cannot be identified.
    pub fn stamp(&self) -> String {
        let robot = if self.has_robot() { ", reality is a function" } else { "" };
        format!("# --seed {}{robot}\n{}", self.seed, self.source.text)
    }

    /// Whether a robot function replaces `[reality]`.
    pub fn has_robot(&self) -> bool {
        self.robot.is_some()
    }

    /// What carries out real tests.
    pub(crate) fn reality_source(&self) -> RealitySource {
        if self.has_robot() { RealitySource::Function } else { RealitySource::File }
    }

    /// Enlarges S: `text` is the file with further parameters. Reality stays unchanged, so that effects added to the
    /// simulations do not change a hidden twin.
    ///
    /// # Errors
    /// An invalid file, at its line.
    pub fn enlarge(&mut self, text: String) -> Result<(), FileError> {
        let source = Source { text, ..self.source.clone() };
        let situations = ScenarioSet {
            scenarios: self.model.scenarios.clone(),
            learn: self.model.learn,
            logs: self.recorded.clone(),
            warnings: Vec::new(),
        };
        let file = source.parse()?;
        self.model = Arc::new(Builder::driven_like(&self.model, &file, &source).model(situations)?);
        self.source = source;
        Ok(())
    }

    /// The file it came from.
    pub fn source(&self) -> &Source {
        &self.source
    }
}

fn missing(source: &Source, section: &str) -> FileError {
    source.error(&[], &format!("there is no [{section}]"), Some(needs(section).into()))
}

fn needs(section: &str) -> &'static str {
    match section {
        "coevolve" => "add [coevolve] with iterations and distance; robots/pendulum.toml is a short example",
        _ => "add [reality] with kind = \"twin\", \"logs\", \"command\" or \"manual\"",
    }
}
