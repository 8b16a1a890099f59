//! A process group: the program and what it started.

use super::signal::StopSignal;
use super::system;
use super::tell::tell;
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// Polling period of a running program.
pub(in crate::reality) const POLL: Duration = Duration::from_millis(20);
/// Killed processes are gone within this time, unless the system holds them.
const KILLED: Duration = Duration::from_secs(2);

/// How a group is ended.
#[derive(Clone, Copy, Debug)]
pub(in crate::reality) struct Stopping {
    /// The signal that asks it to end.
    pub signal: StopSignal,
    /// Time between that and SIGKILL.
    pub grace: Duration,
}

/// A process group, named after its first process.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::reality) struct Group {
    /// Number of the first process and of the group.
    pub pid: u32,
    /// When the first process began, in the words of the system; none where it does not tell. Numbers of processes are
    /// used again.
    pub began: Option<String>,
}

impl Group {
    /// The group of a process that was started in its own.
    pub(super) fn of(pid: u32) -> Self {
        Group { pid, began: system::began(pid) }
    }

    /// The processes of the group that live.
    pub(in crate::reality) fn living(&self) -> Vec<u32> {
        system::living(self.pid, self.began.as_deref())
    }

    /// Ends all processes: asks, waits, kills, and waits until they are gone. `meanwhile` is called all the time.
    /// Returns those that the system does not let end, once `gives_up`.
    pub(in crate::reality) fn end(
        &self,
        stopping: &Stopping,
        gives_up: &dyn Fn() -> bool,
        meanwhile: &mut dyn FnMut(),
    ) -> Vec<u32> {
        if self.gone_within(Duration::ZERO, meanwhile) {
            return Vec::new();
        }
        system::ask(self.pid, stopping.signal);
        if self.gone_within(stopping.grace, meanwhile) {
            return Vec::new();
        }
        let mut told = false;
        loop {
            system::kill(self.pid);
            if self.gone_within(KILLED, meanwhile) {
                return Vec::new();
            }
            let living = self.living();
            if gives_up() {
                return living;
            }
            if !std::mem::replace(&mut told, true) {
                tell(&format!("waiting for {}, which cannot be ended: end it by hand", listed(&living)));
            }
        }
    }

    /// Whether no process of the group is left, or will be after this time; `meanwhile` is called until then.
    pub(super) fn gone_within(&self, time: Duration, meanwhile: &mut dyn FnMut()) -> bool {
        let deadline = Instant::now() + time;
        loop {
            meanwhile();
            if self.living().is_empty() {
                return true;
            }
            if Instant::now() >= deadline {
                return false;
            }
            std::thread::sleep(POLL);
        }
    }
}

/// Processes in words.
pub(in crate::reality) fn listed(pids: &[u32]) -> String {
    let numbers: Vec<String> = pids.iter().map(u32::to_string).collect();
    format!("{} {}", if numbers.len() == 1 { "process" } else { "processes" }, numbers.join(", "))
}
