//! `btr schema`.

use crate::failure::{DONE, Failure};
use btr_lab::experiment::File;

pub(crate) fn run() -> Result<u8, Failure> {
    let schema = schemars::schema_for!(File);
    let text = serde_json::to_string_pretty(&schema).map_err(|e| Failure::new("schema", e.to_string(), None))?;
    println!("{text}");
    Ok(DONE)
}
