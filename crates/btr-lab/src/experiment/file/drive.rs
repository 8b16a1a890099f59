//! `[drive]`.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// What the joints are told, and which numbers of it are searched.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DriveSection {
    /// `sine`, `nao_walk`, `nao_kick`, `hold`, `policy`, or `replay` (the command channels of `log`).
    pub kind: String,
    /// Sine, and the clock of a policy: angular frequency in rad/s.
    pub omega_rad_s: Option<f64>,
    /// Policy: the kind of the drive that it corrects; `hold` if not stated.
    pub around: Option<String>,
    /// Policy: what it goes by, of `tilt`, `gyro`, `positions`, `velocities`, `feet` and `clock`; `tilt` and `gyro` if
    /// not stated.
    pub sensors: Option<Vec<String>>,
    /// Policy: the joints that it corrects, as a pattern; all if not stated.
    pub joints: Option<String>,
    /// Policy: hidden units. It is linear without them.
    pub hidden: Option<usize>,
    /// Replay: the log, relative to this file.
    pub log: Option<PathBuf>,
    /// Fixed values by name; parameters left out have their nominal value.
    #[serde(default)]
    pub set: IndexMap<String, f64>,
    /// C: bounds by parameter name; `search = "all"` takes every parameter with its own bounds.
    #[serde(default)]
    pub search: SearchedSection,
    /// Whether the search starts from the drive's nominal values (c_0) or from random ones.
    #[serde(default)]
    pub start_from_nominal: bool,
}

/// Which parameters of a drive make up C.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected \"all\", \"none\", a list of names, or bounds by name: { NAME = [min, max] }")]
pub enum SearchedSection {
    /// `all` or `none`.
    Word(String),
    /// Some, with their own bounds.
    Names(Vec<String>),
    /// Some, with these bounds.
    Bounds(IndexMap<String, [f64; 2]>),
}

impl Default for SearchedSection {
    fn default() -> Self {
        SearchedSection::Word("none".to_owned())
    }
}
