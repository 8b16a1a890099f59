//! The settings of a test by a program.

use super::program::{StopSignal, Stopping};
use std::time::Duration;

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
    /// What asks a program to end.
    pub stop_signal: StopSignal,
    /// Time between that and SIGKILL, in s.
    pub stop_s: f64,
    /// The program that makes the robot safe after an attempt that gave no log, with its arguments; none if empty.
    pub on_stop: Vec<String>,
    /// Time after which that is aborted, in s.
    pub on_stop_timeout_s: f64,
}

impl CommandSettings {
    pub(super) fn stopping(&self) -> Stopping {
        Stopping { signal: self.stop_signal, grace: Duration::from_secs_f64(self.stop_s) }
    }
}
