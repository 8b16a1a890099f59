//! Errors at the edge: one message, one `help:` line, one exit code.

use btr_core::world::WorldError;
use btr_identify::quality::Topic;
use btr_lab::verbs::{Doubt, Problem, ProblemError};

/// Exit code of a run that was done.
pub(crate) const DONE: u8 = 0;
/// Exit code of a run that was done but missed the goal it was given.
pub(crate) const MISSED: u8 = 1;
/// Exit code of a run that was interrupted.
pub(crate) const INTERRUPTED: u8 = 130;
/// Exit code of everything that cannot be done.
pub(crate) const REFUSED: u8 = 2;

/// A simulation that blows up sooner than this, in s, was wrong from the beginning.
const AT_ONCE_S: f64 = 0.2;

/// Why a verb could not do its work.
#[derive(Debug)]
pub struct Failure {
    code: &'static str,
    /// What went wrong.
    pub message: String,
    /// What to do about it.
    pub help: Option<String>,
}

impl Failure {
    /// A failure of some kind, with what to do about it.
    pub(crate) fn new(code: &'static str, message: impl Into<String>, help: Option<String>) -> Self {
        Failure { code, message: message.into(), help }
    }

    /// A command line that makes no sense.
    pub(crate) fn usage(message: impl Into<String>) -> Self {
        Failure::new("usage", message, None)
    }

    /// A question that cannot be asked about logs of which this is doubtful.
    pub(crate) fn problem(error: ProblemError, doubts: &[Doubt]) -> Self {
        let (message, help) = (error.to_string(), error.help());
        match error {
            ProblemError::File(error) => error.into(),
            ProblemError::World(error) => Failure::simulation(&error, doubts),
            ProblemError::Add(error) => error.into(),
            ProblemError::Still | ProblemError::Short(_) | ProblemError::Blind | ProblemError::Nothing => {
                Failure::new("log", message, help)
            }
        }
    }

    /// A simulation that could not be done, of logs of which this is doubtful.
    pub(crate) fn simulation(error: &WorldError, doubts: &[Doubt]) -> Self {
        let unit = doubts.iter().find(|doubt| doubt.finding.topic == Topic::Unit);
        let help = match (error, unit) {
            (WorldError::BlewUp { time_s, .. }, Some(doubt)) if *time_s < AT_ONCE_S => {
                let (channel, sentence) = (&doubt.finding.channel, &doubt.finding.sentence);
                let ending = if channel.starts_with("dq_") { "_deg_s" } else { "_deg" };
                Some(format!("{sentence} A column called {channel}{ending} is read in degrees"))
            }
            (WorldError::BlewUp { .. }, _) => {
                Some("take smaller steps (simulation.steps_per_control), softer gains or heavier links".to_owned())
            }
            (WorldError::Law { .. }, _) => Some("a law gives a finite number wherever a search may look".to_owned()),
            _ => None,
        };
        Failure::new("simulation", error.to_string(), help)
    }

    /// A model that blows up on the logs of a question.
    pub fn blown(problem: &Problem) -> Self {
        let message = "the model blows up on these logs as it stands";
        match problem.trouble() {
            Some(error) => {
                let why = Failure::simulation(&error, &problem.doubts);
                Failure { message: format!("{message}: {}", why.message), ..why }
            }
            None => Failure::new("simulation", message, Some("simulate it with the same logs to see where".to_owned())),
        }
    }

    /// Says it on stderr, or as a JSON document on stdout.
    pub(crate) fn report(&self, json: bool) -> u8 {
        if json {
            let error = serde_json::json!({ "code": self.code, "message": self.message, "help": self.help });
            println!("{}", serde_json::json!({ "ok": false, "error": error }));
        } else {
            eprintln!("error: {}", self.message);
            if let Some(help) = &self.help {
                eprintln!("help: {help}");
            }
        }
        REFUSED
    }
}

impl From<btr_lab::experiment::FileError> for Failure {
    fn from(error: btr_lab::experiment::FileError) -> Self {
        Failure::new("file", error.to_string(), error.help)
    }
}

impl From<btr_lab::run::RunError> for Failure {
    fn from(error: btr_lab::run::RunError) -> Self {
        Failure::new("run", error.to_string(), error.help())
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

impl From<btr_lab::verbs::AddError> for Failure {
    fn from(error: btr_lab::verbs::AddError) -> Self {
        let help = error.help();
        Failure::new("add", error.to_string(), help)
    }
}
