//! Root mean square of the difference, sample by sample.

use super::channels::{root_mean_square, sum_pairs};
use super::{Channels, Distance, SumOfSquares, comparable};
use crate::optimize::Residuals;
use crate::world::Behaviour;
use serde::{Deserialize, Serialize};

/// Root mean square error over all measured channels, each divided by the standard deviation of the real channel so
/// that units mix (held joints by a tenth of the largest one of their unit). 0 is perfect; a model that stays at the
/// mean scores 1.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Rmse {
    /// Channels to compare; all sensors unless given.
    pub channels: Channels,
}

impl Distance for Rmse {
    fn name(&self) -> &'static str {
        "rmse"
    }

    fn distance(&self, real: &Behaviour, sim: &Behaviour) -> f64 {
        comparable(root_mean_square(&self.channels.scaled_errors(&real.log, &sim.log, rmse)))
    }

    fn as_squares(&self) -> Option<&dyn SumOfSquares> {
        Some(self)
    }
}

impl SumOfSquares for Rmse {
    fn residuals(&self, real: &Behaviour, sim: &Behaviour) -> Residuals {
        self.channels.scaled_residuals(&real.log, &sim.log)
    }
}

/// Root mean square of x - y in their unit; `None` when no sample is present on both sides.
pub fn rmse(x: &[f64], y: &[f64]) -> Option<f64> {
    let (squares, count) = sum_pairs(x, y, |a, b| (a - b) * (a - b));
    (count > 0.0).then(|| (squares / count).sqrt())
}
