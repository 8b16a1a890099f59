//! Recorded logs: `[reality]` with `kind = "logs"`, and `[logs]`.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Recorded logs.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LogsSection {
    /// The logs, relative to this file.
    #[serde(default)]
    pub files: Vec<PathBuf>,
    /// Logs to judge on that the search never sees.
    #[serde(default)]
    pub held_out: Vec<PathBuf>,
    /// A table with one log per row (column `file`) and whatever else is known of each.
    pub index: Option<PathBuf>,
    /// Rows of the table to learn from: column = value, or a list of values.
    #[serde(default)]
    pub learn: IndexMap<String, Choice>,
    /// Rows of the table to judge on.
    #[serde(default)]
    pub judge: IndexMap<String, Choice>,
    /// Parameters that a column sets for its log: `"gain@motor" = { column = "kp", factor = 0.003 }`.
    #[serde(default)]
    pub columns: IndexMap<String, ColumnSection>,
}

/// A table with one log per row, for logs that are named on the command line.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LogIndexSection {
    /// The table (CSV), relative to this file: a column `file`, and whatever else is known of each log.
    pub index: PathBuf,
    /// Parameters that a column sets for its log: `"mass@bob" = { column = "mass" }`.
    #[serde(default)]
    pub columns: IndexMap<String, ColumnSection>,
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

/// A column of the index and what to multiply it with.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ColumnSection {
    /// Its name in the table's first line.
    pub column: String,
    /// From the column's unit to the parameter's.
    #[serde(default = "one")]
    pub factor: f64,
}

fn one() -> f64 {
    1.0
}
