//! Process groups of Unix. `/proc` tells what lives, where there is one; signals alone do not tell zombies from others.

use super::signal::StopSignal;
use rustix::io::Errno;
use rustix::process::{Pid, Signal, kill_process_group, test_kill_process_group};
use std::fs::File;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;

/// Has a program begin a group of its own: Ctrl-C in a terminal does not reach it, and a signal reaches all of it.
pub(super) fn apart(command: &mut Command) {
    command.process_group(0);
}

/// Asks a group to end. Stopped processes go on, so that they can.
pub(super) fn ask(group: u32, signal: StopSignal) {
    let signal = match signal {
        StopSignal::Sigterm => Signal::TERM,
        StopSignal::Sigint => Signal::INT,
    };
    [signal, Signal::CONT].into_iter().for_each(|signal| send(group, signal));
}

/// Ends a group at once.
pub(super) fn kill(group: u32) {
    send(group, Signal::KILL);
}

fn send(group: u32, signal: Signal) {
    if let Some(group) = pid(group) {
        // What is gone, or belongs to another user, shows in what lives.
        let _ = kill_process_group(group, signal);
    }
}

fn pid(number: u32) -> Option<Pid> {
    Pid::from_raw(i32::try_from(number).ok()?)
}

/// Locks an output file for as long as a process that inherits it lives: the lock belongs to the open file.
pub(super) fn lock_for_heirs(file: &File) {
    // Some file systems have no locks; the group is known besides.
    let _ = file.try_lock();
}

/// Whether a process that inherited the output file lives.
pub(super) fn has_heirs(output: &Path) -> bool {
    let file = File::open(output);
    file.is_ok_and(|file| matches!(file.try_lock(), Err(std::fs::TryLockError::WouldBlock)))
}

/// When a process began: the boot, and clock ticks since then.
pub(super) fn began(pid: u32) -> Option<String> {
    Some(format!("{} {}", boot()?, Process::of(pid)?.began_ticks))
}

fn boot() -> Option<String> {
    Some(std::fs::read_to_string("/proc/sys/kernel/random/boot_id").ok()?.trim().to_owned())
}

/// The living processes of a group, unless its number was given to another one since it `began`.
pub(super) fn living(group: u32, began: Option<&str>) -> Vec<u32> {
    let Some(processes) = processes() else { return if answers(group) { vec![group] } else { Vec::new() } };
    let (boot, ticks) = began.and_then(|began| began.split_once(' ')).unzip();
    let is_other =
        |process: &Process| process.pid == group && ticks.is_some_and(|ticks| ticks != process.began_ticks.to_string());
    if boot.is_some_and(|then| self::boot().is_some_and(|now| now != then)) || processes.iter().any(is_other) {
        return Vec::new();
    }
    processes.iter().filter(|process| process.group == group && process.lives).map(|process| process.pid).collect()
}

/// Whether a signal would reach the group.
fn answers(group: u32) -> bool {
    pid(group).is_some_and(|group| matches!(test_kill_process_group(group), Ok(()) | Err(Errno::PERM)))
}

/// What `/proc` tells of a process.
struct Process {
    pid: u32,
    group: u32,
    began_ticks: u64,
    /// Zombies do not live, unless other threads of theirs go on.
    lives: bool,
}

impl Process {
    fn of(pid: u32) -> Option<Self> {
        let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
        // The name before the last bracket may hold anything. After it: state, parent, group, ... (proc_pid_stat(5)).
        let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
        let threads: u32 = fields.get(17)?.parse().ok()?;
        let is_zombie = ["Z", "X"].contains(fields.first()?);
        Some(Process {
            pid,
            group: fields.get(2)?.parse().ok()?,
            began_ticks: fields.get(19)?.parse().ok()?,
            lives: !is_zombie || threads > 1,
        })
    }
}

/// All processes; none without Linux's `/proc`.
fn processes() -> Option<Vec<Process>> {
    Process::of(std::process::id())?;
    let numbers = std::fs::read_dir("/proc").ok()?.filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok());
    Some(numbers.filter_map(Process::of).collect())
}
