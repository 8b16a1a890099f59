//! `btr completions`, `btr man`.

use crate::args::Args;
use crate::exit::DONE;
use btr_lab::failure::Failure;
use clap::CommandFactory;
use clap_complete::Shell;

pub(crate) fn run(shell: Shell) -> Result<u8, Failure> {
    clap_complete::generate(shell, &mut Args::command(), "btr", &mut std::io::stdout());
    Ok(DONE)
}

pub(crate) fn man() -> Result<u8, Failure> {
    let page = clap_mangen::Man::new(Args::command());
    page.render(&mut std::io::stdout()).map_err(|e| Failure::new("output", e.to_string(), None))?;
    Ok(DONE)
}
