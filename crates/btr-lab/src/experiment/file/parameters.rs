//! `[parameters]` and `[[effects]]`.

use btr_core::space::Scale;
use btr_physics::effects::FormulaTarget;
use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A free parameter: its bounds and its current value. A name with a pattern (`kp@*`, `mass@left_*`, `kp@hip,knee`) is
/// a free parameter of each joint or link that it matches and that has the value: it starts there, and `relative` is
/// relative to it. A joint with an entry of its own keeps that one. An effect's parameter (`command_delay.delay@*`) is
/// one value for all, as its effect is, unless it is `relative` to values that the model states for single joints.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ParameterSection {
    /// Smallest and largest value, in the parameter's unit.
    pub bounds: Option<[f64; 2]>,
    /// Bounds as factors of the model's value, instead of `bounds`.
    pub relative: Option<[f64; 2]>,
    /// With a pattern: one value for all that it matches, as for servos of the same kind.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub shared: bool,
    /// Scale of the search: linear or logarithmic.
    #[serde(default)]
    pub scale: ScaleName,
    /// Current value; default: the model's value. A fitted model has its estimate here.
    pub value: Option<f64>,
    /// Standard deviation of `value` that earlier logs leave, in the parameter's unit: the prior of `fit` and
    /// `diagnose` on further logs. A fitted model has it where it has an interval, wider where estimates are
    /// correlated, as a file does not hold correlations. Remove it to fit the same logs again.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sd: Option<f64>,
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
    /// Where it acts: a joint, a link, `base`, `*` or a pattern; `JOINT#2` for the second instance there.
    #[serde(default = "everywhere")]
    pub site: String,
    /// Formula: the quantity that the law gives.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub on: Option<FormulaTarget>,
    /// Formula: an expression in `q`, `dq`, `ddq`, `cmd`, `tau`, `t`, its parameters and, on a torque or a command,
    /// `q_parent`, `dq_parent`, `tau_parent`, `q_child`, `dq_child`, `tau_child` of the joints before and after it in
    /// the chain; or the name of a function that the calling program provides (`python:slip`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub law: Option<String>,
    /// Its parameters by name; all others have their off value.
    #[serde(flatten)]
    pub values: IndexMap<String, f64>,
}

fn everywhere() -> String {
    "*".to_owned()
}
