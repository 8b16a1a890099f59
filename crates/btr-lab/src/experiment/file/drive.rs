//! `[drive]`.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The drive of the joints, and which of its parameters are searched.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DriveSection {
    /// `sine`, `nao_walk`, `nao_kick`, `hold`, `policy`, or `replay` (the command channels of `log`).
    pub kind: String,
    /// Sine, and the clock of a policy: angular frequency in rad/s.
    pub omega_rad_s: Option<f64>,
    /// Policy: the kind of the drive that it corrects; default `hold`.
    pub around: Option<String>,
    /// Policy: its inputs, from `tilt`, `gyro`, `positions`, `velocities`, `feet` and `clock`; default `tilt` and
    /// `gyro`.
    pub sensors: Option<Vec<String>>,
    /// Policy: the joints that it corrects, as a pattern; default all.
    pub joints: Option<String>,
    /// Policy: number of hidden units; without hidden units the policy is linear.
    pub hidden: Option<usize>,
    /// Replay: path of the log, relative to this file.
    pub log: Option<PathBuf>,
    /// Fixed values by parameter name; all other parameters have their nominal value.
    #[serde(default)]
    pub set: IndexMap<String, f64>,
    /// C: bounds by parameter name; `search = "all"` searches every parameter within its default bounds.
    #[serde(default)]
    pub search: SearchedSection,
    /// Whether the search starts from the drive's nominal values (c_0) instead of random ones.
    #[serde(default)]
    pub start_from_nominal: bool,
}

/// Which parameters of a drive make up C.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected \"all\", \"none\", a list of names, or bounds by name: { NAME = [min, max] }")]
pub enum SearchedSection {
    /// `all` or `none`.
    Word(String),
    /// Some parameters, with their default bounds.
    Names(Vec<String>),
    /// Some parameters, with these bounds.
    Bounds(IndexMap<String, [f64; 2]>),
}

impl Default for SearchedSection {
    fn default() -> Self {
        SearchedSection::Word("none".to_owned())
    }
}
