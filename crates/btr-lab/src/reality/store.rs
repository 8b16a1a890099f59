//! The folder of real tests: `transfers/0007/` holds the request (`trial.toml`, `references.csv`) and the result
//! (`log.mcap` or `log.csv`, or `failed.txt`). A result counts as soon as it exists under its final name.

use super::clock::of_test;
use btr_core::log::{Log, Role};
use btr_core::space::Space;
use btr_core::text::{Mention, Text};
use btr_core::world::{Behaviour, Outcome, Trial};
use btr_io::{Mapping, Meta};
use btr_physics::model::Model;
use btr_physics::model::task::Fitness;
use std::fmt::Write as _;
use std::io::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Extensions of a finished log.
const LOG_ENDINGS: [&str; 2] = ["mcap", "csv"];

/// Why a real test could not be saved or read back.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// A file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The path.
        path: PathBuf,
        /// The underlying error.
        source: std::io::Error,
    },
    /// A log that cannot be read or written.
    #[error(transparent)]
    Log(#[from] btr_io::IoError),
    /// An incomplete log: it may still be being written.
    #[error("{}: {why}", path.display())]
    Half {
        /// The log.
        path: PathBuf,
        /// What is missing.
        why: String,
    },
    /// A folder with the result of another trial.
    #[error("{}", another_trial(path))]
    OtherTrial {
        /// The folder.
        path: PathBuf,
    },
}

impl StoreError {
    /// The error as a text.
    pub fn text(&self) -> Text {
        match self {
            StoreError::OtherTrial { path } => another_trial(path),
            other => other.to_string().into(),
        }
    }
}

fn another_trial(path: &Path) -> Text {
    let holds = format!("{} holds the result of another trial; start with an empty ", path.display());
    Text::from(holds) + Mention::Out
}

/// Keeps real tests under one folder.
#[derive(Clone, Debug)]
pub struct Store {
    folder: PathBuf,
    controllers: Space,
    fitness: Fitness,
    mapping: Mapping,
    test_s: f64,
}

impl Store {
    /// Keeps tests of `test_s` seconds under `folder`; `controllers` is the space of their controllers, `fitness`
    /// evaluates their logs.
    pub fn new(folder: PathBuf, controllers: Space, fitness: Fitness, mapping: Mapping, test_s: f64) -> Self {
        Store { folder, controllers, fitness, mapping, test_s }
    }

    /// The folder of a trial and its results.
    pub fn folder_of(&self, trial: &Trial) -> PathBuf {
        self.folder.join(format!("{:04}", trial.number))
    }

    /// Writes the request of a trial: the controller and its joint references.
    ///
    /// # Errors
    /// A failed write, or a folder that holds another trial.
    pub fn ask(&self, trial: &Trial, references: &Log) -> Result<PathBuf, StoreError> {
        let folder = self.folder_of(trial);
        let (path, text) = (folder.join("trial.toml"), self.describe(trial));
        std::fs::create_dir_all(&folder).map_err(|source| StoreError::Io { path: folder.clone(), source })?;
        match std::fs::read_to_string(&path) {
            Ok(before) if before == text => return Ok(folder),
            Ok(_) => return Err(StoreError::OtherTrial { path: folder }),
            Err(_) => {}
        }
        btr_io::write_log(&folder.join("references.csv"), &commands(references), &Meta::default())?;
        write_text(&path, &text)?;
        Ok(folder)
    }

    /// The result of a trial, if there is one.
    ///
    /// # Errors
    /// A log that exists but cannot be used.
    pub fn recall(&self, trial: &Trial) -> Result<Option<Outcome>, StoreError> {
        let folder = self.folder_of(trial);
        let failure = std::fs::read_to_string(folder.join("failed.txt")).ok();
        let log = LOG_ENDINGS.iter().map(|end| folder.join(format!("log.{end}"))).find(|path| path.is_file());
        if failure.is_none() && log.is_none() {
            return Ok(None);
        }
        if std::fs::read_to_string(folder.join("trial.toml")).is_ok_and(|text| text != self.describe(trial)) {
            return Err(StoreError::OtherTrial { path: folder });
        }
        Ok(match (failure, log) {
            (Some(why), _) => Some(Outcome::Failed { why: why.trim().to_owned() }),
            (None, Some(path)) => Some(self.judge(&path)?),
            (None, None) => None,
        })
    }

