//! `btr schema`.

use crate::exit::DONE;
use btr_lab::experiment::File;
use btr_lab::failure::Failure;

pub(crate) fn run() -> Result<u8, Failure> {
    let schema = schemars::schema_for!(File);
    let text = serde_json::to_string_pretty(&schema).map_err(|e| Failure::new("schema", e.to_string(), None))?;
    println!("{text}");
    Ok(DONE)
}
