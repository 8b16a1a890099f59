//! A program that runs: it is watched, and ends with its group.

use super::group::{Group, POLL, Stopping, listed};
use super::tell::tell;
use super::{output, system};
use std::fs::{File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Processes that outlive a program that has ended well may end by themselves within this time, such as one that copies
/// its output.
const AFTERMATH: Duration = Duration::from_millis(500);

/// How a program ended.
#[derive(Clone, Copy, Debug)]
pub(in crate::reality) enum End {
    /// By itself.
    Exit(ExitStatus),
    /// It was ended after its time.
    TimeOut,
    /// It was ended on request.
    Interrupted,
}

/// The files of a program's output.
pub(in crate::reality) struct OutputFiles {
    /// What it prints.
    pub out: PathBuf,
    /// What it prints on stderr.
    pub err: PathBuf,
}

impl OutputFiles {
    /// Opens both. The lock of the first is shared by all processes that inherit the file: it shows whether one of them
    /// lives.
    fn open(&self) -> io::Result<[File; 2]> {
        let open = |path| OpenOptions::new().create(true).append(true).open(path);
        let files = [open(&self.out)?, open(&self.err)?];
        system::lock_for_heirs(&files[0]);
        Ok(files)
    }

    fn each(&self, work: impl Fn(&Path) -> io::Result<()>) {
        // Output is for people; a test is not spent on it.
        [&self.out, &self.err].into_iter().for_each(|path| drop(work(path)));
    }
}

/// A running program. It is ended with its group when this is dropped.
pub(in crate::reality) struct Program {
    child: Child,
    group: Group,
    output: OutputFiles,
    stopping: Stopping,
}

impl Program {
    /// Starts a program in a group of its own, without input.
    pub(in crate::reality) fn start(arguments: &[String], output: OutputFiles, stopping: Stopping) -> io::Result<Self> {
        let (program, rest) = arguments.split_first().ok_or(io::ErrorKind::InvalidInput)?;
        let [out, err] = output.open()?;
        let mut command = Command::new(program);
        command.args(rest).stdin(Stdio::null()).stdout(out).stderr(err);
        system::apart(&mut command);
        let child = command.spawn()?;
        let group = Group::of(child.id());
        Ok(Program { child, group, output, stopping })
    }

    pub(in crate::reality) fn group(&self) -> &Group {
        &self.group
    }

    /// Waits for the program until it ends, the time is over or it is to be interrupted; then ends what is left of its
    /// group. Returns how it ended and which processes could not be ended: they are waited for until `interrupted`.
    pub(in crate::reality) fn watch(mut self, limit: Duration, interrupted: &dyn Fn() -> bool) -> (End, Vec<u32>) {
        let deadline = Instant::now() + limit;
        let end = loop {
            self.output.each(output::bound);
            if let Ok(Some(status)) = self.child.try_wait() {
                break End::Exit(status);
            }
            if interrupted() {
                break End::Interrupted;
            }
            if Instant::now() >= deadline {
                break End::TimeOut;
            }
            std::thread::sleep(POLL);
        };
        if matches!(&end, End::Exit(status) if status.success()) {
            self.tell_of_what_goes_on();
        }
        let left = self.end_group(interrupted);
        self.output.each(output::cut);
        (end, left)
    }

    /// A program that has ended well may have left something that moves the robot.
    fn tell_of_what_goes_on(&self) {
        if !self.group.gone_within(AFTERMATH, &mut || {}) {
            let left = listed(&self.group.living());
            tell(&format!("warning: the test's program has ended, but not {left}, which it started: ending that"));
        }
    }

    fn end_group(&mut self, gives_up: &dyn Fn() -> bool) -> Vec<u32> {
        let (child, output) = (&mut self.child, &self.output);
        self.group.end(&self.stopping, gives_up, &mut || {
            // A process that is not waited for would remain as a zombie.
            let _ = child.try_wait();
            output.each(output::bound);
        })
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        self.end_group(&|| true);
    }
}
