//! The folder of real tests: `transfers/0007/` holds the request (`trial.toml`, `references.csv`) and the result
//! (`log.mcap` or `log.csv`, or `failed.txt`). A result counts as soon as it exists under its final name. Once it was
//! accepted, `checksums.sfv` keeps damaged files from being used.

pub(super) mod checksums;
mod error;
mod files;

pub use error::StoreError;
pub(super) use files::write_text;

use super::clock::of_test;
use btr_core::log::{Log, Role};
use btr_core::space::Space;
use btr_core::world::{Behaviour, Outcome, Trial};
use btr_io::{Mapping, Meta};
use btr_physics::model::Model;
use btr_physics::model::task::Fitness;
use files::is_open_ended;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Extensions of a finished log.
const LOG_ENDINGS: [&str; 2] = ["mcap", "csv"];
/// Says which test it is.
const REQUEST: &str = "trial.toml";
/// Says why a test failed.
const FAILED: &str = "failed.txt";

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

    /// Writes the request of a trial: the controller and its joint references. One without a result is written anew,
    /// so that no robot plays damaged references.
    ///
    /// # Errors
    /// A failed write, or a folder that holds another trial.
    pub fn ask(&self, trial: &Trial, references: &Log) -> Result<PathBuf, StoreError> {
        let folder = self.folder_of(trial);
        let (path, text) = (folder.join(REQUEST), self.describe(trial));
        self.create(&folder).map_err(|source| StoreError::Io { path: folder.clone(), source })?;
        match std::fs::read(&path) {
            Ok(before) if before != text.as_bytes() => return Err(StoreError::OtherTrial { path: folder }),
            Ok(_) if result_in(&folder).is_some() => return Ok(folder),
            _ => {}
        }
        btr_io::write_log(&folder.join("references.csv"), &commands(references), &Meta::default())?;
        write_text(&path, &text)?;
        Ok(folder)
    }

    /// Creates the folder of a trial, but not the run's: a run whose folder is gone must notice that.
    fn create(&self, folder: &Path) -> std::io::Result<()> {
        [self.folder.as_path(), folder].into_iter().try_for_each(btr_io::create_dir)
    }

    /// The result of a trial, if there is one.
    ///
    /// # Errors
    /// A log that exists but cannot be used.
    pub fn recall(&self, trial: &Trial) -> Result<Option<Outcome>, StoreError> {
        let folder = self.folder_of(trial);
        let is_accepted = checksums::check(&folder)?;
        let Some(path) = result_in(&folder) else { return Ok(None) };
        if std::fs::read(folder.join(REQUEST)).is_ok_and(|text| text != self.describe(trial).as_bytes()) {
            return Err(StoreError::OtherTrial { path: folder });
        }
        let outcome = if path.ends_with(FAILED) {
            let why = std::fs::read_to_string(&path).map_err(|source| StoreError::Io { path, source })?;
            Outcome::Failed { why: why.trim().to_owned() }
        } else {
            self.judge(&path)?
        };
        if !is_accepted {
            checksums::record(&folder)?;
        }
        Ok(Some(outcome))
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
        self.accept(trial, self.judge(&path)?)
    }

    /// The same for a log that no other test would give again: where its folder cannot be written, it is kept in the
    /// system's folder of temporary files.
    ///
    /// # Errors
    /// A failed write.
    pub(super) fn keep_or_put_aside(&self, trial: &Trial, log: &Log) -> Result<Outcome, StoreError> {
        self.keep(trial, log, &Meta::default()).map_err(|error| {
            let name = format!("btr-{}-test-{:04}.mcap", std::process::id(), trial.number);
            let aside = std::env::temp_dir().join(name);
            match btr_io::write_log(&aside, log, &Meta::default()) {
                Ok(()) => {
                    StoreError::Aside { why: error.to_string(), aside, path: self.folder_of(trial).join("log.mcap") }
                }
                Err(_) => error,
            }
        })
    }

    /// Accepts an outcome whose files are there: from now on they must not change.
    fn accept(&self, trial: &Trial, outcome: Outcome) -> Result<Outcome, StoreError> {
        checksums::record(&self.folder_of(trial))?;
        Ok(outcome)
    }

    /// Converts a log to the tests' clock.
    pub(super) fn on_the_tests_clock(&self, log: Log) -> Log {
        of_test(log, self.test_s)
    }

    /// Records that a test failed, unless its request is gone: then that may be why.
    ///
    /// # Errors
    /// A request that is gone, a failed write.
    pub fn fail(&self, trial: &Trial, why: &str) -> Result<Outcome, StoreError> {
        let request = self.folder_of(trial).join(REQUEST);
        std::fs::metadata(&request).map_err(|source| StoreError::Io { path: request, source })?;
        write_text(&self.folder_of(trial).join(FAILED), why)?;
        self.accept(trial, Outcome::Failed { why: why.to_owned() })
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
        outcome_of(self.recall(trial).map(|found| found.unwrap_or_else(lost)))
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

/// The outcome, or why there is none: what is not on disk, or damaged there, must not be used.
pub(super) fn outcome_of(result: Result<Outcome, StoreError>) -> Outcome {
    result.unwrap_or_else(|error| match error.is_passing() {
        true => Outcome::Pending { what: error.text() },
        false => Outcome::Storage { why: error.text() },
    })
}

/// The result in a test's folder: why it failed, or its log.
fn result_in(folder: &Path) -> Option<PathBuf> {
    let log = LOG_ENDINGS.map(|end| format!("log.{end}"));
    let names = std::iter::once(FAILED.to_owned()).chain(log);
    names.map(|name| folder.join(name)).find(|path| path.is_file())
}

/// The command channels of a log.
fn commands(log: &Log) -> Log {
    let mut only = log.clone();
    only.retain(|_, channel| channel.role == Role::Command);
    only
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_failure_whose_request_is_gone_is_none_of_the_robot() {
        let folder = tempfile::tempdir().unwrap();
        let tests = folder.path().to_owned();
        let store = Store::new(tests, Space::default(), Fitness::default(), Mapping::default(), 1.0);
        let trial = Trial { number: 0, iteration: 1, controller: Vec::new(), scenario: 0 };
        let asked = store.ask(&trial, &Log::new(vec![0.0]).unwrap()).unwrap();
        assert!(matches!(store.fail(&trial, "no log"), Ok(Outcome::Failed { .. })));
        std::fs::remove_file(asked.join(REQUEST)).unwrap();
        assert!(matches!(store.fail(&trial, "no log"), Err(StoreError::Io { .. })));
    }

    #[test]
    fn a_runs_folder_that_is_gone_is_not_created_anew() {
        let folder = tempfile::tempdir().unwrap();
        let run = folder.path().join("run");
        let tests = run.join("transfers");
        let store = Store::new(tests, Space::default(), Fitness::default(), Mapping::default(), 1.0);
        let trial = Trial { number: 0, iteration: 1, controller: Vec::new(), scenario: 0 };
        assert!(matches!(store.ask(&trial, &Log::new(vec![0.0]).unwrap()), Err(StoreError::Io { .. })));
        assert!(!run.exists());
    }

    #[test]
    fn a_log_without_a_folder_is_put_aside() {
        let folder = tempfile::tempdir().unwrap();
        // A file where the folder of the tests should be.
        let tests = folder.path().join("transfers");
        std::fs::write(&tests, "").unwrap();
        let store = Store::new(tests, Space::default(), Fitness::default(), Mapping::default(), 1.0);
        let trial = Trial { number: 7, iteration: 1, controller: Vec::new(), scenario: 0 };
        let mut log = Log::new(vec![0.0, 0.5, 1.0]).unwrap();
        log.insert("q_knee", "rad", Role::Measured, vec![0.0, 1.0, 2.0]).unwrap();
        let error = store.keep_or_put_aside(&trial, &log).unwrap_err();
        assert!(!error.is_passing());
        let StoreError::Aside { aside, path, .. } = error else { unreachable!("{error}") };
        assert!(path.ends_with("transfers/0007/log.mcap"));
        assert_eq!(btr_io::read_log(&aside, &Mapping::default()).unwrap().0, log);
        std::fs::remove_file(aside).unwrap();
    }
}
