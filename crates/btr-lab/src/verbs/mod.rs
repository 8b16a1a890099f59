//! What people ask of a model and its logs: what they are worth, which effect is missing, add it, fit. The command line
//! and Python call these.

mod add;
mod check;
mod compare;
mod diagnose;
mod effects;
mod fit;
mod held_out;
mod next_experiment;
mod own_law;

pub use add::{AddError, Addition, add};
pub use check::{CheckReport, IdentifiabilityReport, check};
pub use compare::{CompareReport, compare};
pub use diagnose::{DiagnoseReport, EffectReport, EffectSite, LawReport, diagnose};
pub use effects::{effects, named, site};
pub use fit::{FitReport, fit};
pub use held_out::HeldOutLogs;
pub use next_experiment::{NextExperiment, RivalExplanation, next_experiment};
pub use own_law::{OwnLaw, OwnNumber, add_law};

use crate::experiment::{CheckedLog, FileError, LogSource, Replays, Source, replays};
use crate::identification::IdentificationProblem;
use btr_core::log::Log;
use btr_core::world::WorldError;
use btr_identify::quality::{FEWEST_SAMPLES, Finding};
use serde::Serialize;
use std::sync::Arc;

/// A model beside the logs it is asked about.
pub struct VerbInput {
    /// The model's text.
    pub source: Source,
    /// The model, the logs, and everything that may be varied.
    pub problem: IdentificationProblem,
    /// What makes answers doubtful.
    pub doubts: Vec<Doubt>,
    /// Joints of which nothing is measured: no answer is about them.
    pub not_judged: Vec<String>,
}

/// Something that a look at a log found and that makes answers doubtful.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Doubt {
    /// The log's path.
    pub log: String,
    /// What was found in it.
    #[serde(flatten)]
    pub finding: Finding,
}

/// What makes answers from these logs doubtful.
pub fn doubts(replays: &Replays) -> Vec<Doubt> {
    let of = |checked: &CheckedLog| {
        let log = checked.log.clone();
        checked.quality.doubts().map(|finding| Doubt { log: log.clone(), finding: finding.clone() }).collect::<Vec<_>>()
    };
    replays.checked.iter().flat_map(of).collect()
}

/// Why a question cannot be asked.
#[derive(Debug, thiserror::Error)]
pub enum ProblemError {
    /// The model file or a log makes no sense.
    #[error(transparent)]
    File(#[from] FileError),
    /// The model cannot be simulated.
    #[error(transparent)]
    World(#[from] WorldError),
    /// What was to be added does not fit the model.
    #[error(transparent)]
    Add(#[from] AddError),
    /// Logs in which nothing happens.
    #[error("nothing moves in the logs to learn from: they tell nothing about the model")]
    Still,
    /// Logs that end before they tell anything.
    #[error("the longest log to learn from has {0} samples: too few to tell anything")]
    Short(usize),
    /// Logs that say nothing of what the robot did.
    #[error("no joint's position is measured in the logs to learn from")]
    Blind,
    /// Logs that have nothing in common with a simulation.
    #[error("no channel is both measured and simulated")]
    Nothing,
}

impl ProblemError {
    /// What to do about it, where that is not said in the file's terms.
    pub fn help(&self) -> Option<String> {
        match self {
            ProblemError::Still => {
                Some("record the joints while they are driven; `btr check` tells what is in a log".to_owned())
            }
            ProblemError::Short(_) => {
                Some(format!("record some seconds of motion, {FEWEST_SAMPLES} samples at the very least"))
            }
            ProblemError::Nothing => Some(
                "the log needs a position q_<joint> for the model's joints; [channels] maps foreign names".to_owned(),
            ),
            ProblemError::Blind => Some(
                "the logs need positions q_<joint>; [channels.channels] in the model file maps foreign names"
                    .to_owned(),
            ),
            _ => None,
        }
    }
}

impl VerbInput {
    /// Reads the logs and puts the model beside them; without held-out logs, the last part of each log is held out.
    ///
    /// # Errors
    /// Whatever does not make sense in the file or the logs; a model that blows up as it stands.
    pub fn new<L: Clone + Into<LogSource>>(source: Source, learn: &[L], held_out: &[L]) -> Result<Self, ProblemError> {
        let replays = replays(&source, learn, held_out)?;
        VerbInput::of(source, replays)
    }

    /// The same for logs that were read before.
    ///
    /// # Errors
    /// Logs in which nothing moves or is measured; a model that blows up as it stands.
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
        let problem = IdentificationProblem::new(Arc::new(replays.model), replays.logs, &[])?;
        Ok(VerbInput { source, problem, doubts, not_judged })
    }

    /// The same with effects added to the model, their bounds made for what the robot does in the logs; `replays` are these
    /// without.
    ///
    /// # Errors
    /// See [`new`](Self::new); an effect or a site that is not there.
    pub fn with<L: Clone + Into<LogSource>>(
        source: Source,
        replays: Replays,
        additions: &[String],
        learn: &[L],
        held_out: &[L],
    ) -> Result<Self, ProblemError> {
        let bare = VerbInput::of(source, replays)?;
        if additions.is_empty() {
            return Ok(bare);
        }
        let robot = &bare.problem.model().robot;
        let additions: Vec<Addition> =
            additions.iter().map(|text| Addition::parse(text, robot)).collect::<Result<_, _>>()?;
        let text = add::add_scaled(&bare.source, bare.problem.scales(), &additions)?;
        VerbInput::new(Source { text, ..bare.source }, learn, held_out)
    }
}

/// The noise floor of each measured channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NoiseFloor {
    /// The channel.
    pub channel: String,
    /// Its unit.
    pub unit: String,
    /// Standard deviation of its readings' errors.
    pub sigma: f64,
    /// Whether that is a guess, for readings without any noise.
    pub assumed: bool,
}

impl VerbInput {
    /// The noise floors that errors are measured in: of each channel in the first log that has it.
    pub fn floors(&self) -> Vec<NoiseFloor> {
        let mut floors: Vec<NoiseFloor> = Vec::new();
        for channel in self.problem.logs().iter().flat_map(|log| &log.channels) {
            if floors.iter().all(|floor| floor.channel != channel.name) {
                let (name, unit) = (channel.name.clone(), channel.unit.clone());
                let assumed = self.problem.is_assumed(&name);
                floors.push(NoiseFloor { channel: name, unit, sigma: channel.sigma, assumed });
            }
        }
        floors
    }
}
