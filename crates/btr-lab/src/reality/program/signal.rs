//! The signal that asks a program to end.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What asks a program to end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StopSignal {
    /// SIGTERM.
    #[default]
    Sigterm,
    /// SIGINT, as Ctrl-C sends it: Python then runs what stands below `finally`.
    Sigint,
}
