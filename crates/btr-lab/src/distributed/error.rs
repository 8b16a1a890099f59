//! Errors of distributed work, with their type and help on either side of a message.

use crate::experiment::FileError;
use crate::identification::ProblemError;
use btr_core::text::Text;
use btr_core::world::{Cancelled, WorldError};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Both ends must be of the same version: the format of messages is not stable.
pub(super) const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Why a payload cannot be packed, or why a worker cannot answer a batch.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DistributedError {
    /// The payload comes from another version of btr.
    #[error("btr {} cannot work for btr {theirs}: install the same version everywhere", VERSION)]
    Version {
        /// The version of the payload; `of another version` where it cannot be read.
        theirs: String,
    },
    /// A message cannot be encoded or decoded.
    #[error(transparent)]
    Encoding(#[from] postcard::Error),
    /// The distance cannot be encoded or decoded.
    #[error(transparent)]
    Distance(#[from] serde_json::Error),
    /// The model's text is not TOML.
    #[error(transparent)]
    Toml(#[from] toml_edit::TomlError),
    /// A file that the model names, or that a worker writes, cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// Why it cannot be read or written.
        source: std::io::Error,
    },
    /// The packed functions of the model's laws cannot be read by the worker.
    #[error("{0}")]
    Functions(String),
    /// The experiment makes no sense to the worker.
    #[error(transparent)]
    Experiment(#[from] FileError),
    /// The worker cannot build the identification problem.
    #[error(transparent)]
    Problem(#[from] ProblemError),
    /// The payloads do not belong to the batch.
    #[error("{0}")]
    Payload(&'static str),
    /// The work was cancelled: a law's function failed.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The same payload failed before, in another thread that waited for it.
    #[error(transparent)]
    Shared(std::sync::Arc<DistributedError>),
}

impl DistributedError {
    /// How to resolve it.
    pub fn help(&self) -> Option<Text> {
        match self {
            DistributedError::Experiment(error) => error.help.clone(),
            DistributedError::Problem(error) => error.help(),
            DistributedError::Shared(error) => error.help(),
            _ => None,
        }
    }
}

/// A [`WorldError`] in a worker's answer.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) enum SimulationError {
    Diverged { time_s: f64, what: String },
    Law { what: String },
    Setup { what: String },
}

impl From<WorldError> for SimulationError {
    fn from(error: WorldError) -> Self {
        match error {
            WorldError::Diverged { time_s, what } => SimulationError::Diverged { time_s, what },
            WorldError::Law { what } => SimulationError::Law { what },
            WorldError::Setup { what } => SimulationError::Setup { what },
            other => SimulationError::Setup { what: other.to_string() },
        }
    }
}

impl From<SimulationError> for WorldError {
    fn from(error: SimulationError) -> Self {
        match error {
            SimulationError::Diverged { time_s, what } => WorldError::Diverged { time_s, what },
            SimulationError::Law { what } => WorldError::Law { what },
            SimulationError::Setup { what } => WorldError::Setup { what },
        }
    }
}
