//! A model with the logs of a command.

mod floors;
mod freeze;
mod glitches;
mod idle;
mod start;

pub use floors::{ErrorUnit, NoiseFloor};
pub use glitches::FittedGlitch;
pub use start::{FitOptions, StartModel};

use super::problem::IdentificationProblem;
use super::problem_error::ProblemError;
use crate::experiment::{CheckedLog, LeftOutLog, LogPlace, LogSource, Recordings, Replays, Source, replays};
use crate::model_text::{Addition, add_scaled};
use btr_core::log::Log;
use btr_identify::fit::StartValues;
use btr_identify::quality::{FEWEST_SAMPLES, Finding, FindingCause};
use indexmap::{IndexMap, IndexSet};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;

/// The input of a verb: a model and its logs.
pub struct VerbInput {
    /// The model's text.
    pub source: Source,
    /// The identification problem of the model and the logs.
    pub problem: IdentificationProblem,
    /// Findings that make results doubtful.
    pub doubts: Vec<Doubt>,
    /// Joints without measurements: results do not cover them.
    pub not_judged: Vec<String>,
    /// Parameters of effects that were added to the model, by name.
    added: Vec<String>,
    /// The input before they were added.
    pub before: Option<Box<VerbInput>>,
    /// The coordinates of the model's own parameters at which a fit begins, where another model states them.
    pub(crate) start: Option<StartValues>,
    /// Parameters that keep the model's values, by name.
    pub frozen: Vec<String>,
    /// Logs that could not be used.
    pub left_out: Vec<LeftOutLog>,
    /// The logs as they were read.
    pub recordings: Recordings,
    /// Where the log of each of the problem's scenarios is in its file.
    places: Vec<LogPlace>,
}

/// A finding about a log that makes results doubtful.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Doubt {
    /// The log's path.
    pub log: String,
    /// The finding.
    #[serde(flatten)]
    pub finding: Finding,
}

impl Doubt {
    /// Whether it is about how a joint follows its command, which only a simulation can judge: a model may explain it.
    pub fn awaits_a_model(&self) -> bool {
        self.finding.cause == Some(FindingCause::Late)
    }

    /// Whether a model dispels it that explains the positions of these joints: it moves as late as the robot.
    pub fn is_dispelled(&self, explains: impl Fn(&str) -> bool) -> bool {
        self.awaits_a_model() && explains(&self.finding.channel)
    }
}

/// The findings about logs that make results doubtful.
pub fn doubts(replays: &Replays) -> Vec<Doubt> {
    let of = |checked: &CheckedLog| {
        let log = checked.log.clone();
        checked.quality.doubts().map(|finding| Doubt { log: log.clone(), finding: finding.clone() }).collect::<Vec<_>>()
    };
    replays.checked.iter().flat_map(of).collect()
}

impl VerbInput {
    /// Reads the logs and assembles the problem; without held-out logs, the last part of each log is held out.
    ///
    /// # Errors
    /// An invalid file or log; a model that diverges at its current values.
    pub fn new<L: Clone + Into<LogSource>>(source: Source, learn: &[L], held_out: &[L]) -> Result<Self, ProblemError> {
        let replays = replays(&source, learn, held_out)?;
        VerbInput::of(source, replays)
    }

    /// The same for logs that were read before.
    ///
    /// # Errors
    /// Logs in which nothing moves or is measured; a model that diverges at its current values.
    pub fn of(source: Source, replays: Replays) -> Result<Self, ProblemError> {
        let (doubts, not_judged) = (doubts(&replays), replays.not_judged());
        if not_judged.len() == replays.model.robot.movable().count() {
            return Err(ProblemError::Blind);
        }
        if !replays.is_moving() {
            return Err(ProblemError::Still);
        }
        let longest = replays.logs.iter().take(replays.model.learn).map(Log::len).max().unwrap_or(0);
        if longest < FEWEST_SAMPLES {
            return Err(ProblemError::Short(longest));
        }
        let means_of = replays.recordings.learn.iter().map(|read| read.means_of).max().unwrap_or(1);
        let problem = IdentificationProblem::new(Arc::new(replays.model), replays.logs, &[])?.of_means(means_of);
        let problem = problem.with_floors_of_each_log();
        let problem = if replays.keeps_glitches { problem } else { problem.searching_glitches() };
        let (added, frozen) = (Vec::new(), Vec::new());
        let Replays { left_out, recordings, places, .. } = replays;
        let (before, start) = (None, None);
        Ok(VerbInput {
            source,
            problem,
            doubts,
            not_judged,
            added,
            before,
            start,
            frozen,
            left_out,
            recordings,
            places,
        })
    }

    /// The same with effects added to the model, their bounds scaled to the robot's motion in the logs; `replays` is
    /// the model without them.
    ///
    /// # Errors
    /// See [`new`](Self::new); an unknown effect or site.
    pub fn with(source: Source, replays: Replays, additions: &[String]) -> Result<Self, ProblemError> {
        let bare = VerbInput::of(source, replays)?;
        if additions.is_empty() {
            return Ok(bare);
        }
        let robot = &bare.problem.model().robot;
        let additions: Vec<Addition> =
            additions.iter().map(|text| Addition::parse(text, robot)).collect::<Result<_, _>>()?;
        let text = add_scaled(&bare.source, bare.problem.scales(), &additions)?;
        let known = names(&bare.problem);
        let Recordings { learn, held_out } = &bare.recordings;
        let input = VerbInput::new(Source { text, ..bare.source.clone() }, learn, held_out)?;
        let added = names(&input.problem).into_iter().filter(|name| !known.contains(name)).collect();
        Ok(VerbInput { left_out: bare.left_out.clone(), added, before: Some(Box::new(bare)), ..input })
    }

    /// The training logs and the held-out logs that are used: files, or names.
    pub fn logs_used(&self) -> [Vec<PathBuf>; 2] {
        let Recordings { learn, held_out } = &self.recordings;
        [learn, held_out].map(|logs| logs.iter().map(|log| log.path.clone()).collect())
    }

    /// The free parameters' values in the model, but those of effects that were added.
    pub(crate) fn in_model(&self) -> IndexMap<String, f64> {
        let model = &self.problem.model().simulations;
        let values = model.dims().iter().zip(model.nominal()).map(|(dim, value)| (dim.name.clone(), value));
        values.filter(|(name, _)| !self.added.contains(name)).collect()
    }

    /// What was added to the model, as `effect@site`, or as a value's name.
    pub fn added_effects(&self) -> IndexSet<String> {
        let of = |name: &String| match (name.split_once('.'), name.split_once('@')) {
            (Some((effect, _)), Some((_, site))) => format!("{effect}@{site}"),
            _ => name.clone(),
        };
        self.added.iter().map(of).collect()
    }

    /// The file of a log of the problem.
    pub(crate) fn file_of(&self, log: usize) -> Option<String> {
        Some(self.places.get(self.problem.scenario(log))?.file.clone())
    }
}

/// Names of the free parameters.
fn names(problem: &IdentificationProblem) -> Vec<String> {
    problem.model().simulations.dims().iter().map(|dim| dim.name.clone()).collect()
}
