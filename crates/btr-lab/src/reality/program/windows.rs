//! The nearest to process groups that Windows has without unsafe code: a console group, which Ctrl-C does not reach,
//! and the tree of processes, which can only be ended at once. Processes whose parent has ended are not found.

use super::signal::StopSignal;
use std::fs::File;
use std::path::Path;
use std::process::Command;

/// Keeps Ctrl-C from the program: CREATE_NEW_PROCESS_GROUP.
#[cfg(windows)]
pub(super) fn apart(command: &mut Command) {
    use std::os::windows::process::CommandExt;
    command.creation_flags(0x0000_0200);
}

#[cfg(not(windows))]
pub(super) fn apart(_command: &mut Command) {}

/// Nothing can be asked of a program here: it is ended at once.
pub(super) fn ask(process: u32, _signal: StopSignal) {
    kill(process);
}

/// Ends a process and its children.
pub(super) fn kill(process: u32) {
    let _ = Command::new("taskkill").args(["/T", "/F", "/PID", &process.to_string()]).output();
}

/// Files cannot show here whether a process lives that inherited them.
pub(super) fn lock_for_heirs(_file: &File) {}

/// See [`lock_for_heirs`].
pub(super) fn has_heirs(_output: &Path) -> bool {
    false
}

/// Not told here.
pub(super) fn began(_process: u32) -> Option<String> {
    None
}

/// The process, if it lives.
pub(super) fn living(process: u32, _began: Option<&str>) -> Vec<u32> {
    let filter = format!("PID eq {process}");
    let listed = Command::new("tasklist").args(["/NH", "/FI", &filter]).output();
    let text = listed.map(|output| String::from_utf8_lossy(&output.stdout).into_owned()).unwrap_or_default();
    let lives = text.split_whitespace().any(|word| word == process.to_string());
    if lives { vec![process] } else { Vec::new() }
}
