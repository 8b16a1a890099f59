//! `btr schema`, `btr completions`, `btr man`: documents generated from the code.

use crate::args::Args;
use crate::exit::DONE;
use btr_lab::experiment::File;
use btr_lab::failure::Failure;
use clap::CommandFactory;
use clap_complete::Shell;

pub(crate) fn schema() -> Result<u8, Failure> {
    let schema = schemars::schema_for!(File);
    let text = serde_json::to_string_pretty(&schema).map_err(|e| Failure::new("schema", e.to_string(), None))?;
    println!("{text}");
    Ok(DONE)
}

pub(crate) fn completions(shell: Shell) -> Result<u8, Failure> {
    clap_complete::generate(shell, &mut Args::command(), "btr", &mut std::io::stdout());
    Ok(DONE)
}

pub(crate) fn man() -> Result<u8, Failure> {
    let page = clap_mangen::Man::new(Args::command());
    page.render(&mut std::io::stdout()).map_err(|e| Failure::new("output", e.to_string(), None))?;
    Ok(DONE)
}
