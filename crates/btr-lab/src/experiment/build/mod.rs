//! From what is written to what can be run.

mod drive;
mod model;
mod reality;

use super::file::{File, RealitySection};
use super::logs::scenarios;
use super::logs::scenarios::ScenarioSet;
use super::parse::{FileError, Source, suggestion};
use crate::distributed::ExecutionContext;
use crate::reality::{FunctionReality, Revealing, TestFailure, TestRequest};
use btr_core::coevolve::{Coevolution, Plan};
use btr_core::distance::DistanceSpec;
use btr_core::log::{Log, Role};
use btr_core::world::{Trial, WorldError};
use btr_identify::quality;
use btr_physics::drive::Replay;
use btr_physics::model::{Model, Scenario};
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
    /// How long it is worked on, and by whom.
    pub context: Arc<ExecutionContext>,
    source: Source,
    robot: Option<RobotFunction>,
}

/// A robot, or whatever stands for one: plays the references of a controller and gives back what it did.
pub type RobotFunction = Arc<dyn Fn(&TestRequest) -> Result<Log, TestFailure> + Send + Sync>;

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

    /// What identifies the experiment: its text with all settings, its seed, and whether a robot of its own stands for what
    /// the text says of reality. Which one that is nobody can tell.
    pub fn stamp(&self) -> String {
        let robot = if self.has_robot() { ", reality is a function" } else { "" };
        format!("# --seed {}{robot}\n{}", self.seed, self.source.text)
    }

    /// Whether a robot of its own stands for what the file says of reality.
    pub fn has_robot(&self) -> bool {
        self.robot.is_some()
    }

    /// Goes on with a larger S: `text` is the file with further parameters. Reality stays what it was, so that a hidden twin
    /// neither gains nor loses anything by what its simulations are given.
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

    /// The model with real tests as its scenarios, the first `learn` of them to learn from: what the robot was told, from
    /// where every test begins.
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
            None => Ok(whole(log, &self.model.references(&trial.controller, trial.scenario)?)),
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
            references = corrected(&references, log);
        }
        // References are led or held from tick to tick as the run has them; what a log says of that, sample by sample, is held
        // only where it is something else than what was asked for.
        let as_asked = quality::check_references(&references, log).is_none();
        let replay = match as_asked {
            true => Replay::new(&references, &self.model.robot),
            false => Replay::new(&told(log, &references), &self.model.robot),
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

    /// The file it came from.
    pub fn source(&self) -> &Source {
        &self.source
    }
}

/// A log that has lost the beginning of its test, with rows for it: what the robot was told, and no readings.
fn whole(log: &Log, references: &Log) -> Log {
    let (Some(&first_s), Some(step_s)) = (log.clock_s().first(), log.usual_step_s()) else { return log.clone() };
    let rows = (first_s / step_s - 0.5).ceil().max(0.0) as usize;
    let lost_s: Vec<f64> = (0..rows).map(|k| first_s * k as f64 / rows as f64).collect();
    let Ok(mut whole) = Log::new(lost_s.iter().chain(log.clock_s()).copied().collect()) else { return log.clone() };
    for (name, channel) in log.channels() {
        let asked = references.channel(name).filter(|_| channel.role == Role::Command);
        let lost = asked.map_or_else(
            || vec![f64::NAN; rows],
            |asked| lost_s.iter().map(|t| asked.values[held(references, *t)]).collect(),
        );
        // The length is the clock's own.
        let _ = whole.insert(name, &channel.unit, channel.role, [lost, channel.values.clone()].concat());
    }
    whole
}

/// Which row of `references` is held at a time.
fn held(references: &Log, time_s: f64) -> usize {
    references.clock_s().partition_point(|r| *r <= time_s + 1e-9).saturating_sub(1)
}

/// A log with what the robot was told, by the controller's references where the log does not say it.
pub(crate) fn told(log: &Log, references: &Log) -> Log {
    let mut told = log.clone();
    for (name, channel) in references.channels().filter(|(name, _)| log.channel(name).is_none()) {
        // Each reference holds until the next one.
        let values = log.clock_s().iter().map(|t| channel.values[held(references, *t)]).collect();
        // The length is the clock's own.
        let _ = told.insert(name, &channel.unit, Role::Command, values);
    }
    told
}

/// References as a policy corrected them, by what a log says at their ticks.
fn corrected(references: &Log, log: &Log) -> Log {
    let mut corrected = references.clone();
    let ticks_s = references.clock_s();
    for (name, channel) in references.channels() {
        let Some(told) = log.channel(name) else { continue };
        let values = btr_core::log::interpolate(log.clock_s(), &told.values, ticks_s);
        // The length is the clock's own.
        let _ = corrected.insert(name, &channel.unit, Role::Command, values);
    }
    corrected
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

/// A file on its way to a model.
pub(super) struct Builder<'a> {
    pub(super) file: &'a File,
    pub(super) source: &'a Source,
}

/// The simulations of an experiment, without reality and plan; `robot` where a robot of its own stands for what the file says
/// of reality.
///
/// # Errors
/// Whatever does not make sense, at its line.
pub fn simulations(source: &Source, robot: bool) -> Result<Model, FileError> {
    let file = source.parse()?;
    let builder = Builder { file: &file, source };
    let situations = match file.reality.as_ref().filter(|_| !robot) {
        Some(section) => builder.situations(section)?,
        None => ScenarioSet::single(file.simulation.duration_s),
    };
    builder.model(situations)
}

impl Builder<'_> {
    /// Recorded logs are a situation each; for other realities there is one.
    fn situations(&self, reality: &RealitySection) -> Result<ScenarioSet, FileError> {
        match reality {
            RealitySection::Logs(logs) => scenarios::from_logs(logs, self.file, self.source, &self.robot()?),
            _ => Ok(ScenarioSet::single(self.file.simulation.duration_s)),
        }
    }

    pub(super) fn model(&self, situations: ScenarioSet) -> Result<Model, FileError> {
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
        Coevolution::new(plan.clone(), 0, model).map_err(|e| self.refused(&e, model))?;
        self.check_descriptors(plan, model)?;
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
        let Ok(log) = model.simulate(model.request(&nominal.0, 0).controller(&nominal.1)) else { return Ok(()) };
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
        let near = suggestion(wrong, known.iter().copied());
        let help = near.unwrap_or_else(|| format!("known: {}", known.join(", ")));
        self.error(keys, format!("there is no {what} `{wrong}`"), Some(help))
    }
}
