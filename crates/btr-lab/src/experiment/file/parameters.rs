//! `[parameters]` and `[[effects]]`.

use btr_core::space::Scale;
use btr_physics::effects::FormulaTarget;
use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A parameter in doubt: its bounds and what is believed now.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ParameterSection {
    /// Smallest and largest value, in the parameter's unit.
    pub bounds: Option<[f64; 2]>,
    /// The same as factors of the robot's own value.
    pub relative: Option<[f64; 2]>,
    /// Linear or logarithmic.
    #[serde(default)]
    pub scale: ScaleName,
    /// What is believed now; the robot's own value unless given. A fitted model carries its estimate here.
    pub value: Option<f64>,
}

/// Linear or logarithmic.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ScaleName {
    /// Equal steps are equal differences.
    #[default]
    Linear,
    /// Equal steps are equal ratios.
    Log,
}

impl From<ScaleName> for Scale {
    fn from(name: ScaleName) -> Self {
        match name {
            ScaleName::Linear => Scale::Linear,
            ScaleName::Log => Scale::Log,
        }
    }
}

/// An effect with its parameters.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct EffectSection {
    /// Its name; `btr effects` lists them.
    pub effect: String,
    /// Joint, link, `base`, `*` or a pattern.
    #[serde(default = "everywhere")]
    pub site: String,
    /// Formula: what the law gives.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub on: Option<FormulaTarget>,
    /// Formula: an expression over `q`, `dq`, `ddq`, `cmd`, `tau`, `t` and its parameters, or the name of a function
    /// that the program brings along (`python:slip`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub law: Option<String>,
    /// Its parameters by name; those left out have their off value.
    #[serde(flatten)]
    pub values: IndexMap<String, f64>,
}

fn everywhere() -> String {
    "*".to_owned()
}
