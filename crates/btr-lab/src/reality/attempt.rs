//! One attempt at a test by a program.

use super::program::{End, OutputFiles, POLL, Program, Record, listed, tell};
use super::settings::CommandSettings;
use super::store::{Store, StoreError, checksums};
use crate::execution::ExecutionContext;
use btr_core::world::Outcome;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A signal to all processes, as when a computer shuts down, may reach the program this long before the run.
const SIGNALS: Duration = Duration::from_millis(300);
/// A log that ends at most this many of its steps before the test's end holds the whole test.
const LAST_ROWS: f64 = 3.0;

/// Names the output of `on_stop`, after that of the attempt.
const ON_STOP: &str = ".on_stop";

/// What an attempt came to.
pub(super) enum Attempt {
    /// The test's outcome: a behaviour, or none as the run must end.
    Decided(Outcome),
    /// It gave no log, for this reason; it may be repeated.
    Failed(String),
}

/// A program that is run once for a test, under a name of its own in the test's folder.
pub(super) struct Try<'a> {
    pub settings: &'a CommandSettings,
    pub store: &'a Store,
    pub context: &'a ExecutionContext,
    pub folder: &'a Path,
    /// `try-1`, `try-2`, ...
    pub name: String,
    /// Duration of the test, in s.
    pub test_s: f64,
}

/// The outcome of a test that the run ended itself, or did not begin.
pub(super) fn interrupted() -> Outcome {
    Outcome::Pending { what: "the run was interrupted before the test was done".into() }
}

