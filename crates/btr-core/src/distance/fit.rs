//! The fit as system identification reports it: 100 % · (1 - ||y - ŷ|| / ||y - mean y||), MATLAB's `compare`.

use super::channels::sum_pairs;
use super::rmse::rmse;
use super::{Channels, Distance, comparable};
use crate::settings;
use crate::world::Behaviour;
use serde::{Deserialize, Serialize};

/// Mean over the measured channels of the normalised root mean square error, that is of 1 - fit/100. Unlike
/// [`Rmse`](super::Rmse), which a single bad channel dominates, no channel counts more than `most`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct NormalisedRmse {
    /// Where the error of a channel is cut off; 10, a fit of -900 %.
    #[serde(deserialize_with = "settings::positive")]
    pub most: f64,
    /// Channels to compare; all sensors unless given.
    pub channels: Channels,
}

impl Default for NormalisedRmse {
    fn default() -> Self {
        NormalisedRmse { most: 10.0, channels: Channels::default() }
    }
}

impl Distance for NormalisedRmse {
    fn name(&self) -> &'static str {
        "normalised_rmse"
    }

    fn distance(&self, real: &Behaviour, sim: &Behaviour) -> f64 {
        let errors = self.channels.scaled_errors(&real.log, &sim.log, rmse);
        comparable(errors.iter().map(|e| e.min(self.most)).sum::<f64>() / errors.len() as f64)
    }
}

/// The fit of `model` to `real` in percent: 100 is perfect, 0 no better than the mean of `real`, negative worse than
/// that. `None` when no sample is present on both sides or `real` is constant.
pub fn fit_percent(real: &[f64], model: &[f64]) -> Option<f64> {
    let both = |a: f64, b: f64, value: f64| if (a - b).is_nan() { f64::NAN } else { value };
    let (sum, count) = sum_pairs(real, model, |a, b| both(a, b, a));
    let (spread, _) = sum_pairs(real, model, |a, b| both(a, b, (a - sum / count).powi(2)));
    let error = rmse(real, model)?;
    (spread > 0.0).then(|| 100.0 * (1.0 - error / (spread / count).sqrt()))
}
