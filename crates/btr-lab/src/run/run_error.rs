//! Errors of a run.

use crate::distributed::DistributedError;
use crate::experiment::FileError;
use crate::failure::{FOLDER_GONE, Failure, STORAGE};
use crate::model_text::AddError;
use btr_core::coevolve::PlanError;
use btr_core::text::{Mention, Text, Verb};
use btr_core::world::Cancelled;
use std::path::PathBuf;

/// Why a run cannot begin or continue.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
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
    /// Another process works in the folder.
    #[error("{} is in use by another run{}", folder.display(), of_process(*pid))]
    InUse {
        /// The folder.
        folder: PathBuf,
        /// The process, if it is known.
        pid: Option<u32>,
    },
    /// The folder is gone; what was in memory is kept in another one.
    #[error("{} is gone: the run and its real tests are kept in {}", folder.display(), rescued.display())]
    FolderGone {
        /// The folder.
        folder: PathBuf,
        /// The new folder.
        rescued: PathBuf,
    },
    /// The folder is gone, and what was in memory could not be kept.
    #[error("{} is gone, and the run could not be kept in {}: {why}", folder.display(), rescued.display())]
    Lost {
        /// The folder.
        folder: PathBuf,
        /// Where the run was to be kept.
        rescued: PathBuf,
        /// Why it could not.
        why: String,
    },
    /// The folder contains no run to resume.
    #[error("{} contains no run to resume", .0.display())]
    NoRun(PathBuf),
    /// The folder contains no run to show.
    #[error("{} contains no run of an experiment", .0.display())]
    NotARun(PathBuf),
    /// The experiment is not the one the run began with.
    #[error("the experiment differs from the one that {} was started with", .0.display())]
    OtherExperiment(PathBuf),
    /// Neither the checkpoint nor the experiment belongs to the experiment in the folder.
    #[error("{} is not the experiment that {} was written for", .0.join("experiment.toml").display(), .0.join("checkpoint.bin").display())]
    OtherStamp(PathBuf),
    /// A checkpoint of another version of the format.
    #[error("{} was written by another version of btr (its format is {version})", path.display())]
    OtherVersion {
        /// The file.
        path: PathBuf,
        /// The version of its format.
        version: u8,
    },
    /// A file that could not be written once the run had begun.
    #[error("{0}; the run stands as it was a step before")]
    Unwritable(Box<RunError>),
    /// A log that could not be written.
    #[error(transparent)]
    Log(btr_io::IoError),
    /// A damaged checkpoint.
    #[error("{} cannot be used: {why}", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// An effect that cannot be added to S.
    #[error(transparent)]
    Augment(#[from] AddError),
    /// A completed real test whose log is missing or damaged.
    #[error("{0}")]
    LostTest(Text),
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

fn of_process(pid: Option<u32>) -> String {
    pid.map_or_else(String::new, |pid| format!(", process {pid}"))
}

impl RunError {
    /// The error as a text.
    pub fn text(&self) -> Text {
        match self {
            RunError::LostTest(text) => text.clone(),
            RunError::File(error) => error.text(),
            other => other.to_string().into(),
        }
    }

    /// The remedy.
    pub fn help(&self) -> Option<Text> {
        Some(match self {
            RunError::Exists(_) => Text::from("go on with ") + Mention::Resume + ", or choose another " + Mention::Out,
            RunError::InUse { .. } => Text::from("wait for it or end it, or choose another ") + Mention::Out,
            RunError::FolderGone { rescued, .. } => {
                let there = format!(" {} as ", rescued.display());
                Text::from("resume the run there: ") + Mention::Resume + " with" + there + Mention::Out
            }
            RunError::NotARun(_) => "name the folder that a run of the loop writes, with checkpoint.bin in it".into(),
            RunError::NoRun(_) => Text::from("start it without ") + Mention::Resume,
            RunError::OtherExperiment(folder) => {
                let shows = format!(" that {} shows", folder.join("experiment.toml").display());
                Text::from("resume with the file, ")
                    + Mention::Settings
                    + " and "
                    + Mention::Seed
                    + shows
                    + ", perhaps with further parameters after the existing ones ("
                    + Verb::Add
                    + "), or choose another "
                    + Mention::Out
            }
            RunError::Checkpoint { .. } | RunError::OtherStamp(_) => {
                Text::from(
                    "put the file back from a copy; or remove checkpoint.bin and start the experiment as it began                      without ",
                ) + Mention::Resume
                    + ": the real tests in transfers/ are used again"
            }
            RunError::OtherVersion { .. } => {
                Text::from("go on with that version; or remove checkpoint.bin and start without ")
                    + Mention::Resume
                    + ": the real tests in transfers/ are used again where this version asks for the same"
            }
            RunError::Unwritable(_) => Text::from("make room or permit it to be written, then ") + Mention::RunAgain,
            RunError::LostTest(_) => {
                "put the log back into its folder under transfers/; a file that was changed on purpose is taken once \
                 checksums.sfv beside it is removed"
                    .into()
            }
            RunError::File(error) => return error.help.clone(),
            RunError::Augment(error) => return error.help(),
            RunError::Distributed(error) => return error.help(),
            RunError::Log(error) => return Some(error.help()),
            RunError::Lost { .. } | RunError::Plan(_) | RunError::Cancelled(_) | RunError::Io { .. } => return None,
        })
    }
}

impl From<RunError> for Failure {
    fn from(error: RunError) -> Self {
        let code = match error {
            RunError::FolderGone { .. } | RunError::Lost { .. } => FOLDER_GONE,
            RunError::Unwritable(_) => STORAGE,
            _ => "run",
        };
        Failure::new(code, error.text(), error.help())
    }
}