impl Try<'_> {
    /// The first `try-N` that no earlier attempt has used.
    pub(super) fn free_name(folder: &Path) -> String {
        let taken = |n: &usize| folder.join(format!("try-{n}.out")).exists();
        let n = (1..).find(|n| !taken(n)).unwrap_or(usize::MAX);
        format!("try-{n}")
    }

    /// Runs the program, ends it with all that it started, and makes the robot safe where it did not end well.
    pub(super) fn run(&self) -> Result<Attempt, StoreError> {
        Record { name: self.name.clone(), group: None }.write(self.folder)?;
        let stopping = self.settings.stopping();
        let program = match Program::start(&self.arguments(&self.settings.run), self.output(""), stopping) {
            Ok(program) => program,
            Err(why) => {
                Record::remove(self.folder)?;
                return Ok(Attempt::Failed(format!("`{}` does not start: {why}", self.program())));
            }
        };
        let noted = Record { name: self.name.clone(), group: Some(program.group().clone()) }.write(self.folder);
        let stops = || noted.is_err() || self.context.is_interrupted();
        let (end, left) = program.watch(Duration::from_secs_f64(self.settings.timeout_s), &stops);
        let ended_well = matches!(end, End::Exit(status) if status.success());
        let mut is_safe = if ended_well { Ok(()) } else { self.make_safe() };
        let attempt = self.judge(end);
        if ended_well && !matches!(attempt, Ok(Attempt::Decided(Outcome::Done(_)))) {
            is_safe = self.make_safe();
        }
        if !left.is_empty() {
            // The record stays: it keeps a resumed run from the robot while they live.
            return Ok(no_test_may_begin(format!("{} of the test's program cannot be ended", listed(&left))));
        }
        Record::remove(self.folder)?;
        match is_safe {
            Ok(()) => noted.and(attempt),
            Err(why) => Ok(no_test_may_begin(why)),
        }
    }

    /// What the end of the program says of the attempt.
    fn judge(&self, end: End) -> Result<Attempt, StoreError> {
        let (program, name) = (self.program(), &self.name);
        let why = match end {
            End::Exit(status) if status.success() => match self.store.judge(&self.log()) {
                Ok(outcome @ Outcome::Done(_)) => return self.keep(outcome).map(Attempt::Decided),
                Ok(Outcome::Failed { why }) => why,
                Ok(Outcome::Pending { what: why } | Outcome::Unsafe { why } | Outcome::Storage { why }) => {
                    why.to_string()
                }
                Err(error) => error.to_string(),
            },
            End::Exit(status) => format!("`{program}` ended with {status}; see {name}.err"),
            End::TimeOut => format!("`{program}` took longer than {} s", self.settings.timeout_s),
            End::Interrupted => "interrupted".to_owned(),
        };
        if self.is_interrupted_soon() {
            // Not the program's fault; it may just have finished.
            return Ok(Attempt::Decided(self.whole_log()?.unwrap_or_else(interrupted)));
        }
        Ok(Attempt::Failed(why))
    }

    fn program(&self) -> &str {
        self.settings.run.first().map_or("", String::as_str)
    }

    fn is_interrupted_soon(&self) -> bool {
        let deadline = Instant::now() + SIGNALS;
        while !self.context.is_interrupted() && Instant::now() < deadline {
            std::thread::sleep(POLL);
        }
        self.context.is_interrupted()
    }

    /// The outcome of a log that holds the whole test, which becomes the test's; none without such a log.
    pub(super) fn whole_log(&self) -> Result<Option<Outcome>, StoreError> {
        let Ok(Outcome::Done(behaviour)) = self.store.judge(&self.log()) else { return Ok(None) };
        let last_s = behaviour.log.clock_s().last().copied().unwrap_or(0.0);
        let step_s = behaviour.log.usual_step_s().unwrap_or(0.0);
        let is_whole = last_s >= self.test_s - LAST_ROWS * step_s;
        if is_whole { self.keep(Outcome::Done(behaviour)).map(Some) } else { Ok(None) }
    }

    fn keep(&self, outcome: Outcome) -> Result<Outcome, StoreError> {
        let path = self.folder.join(format!("log.{}", self.settings.log));
        std::fs::rename(self.log(), &path).map_err(|source| StoreError::Io { path, source })?;
        checksums::record(self.folder)?;
        Ok(outcome)
    }

    /// Runs `on_stop`; an error says that the robot may not be safe.
    pub(super) fn make_safe(&self) -> Result<(), String> {
        let Some(program) = self.settings.on_stop.first() else { return Ok(()) };
        let why = match self.on_stop() {
            Ok((End::Exit(status), left)) if status.success() && left.is_empty() => return Ok(()),
            Ok((End::Exit(status), _)) => format!("ended with {status}"),
            Ok(_) => format!("took longer than {} s", self.settings.on_stop_timeout_s),
            Err(why) => format!("does not run: {why}"),
        };
        let text = format!("THE ROBOT MAY NOT BE SAFE: on_stop, `{program}`, {why}");
        tell(&text);
        Err(text)
    }

    fn on_stop(&self) -> std::io::Result<(End, Vec<u32>)> {
        let arguments = self.arguments(&self.settings.on_stop);
        let program = Program::start(&arguments, self.output(ON_STOP), self.settings.stopping())?;
        // No interruption keeps it from making the robot safe.
        Ok(program.watch(Duration::from_secs_f64(self.settings.on_stop_timeout_s), &|| false))
    }

    fn arguments(&self, of: &[String]) -> Vec<String> {
        let path = |name: &str| self.folder.join(name).to_string_lossy().into_owned();
        let fill = |argument: &String| {
            argument
                .replace("{trial}", &path("trial.toml"))
                .replace("{references}", &path("references.csv"))
                .replace("{log}", &self.log().to_string_lossy())
        };
        of.iter().map(fill).collect()
    }

    fn log(&self) -> PathBuf {
        self.folder.join(format!("{}.{}", self.name, self.settings.log))
    }

    /// What the program prints, and what `on_stop` does.
    pub(super) fn outputs(&self) -> [PathBuf; 2] {
        ["", ON_STOP].map(|of| self.output(of).out)
    }

    fn output(&self, of: &str) -> OutputFiles {
        let path = |ending: &str| self.folder.join(format!("{}{of}.{ending}", self.name));
        OutputFiles { out: path("out"), err: path("err") }
    }
}

fn no_test_may_begin(why: String) -> Attempt {
    Attempt::Decided(Outcome::Unsafe { why: why.into() })
}
