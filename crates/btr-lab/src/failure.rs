//! Errors for the user: one message, one `help:` line, one exit code.

use crate::experiment::FileError;
use crate::identification::{Doubt, ProblemError, VerbInput};
use crate::model_text::AddError;
use btr_core::text::{Mention, Text};
use btr_core::world::WorldError;
use btr_identify::quality::Topic;
use std::path::Path;

/// A simulation that diverges sooner than this, in s, was wrong from the beginning.
const AT_ONCE_S: f64 = 0.2;

/// What to do about a law that gave no finite number.
pub const FINITE_LAW: &str = "a law must give a finite number at every point that a search can try";

/// Code of a run whose folder is gone: it was carried out in part.
pub const FOLDER_GONE: &str = "folder_gone";

/// Code of a run that could not write its files, or found those of a test damaged: it was carried out in part.
pub const STORAGE: &str = "storage";

/// Why a verb failed.
#[derive(Debug)]
pub struct Failure {
    /// Machine-readable code.
    pub code: &'static str,
    /// What went wrong.
    pub message: Text,
    /// The remedy.
    pub help: Option<Text>,
}

impl Failure {
    /// A failure with a code, a message and a remedy.
    pub fn new(code: &'static str, message: impl Into<Text>, help: Option<Text>) -> Self {
        Failure { code, message: message.into(), help }
    }

    /// An invalid command line.
    pub fn usage(message: impl Into<Text>) -> Self {
        Failure::new("usage", message, None)
    }

    /// A model or logs that cannot be used; `doubts` are the findings about the logs.
    pub fn input(error: ProblemError, doubts: &[Doubt]) -> Self {
        let (message, help) = (error.to_string(), error.help());
        match error {
            ProblemError::File(error) => error.into(),
            ProblemError::World(error) => Failure::simulation(&error, doubts),
            ProblemError::Add(error) => error.into(),
            ProblemError::FreezesNothing { .. } | ProblemError::NoValueToFreeze(_) => {
                Failure::new("freeze", message, help)
            }
            ProblemError::StartHas { .. } | ProblemError::StartSaysNothing(_) => Failure::new("start", message, help),
            ProblemError::NotPrescribed(_) | ProblemError::FreeLength(_) => {
                Failure::new("base_parameters", message, help)
            }
            ProblemError::Still | ProblemError::Short(_) | ProblemError::Blind | ProblemError::Nothing => {
                Failure::new("log", message, help)
            }
        }
    }

    /// A simulation that failed; `doubts` are the findings about the logs.
    pub fn simulation(error: &WorldError, doubts: &[Doubt]) -> Self {
        let unit = doubts.iter().find(|doubt| doubt.finding.topic == Topic::Unit);
        let help = match (error, unit) {
            (WorldError::Diverged { time_s, .. }, Some(doubt)) if *time_s < AT_ONCE_S => {
                let (channel, sentence) = (&doubt.finding.channel, &doubt.finding.sentence);
                let ending = if channel.starts_with("dq_") { "_deg_s" } else { "_deg" };
                Some(format!("{sentence} A column called {channel}{ending} is read in degrees").into())
            }
            (WorldError::Diverged { .. }, _) => {
                Some("take smaller steps (simulation.steps_per_control), softer gains or heavier links".into())
            }
            (WorldError::Law { .. }, _) => Some(FINITE_LAW.into()),
            _ => None,
        };
        Failure::new("simulation", error.to_string(), help)
    }

    /// The same failure, with the model's file in front of the message.
    #[must_use]
    pub fn of_model(self, model: &Path) -> Self {
        Failure { message: Text::from(format!("{}: ", model.display())) + self.message, ..self }
    }

    /// The same failure; in front of the message of a simulation's stands the model's file.
    #[must_use]
    pub fn of_simulated(self, model: &Path) -> Self {
        if self.code == "simulation" { self.of_model(model) } else { self }
    }

    /// Why there is nothing to fit, where no parameter is free.
    pub fn nothing_to_fit(input: &VerbInput) -> Option<Self> {
        let (message, help) = match (input.problem.free().is_empty(), input.frozen.is_empty()) {
            (false, _) => return None,
            (true, false) => ("all free parameters are frozen", Text::from("leave one of them out, or ")),
            (true, true) => {
                let help = "free some parameters ([parameters] in the model file), or ";
                ("this model has no free parameter", help.into())
            }
        };
        Some(Failure::new("nothing_to_fit", message, Some(help + Mention::AddEffect)))
    }

    /// A model that cannot be simulated at its current values on the logs of the input.
    pub fn simulation_failure(input: &VerbInput, error: &WorldError) -> Self {
        let why = Failure::simulation(error, &input.doubts);
        let message = Text::from("the model diverges on these logs at its current values: ") + why.message;
        Failure { message, ..why }.of_model(&input.source.path)
    }
}

impl From<FileError> for Failure {
    fn from(error: FileError) -> Self {
        Failure::new("file", error.text(), error.help)
    }
}

impl From<btr_io::IoError> for Failure {
    fn from(error: btr_io::IoError) -> Self {
        Failure::new("log", error.to_string(), Some(error.help()))
    }
}

impl From<WorldError> for Failure {
    fn from(error: WorldError) -> Self {
        Failure::simulation(&error, &[])
    }
}

impl From<AddError> for Failure {
    fn from(error: AddError) -> Self {
        let help = error.help();
        Failure::new("add", error.to_string(), help)
    }
}
