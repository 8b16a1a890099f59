//! Recorded logs: `[reality]` with `kind = "logs"`, and `[logs]`.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Recorded logs.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LogsSection {
    /// Paths of the training logs, relative to this file.
    #[serde(default)]
    pub files: Vec<PathBuf>,
    /// Paths of the held-out logs, which the search does not use.
    #[serde(default)]
    pub held_out: Vec<PathBuf>,
    /// Path of an index (CSV) with one log per row: a column `file`, and further columns with properties of each log.
    pub index: Option<PathBuf>,
    /// Rows of the index that select training logs: column = value, or a list of values.
    #[serde(default)]
    pub learn: IndexMap<String, Choice>,
    /// Rows of the index that select held-out logs.
    #[serde(default)]
    pub judge: IndexMap<String, Choice>,
    /// Parameters that a column sets for each log: `"gain@motor" = { column = "kp", factor = 0.003 }`.
    #[serde(default)]
    pub columns: IndexMap<String, ColumnSection>,
}

/// An index with one log per row, for logs that are named on the command line.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LogIndexSection {
    /// Path of the index (CSV), relative to this file: a column `file`, and further columns with properties of each
    /// log.
    pub index: PathBuf,
    /// Parameters that a column sets for each log: `"mass@bob" = { column = "mass" }`.
    #[serde(default)]
    pub columns: IndexMap<String, ColumnSection>,
    /// A column that says which logs are runs of the same command: those with the same text in it, unless it is empty.
    /// Without it, logs with equal commands and settings are.
    pub repeats: Option<String>,
}

/// One value or several.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a text, a number, or a list of either")]
pub enum Choice {
    /// A text.
    Text(String),
    /// A number.
    Number(f64),
    /// Any of these texts.
    Texts(Vec<String>),
    /// Any of these numbers.
    Numbers(Vec<f64>),
}

/// A column of the index and a factor for its values.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ColumnSection {
    /// Its name in the header of the index.
    pub column: String,
    /// Conversion factor from the column's unit to the parameter's unit.
    #[serde(default = "one")]
    pub factor: f64,
}

fn one() -> f64 {
    1.0
}
