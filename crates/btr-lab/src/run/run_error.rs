//! Errors of a run.

use crate::distributed::DistributedError;
use crate::experiment::FileError;
use crate::failure::Failure;
use crate::model_text::AddError;
use btr_core::coevolve::PlanError;
use btr_core::world::Cancelled;
use std::path::PathBuf;

/// Why a run cannot begin or continue.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The experiment file is invalid.
    #[error(transparent)]
    File(#[from] FileError),
    /// The plan does not fit the experiment.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The folder already holds a run.
    #[error("{} already contains a run", .0.display())]
    Exists(PathBuf),
    /// The folder contains no run to resume.
    #[error("{} contains no run to resume", .0.display())]
    NoRun(PathBuf),
    /// The experiment is not the one the run began with.
    #[error("the experiment differs from the one that {} was started with", .0.display())]
    OtherExperiment(PathBuf),
    /// A checkpoint of another version, or a damaged one.
    #[error("{} is not a checkpoint of this version: {why}", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// An effect that cannot be added to S.
    #[error(transparent)]
    Augment(#[from] AddError),
    /// A completed real test whose log is missing.
    #[error("{0}")]
    LostTest(String),
    /// The experiment cannot be packed for workers.
    #[error(transparent)]
    Distributed(#[from] DistributedError),
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The path.
        path: PathBuf,
        /// The underlying error.
        source: std::io::Error,
    },
}

impl RunError {
    /// The remedy.
    pub fn help(&self) -> Option<String> {
        match self {
            RunError::File(error) => error.help.clone(),
            RunError::Exists(_) => Some("go on with --resume, or choose another --out".to_owned()),
            RunError::NoRun(_) => Some("start it without --resume".to_owned()),
            RunError::OtherExperiment(path) => Some(format!(
                "resume with the file, --set and --seed that {} shows, perhaps with further parameters after the existing ones (`btr add`), \
                 or choose another --out",
                path.join("experiment.toml").display()
            )),
            RunError::Checkpoint { .. } => {
                Some("choose another --out; the real tests in transfers/ are untouched".to_owned())
            }
            RunError::LostTest(_) => Some("put the log back into its folder under transfers/".to_owned()),
            RunError::Augment(error) => error.help(),
            RunError::Distributed(error) => error.help(),
            RunError::Plan(_) | RunError::Cancelled(_) | RunError::Io { .. } => None,
        }
    }
}

impl From<RunError> for Failure {
    fn from(error: RunError) -> Self {
        Failure::new("run", error.to_string(), error.help())
    }
}
