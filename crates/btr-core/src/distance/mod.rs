//! Distances between simulated and real behaviours.
//!
//! All distances on logs follow the same rules (see [`Channels`]): they compare only channels that both logs have,
//! commands and sensors but no [`Truth`](crate::log::Role::Truth) channels, with the simulated log on the real log's
//! clock; a sample that is missing on either side is ignored on both.

mod channels;
mod dtw;
mod fit;
mod fitness;
mod information;
#[cfg(test)]
mod laws;
mod rmse;
mod spec;
mod spectrum;
mod whitened;

pub use channels::Channels;
pub(crate) use channels::matches;
pub use dtw::{Dtw, dtw};
pub use fit::{NormalisedRmse, fit_percent};
pub use fitness::FitnessDifference;
pub use information::{Information, InformationDistance, information_distance};
pub use rmse::{Rmse, rmse};
pub use spec::{DISTANCES, DistanceSpec};
pub use spectrum::{Spectrum, spectral_difference};
pub use whitened::Whitened;

use crate::optimize::Residuals;
use crate::world::Behaviour;

/// A distance between a real and a simulated behaviour.
pub trait Distance: Send + Sync {
    /// Its name in experiment files.
    fn name(&self) -> &'static str;
    /// 0 for equal behaviours; NaN never, `f64::INFINITY` where they cannot be compared.
    fn distance(&self, real: &Behaviour, sim: &Behaviour) -> f64;
    /// The same as a sum of squares, where it is one.
    fn as_squares(&self) -> Option<&dyn SumOfSquares> {
        None
    }
    /// Whether it counts errors in multiples of the sensors' noise: chi-squared per sample is then its square, and it
    /// defines a likelihood.
    fn whitens(&self) -> bool {
        false
    }
}

/// A distance whose square is a sum of squares: the input of a least-squares search.
pub trait SumOfSquares: Send + Sync {
    /// The signed errors, simulated minus real, whose squares add up to the square of the distance; a block per
    /// channel, NaN where a sample is missing.
    fn residuals(&self, real: &Behaviour, sim: &Behaviour) -> Residuals;
}

/// NaN becomes infinite: the behaviours cannot be compared.
fn comparable(distance: f64) -> f64 {
    if distance.is_nan() { f64::INFINITY } else { distance }
}