    /// Reads a log and evaluates its fitness. A log without the channels of the fitness is a failed test, not an error.
    ///
    /// # Errors
    /// A log that cannot be read or is incomplete.
    pub fn judge(&self, path: &Path) -> Result<Outcome, StoreError> {
        let (log, warnings) = btr_io::read_log(path, &self.mapping)?;
        let log = of_test(log, self.test_s);
        if let Some(why) = warnings.iter().find(|warning| warning.is_half()) {
            return Err(StoreError::Half { path: path.to_owned(), why: why.to_string() });
        }
        if is_open_ended(path) {
            return Err(StoreError::Half { path: path.to_owned(), why: "the last line is truncated".to_owned() });
        }
        Ok(match self.fitness.of(&log) {
            Ok(fitness) => Outcome::Done(Behaviour { log, fitness }),
            Err(why) => Outcome::Failed { why: format!("{}: {why}", path.display()) },
        })
    }

    /// Saves a log under its final name and returns the result as read back from disk.
    ///
    /// # Errors
    /// A failed write.
    pub fn keep(&self, trial: &Trial, log: &Log, meta: &Meta) -> Result<Outcome, StoreError> {
        let path = self.folder_of(trial).join("log.mcap");
        btr_io::write_log(&path, log, meta)?;
        self.judge(&path)
    }

    /// Converts a log to the tests' clock.
    pub(super) fn on_the_tests_clock(&self, log: Log) -> Log {
        of_test(log, self.test_s)
    }

    /// Records that a test failed.
    ///
    /// # Errors
    /// A failed write.
    pub fn fail(&self, trial: &Trial, why: &str) -> Result<Outcome, StoreError> {
        write_text(&self.folder_of(trial).join("failed.txt"), why)?;
        Ok(Outcome::Failed { why: why.to_owned() })
    }

    /// The result of a trial if it is known; otherwise writes its request and returns its folder and references.
    pub(super) fn known_or_asked(
        &self,
        trial: &Trial,
        model: &Model,
    ) -> Result<ControlFlow<Outcome, (PathBuf, Log)>, StoreError> {
        if let Some(before) = self.recall(trial)? {
            return Ok(ControlFlow::Break(before));
        }
        let references = match model.references(&trial.controller, trial.scenario) {
            Ok(references) => references,
            Err(why) => return Ok(ControlFlow::Break(Outcome::Failed { why: why.to_string() })),
        };
        Ok(ControlFlow::Continue((self.ask(trial, &references)?, references)))
    }

    /// The result of an earlier test; pending if it is missing.
    pub(super) fn recalled(&self, trial: &Trial) -> Outcome {
        let lost = || Outcome::Pending { what: format!("no log in {}", self.folder_of(trial).display()).into() };
        or_pending(self.recall(trial).map(|found| found.unwrap_or_else(lost)))
    }

    fn describe(&self, trial: &Trial) -> String {
        let mut text = format!(
            "# One real test. Play references.csv on the robot and save what it did as log.csv or log.mcap beside this file;\n\
             # if it could not be done, write why into failed.txt.\n\
             number = {}\niteration = {}\nscenario = {}\n\n[controller]\n",
            trial.number, trial.iteration, trial.scenario
        );
        for (dim, value) in self.controllers.dims().iter().zip(&trial.controller) {
            let _ = writeln!(text, "{:?} = {value:?} # {}", dim.name, dim.unit);
        }
        text
    }
}

/// The outcome, or pending if it could not be saved: an unsaved outcome must not be used.
pub(super) fn or_pending(result: Result<Outcome, StoreError>) -> Outcome {
    result.unwrap_or_else(|error| Outcome::Pending { what: error.text() })
}

pub(super) fn write_text(path: &Path, text: &str) -> Result<(), StoreError> {
    btr_io::write_whole(path, |file| file.write_all(text.as_bytes()))
        .map_err(|source| StoreError::Io { path: path.to_owned(), source })
}

/// Whether a CSV file ends within a line: a truncated number would still parse.
fn is_open_ended(path: &Path) -> bool {
    let is_csv = path.extension().is_some_and(|ending| ending == "csv");
    is_csv && std::fs::read(path).is_ok_and(|bytes| bytes.last() != Some(&b'\n'))
}

/// The command channels of a log.
fn commands(log: &Log) -> Log {
    let mut only = log.clone();
    only.retain(|_, channel| channel.role == Role::Command);
    only
}
