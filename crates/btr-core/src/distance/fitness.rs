//! The paper's delta_k = |f_s - f_r| (eq. 3): it compares only the fitness of the two behaviours. Averaged over the
//! controllers that were tried it is phi_1 (eq. 4).

use super::{Distance, comparable};
use crate::world::Behaviour;
use serde::{Deserialize, Serialize};

/// Difference of fitness, in the fitness' own unit.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FitnessDifference {}

impl Distance for FitnessDifference {
    fn name(&self) -> &'static str {
        "fitness"
    }

    fn distance(&self, real: &Behaviour, sim: &Behaviour) -> f64 {
        comparable((sim.fitness - real.fitness).abs())
    }
}
