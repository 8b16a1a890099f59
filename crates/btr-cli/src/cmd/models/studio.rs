//! `btr studio`: a local page on a model and its logs, which Python serves.

use crate::args::{Global, StudioArgs};
use crate::cmd::common;
use btr_lab::experiment;
use btr_lab::failure::Failure;
use btr_lab::python::Python;
use std::process::Command;

/// What must be there: the page's modules, and the server that it is shown by.
const NEEDED: &str = "btr._studio, viser";

pub(crate) fn run(args: &StudioArgs, global: &Global) -> Result<u8, Failure> {
    // What is wrong with the model counts first: a page would not help.
    experiment::model(&common::source(&args.model, global)?)?;
    let python = Python::named();
    python.imports(NEEDED).map_err(|why| {
        let message = format!("the studio is served by Python, with btr and viser in it: {why}");
        Failure::new("studio", message, Some(Python::remedy("studio").into()))
    })?;
    let mut command = python.command();
    command.args(["-m", "btr._studio"]).arg(&args.model).args(&args.logs);
    if !args.held_out.is_empty() {
        command.arg("--held-out").args(&args.held_out);
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
