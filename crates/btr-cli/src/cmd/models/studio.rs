//! `btr studio`: a local page on a model and its logs, or on a run, which Python serves.

use crate::args::{Global, StudioArgs};
use crate::cmd::common;
use btr_lab::experiment;
use btr_lab::failure::Failure;
use btr_lab::python::Python;
use btr_lab::run::Snapshot;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// What must be there: the page's modules, and the server that it is shown by.
const NEEDED: &str = "btr._studio, viser";
/// How often is looked whether a page has ended.
const POLL: Duration = Duration::from_millis(100);

pub(crate) fn run(args: &StudioArgs, global: &Global) -> Result<u8, Failure> {
    // What is wrong with the model or the run counts first: a page would not help.
    match args.model.is_dir() {
        true => Snapshot::read(&args.model).map(|_| ())?,
        false => check_model(args, global)?,
    }
    let python = serving()?;
    let mut command = python.command();
    command.args(["-m", "btr._studio"]).arg(&args.model).args(&args.logs);
    if !args.held_out.is_empty() {
        command.arg("--held-out").args(&args.held_out);
    }
    if let Some(experiment) = &args.experiment {
        command.arg("--experiment").arg(experiment);
    }
    if let Some(folder) = &args.folder {
        command.arg("--folder").arg(folder);
    }
    if let Some(host) = &args.host {
        command.arg("--host").arg(host);
    }
    if let Some(port) = args.port {
        command.arg("--port").arg(port.to_string());
    }
    if args.no_browser {
        command.arg("--no-browser");
    }
    if let Some(threads) = global.threads {
        // Rayon's own name for it, which its pool in Python goes by.
        command.env("RAYON_NUM_THREADS", threads.to_string());
    }
    hand_over(command).map_err(|e| Failure::new("studio", python.unusable(e), None))
}

fn check_model(args: &StudioArgs, global: &Global) -> Result<(), Failure> {
    experiment::model(&common::source(&args.model, global)?)?;
    if !args.logs.is_empty() {
        return Ok(());
    }
    let help = match args.held_out.is_empty() {
        true => "name at least one, or the folder of a run instead of a model",
        false => "put the logs before --held-out, which takes all arguments that follow",
    };
    Err(Failure::new("studio", "no log is given", Some(help.into())))
}

/// The Python that serves pages.
fn serving() -> Result<Python, Failure> {
    let python = Python::named();
    python.imports(NEEDED).map_err(|why| {
        let message = format!("the studio is served by Python, with btr and viser in it: {why}");
        Failure::new("studio", message, Some(Python::remedy("studio").into()))
    })?;
    Ok(python)
}

/// The page of a run that this process computes.
pub(crate) struct RunPage {
    child: Child,
}

impl RunPage {
    /// Serves the page of the run in a folder, beside the run.
    ///
    /// # Errors
    /// No Python that can serve it.
    pub(crate) fn open(folder: &Path, experiment: &Path) -> Result<Self, Failure> {
        let python = serving()?;
        let mut command = python.command();
        command.args(["-m", "btr._studio", "--with-stdin", "--experiment"]).arg(experiment).arg(folder);
        // The standard output is the result's; the page ends with its standard input, however this process ends.
        command.stdin(Stdio::piped()).stdout(std::io::stderr());
        let child = command.spawn().map_err(|e| Failure::new("studio", python.unusable(e), None))?;
        Ok(RunPage { child })
    }

    /// Waits until the page ends or `is_over` says so, and ends it.
    pub(crate) fn wait(mut self, is_over: impl Fn() -> bool) {
        while !is_over() && matches!(self.child.try_wait(), Ok(None)) {
            std::thread::sleep(POLL);
        }
        drop(self.child.stdin.take());
        let _ = self.child.wait();
    }
}

/// Puts the program into the place of this one, so that signals, streams and the exit code are its own.
#[cfg(unix)]
fn hand_over(mut command: Command) -> std::io::Result<u8> {
    Err(std::os::unix::process::CommandExt::exec(&mut command))
}

/// Runs the program to its end, and returns its exit code. Ctrl-C is for the program.
#[cfg(not(unix))]
fn hand_over(mut command: Command) -> std::io::Result<u8> {
    ctrlc::set_handler(|| {}).map_err(std::io::Error::other)?;
    let code = command.status()?.code();
    Ok(code.and_then(|code| u8::try_from(code).ok()).unwrap_or(crate::exit::REFUSED))
}
