//! `btr schema`.

use crate::failure::Failure;
use btr_physics::experiment::File;
use std::process::ExitCode;

pub(crate) fn run() -> Result<ExitCode, Failure> {
    let schema = schemars::schema_for!(File);
    let text = serde_json::to_string_pretty(&schema).map_err(|e| Failure::new("schema", e.to_string(), None))?;
    println!("{text}");
    Ok(ExitCode::SUCCESS)
}
