//! An external command per test: a program that drives the robot (or another simulator) and writes a log.
//!
//! Every attempt writes to a separate file, which is renamed to the trial's log only if the program succeeded and the
//! log can be read. A killed run never mistakes an incomplete log for a complete one, and no attempt is overwritten.

use super::revealed::Revealing;
use super::store::{Store, StoreError, or_pending};
use btr_core::world::{Outcome, Reality, Trial};
use btr_physics::model::Model;
use std::fs::File;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Polling period of a running program.
const POLL: Duration = Duration::from_millis(20);

/// The program that runs one test.
#[derive(Clone, Debug)]
pub struct CommandSettings {
    /// The program and its arguments; `{trial}`, `{references}` and `{log}` stand for files of the test.
    pub run: Vec<String>,
    /// Extension of the log that it writes.
    pub log: String,
    /// Time after which an attempt is aborted, in s.
    pub timeout_s: f64,
    /// How often a failed attempt is repeated.
    pub retries: u32,
}

/// Runs a program for every test.
pub struct CommandReality {
    settings: CommandSettings,
    model: Arc<Model>,
    store: Store,
}

impl CommandReality {
    /// Keeps tests in `store`; `model` computes the references of a controller.
    pub fn new(settings: CommandSettings, model: Arc<Model>, store: Store) -> Self {
        CommandReality { settings, model, store }
    }

    fn perform(&self, trial: &Trial) -> Result<Outcome, StoreError> {
        let folder = match self.store.known_or_asked(trial, &self.model)? {
            ControlFlow::Break(known) => return Ok(known),
            ControlFlow::Continue((folder, _)) => folder,
        };
        let mut why = String::new();
        for _ in 0..=self.settings.retries {
            let name = free_name(&folder);
            let log = folder.join(format!("{name}.{}", self.settings.log));
            why = match self.try_once(&folder, &name, &log) {
                Ok(()) => match self.store.judge(&log) {
                    Ok(outcome @ Outcome::Done(_)) => return finish(&folder, &log, outcome),
                    Ok(Outcome::Failed { why }) => why,
                    Ok(Outcome::Pending { what }) => what.to_string(),
                    Err(error) => error.to_string(),
                },
                Err(why) => why,
            };
        }
        self.store.fail(trial, &why)
    }

    /// Runs the program once; its output goes to `<name>.out` and `<name>.err` in the log's folder.
    fn try_once(&self, folder: &Path, name: &str, log: &Path) -> Result<(), String> {
        let fill = |argument: &String| {
            argument
                .replace("{trial}", &folder.join("trial.toml").to_string_lossy())
                .replace("{references}", &folder.join("references.csv").to_string_lossy())
                .replace("{log}", &log.to_string_lossy())
        };
        let arguments: Vec<String> = self.settings.run.iter().map(fill).collect();
        let (program, rest) = arguments.split_first().ok_or("[reality] run is empty")?;
        let output = |ending: &str| File::create(folder.join(format!("{name}.{ending}"))).map_err(|e| e.to_string());
        let mut child = Command::new(program)
            .args(rest)
            .stdin(Stdio::null())
            .stdout(output("out")?)
            .stderr(output("err")?)
            .spawn()
            .map_err(|e| format!("`{program}` does not start: {e}"))?;
        let deadline = Instant::now() + Duration::from_secs_f64(self.settings.timeout_s);
        loop {
            match child.try_wait().map_err(|e| e.to_string())? {
                Some(status) if status.success() => return Ok(()),
                Some(status) => return Err(format!("`{program}` ended with {status}; see {name}.err")),
                None if Instant::now() < deadline => std::thread::sleep(POLL),
                None => {
                    let _ = child.kill();
                    let _ = child.wait();
                    return Err(format!("`{program}` took longer than {} s", self.settings.timeout_s));
                }
            }
        }
    }
}

/// The first `try-N` that no earlier attempt has used.
fn free_name(folder: &Path) -> String {
    let taken = |n: &usize| folder.join(format!("try-{n}.out")).exists();
    let n = (1..).find(|n| !taken(n)).unwrap_or(usize::MAX);
    format!("try-{n}")
}

fn finish(folder: &Path, log: &Path, outcome: Outcome) -> Result<Outcome, StoreError> {
    let ending = log.extension().unwrap_or_default().to_string_lossy().into_owned();
    let path = folder.join(format!("log.{ending}"));
    std::fs::rename(log, &path).map_err(|source| StoreError::Io { path, source })?;
    Ok(outcome)
}

impl Reality for CommandReality {
    fn test(&mut self, trial: &Trial) -> Outcome {
        or_pending(self.perform(trial))
    }

    fn recall(&mut self, trial: &Trial) -> Outcome {
        self.store.recalled(trial)
    }
}

impl Revealing for CommandReality {}
