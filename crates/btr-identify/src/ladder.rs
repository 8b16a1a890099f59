//! The steps by which the error falls.

use serde::{Deserialize, Serialize};

/// One step of the error ladder, in multiples of the noise floor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LadderStep {
    /// What was done.
    pub step: String,
    /// Root mean square error on the training logs.
    pub train: f64,
    /// The same on held-out logs; none without such.
    pub held_out: Option<f64>,
    /// The coordinates of all parameters then; empty where the step has no point of a residual model.
    #[serde(skip)]
    pub u: Vec<f64>,
}
