//! `btr completions`, `btr man`.

use crate::args::Args;
use crate::failure::Failure;
use clap::CommandFactory;
use clap_complete::Shell;
use std::process::ExitCode;

pub(crate) fn run(shell: Shell) -> Result<ExitCode, Failure> {
    clap_complete::generate(shell, &mut Args::command(), "btr", &mut std::io::stdout());
    Ok(ExitCode::SUCCESS)
}

pub(crate) fn man() -> Result<ExitCode, Failure> {
    let page = clap_mangen::Man::new(Args::command());
    page.render(&mut std::io::stdout()).map_err(|e| Failure::new("output", e.to_string(), None))?;
    Ok(ExitCode::SUCCESS)
}
