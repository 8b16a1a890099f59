//! Errors in multiples of the sensors' noise.

use super::channels::{ChannelPair, sum_pairs};
use super::{Channels, Distance, SumOfSquares, comparable};
use crate::log::Role;
use crate::optimize::Residuals;
use crate::signal::noise::NoiseEstimate;
use crate::world::Behaviour;
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

/// Root mean square over all samples of all measured channels, each error divided by the standard deviation of its
/// sensor's noise: the square root of chi-squared per sample. A simulation that explains everything but the noise
/// scores 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Whitened {
    /// Channels to compare; all sensors unless given.
    pub channels: Channels,
    /// Standard deviation of the noise by channel, each in its channel's unit; `*` stands for any characters (`"q_*" =
    /// 0.0005`), the first pattern that matches counts. Channels without a value here take it from the file's
    /// `[noise]`, and channels without a value there from an estimate on the real log's own readings.
    pub noise: IndexMap<String, f64>,
}

impl Whitened {
    /// The errors of each channel in multiples of its noise; NaN where a sample is missing.
    fn errors(&self, real: &Behaviour, sim: &Behaviour) -> Vec<Vec<f64>> {
        let pairs = self.channels.pairs(&real.log, &sim.log).filter(|pair| pair.role == Role::Measured);
        let block = |pair: ChannelPair| {
            let sigma = self.sigma(&pair);
            pair.real.iter().zip(pair.sim.iter()).map(|(real, sim)| (sim - real) / sigma).collect()
        };
        pairs.map(block).collect()
    }

    fn sigma(&self, pair: &ChannelPair) -> f64 {
        let stated = self.noise.iter().find(|(pattern, _)| super::channels::matches(pattern, pair.name));
        let estimated = || NoiseEstimate::of(pair.real).map_or(f64::NAN, |noise| noise.floor());
        stated.map(|(_, sigma)| *sigma).filter(|sigma| *sigma > 0.0).unwrap_or_else(estimated)
    }
}

impl Distance for Whitened {
    fn name(&self) -> &'static str {
        "whitened"
    }

    fn distance(&self, real: &Behaviour, sim: &Behaviour) -> f64 {
        let (mut squares, mut count) = (0.0, 0.0);
        for block in self.errors(real, sim) {
            let (sum, samples) = sum_pairs(&block, &block, |a, b| a * b);
            (squares, count) = (squares + sum, count + samples);
        }
        comparable((squares / count).sqrt())
    }

    fn as_squares(&self) -> Option<&dyn SumOfSquares> {
        Some(self)
    }

    fn whitens(&self) -> bool {
        true
    }
}

impl SumOfSquares for Whitened {
    fn residuals(&self, real: &Behaviour, sim: &Behaviour) -> Residuals {
        let mut errors = self.errors(real, sim);
        let samples = errors.iter().flatten().filter(|error| !error.is_nan()).count() as f64;
        errors.iter_mut().flatten().for_each(|error| *error /= samples.sqrt());
        errors
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::log::Log;

    fn behaviour(q: Vec<f64>, tau: Vec<f64>) -> Behaviour {
        let mut log = Log::new((0..q.len()).map(|i| i as f64).collect()).unwrap();
        log.insert("q_knee", "rad", Role::Measured, q).unwrap();
        log.insert("tau_knee", "N·m", Role::Measured, tau).unwrap();
        Behaviour { log, fitness: 0.0 }
    }

    #[test]
    fn errors_count_in_multiples_of_their_channels_noise() {
        let real = behaviour(vec![0.0, 0.1, 0.2], vec![1.0, f64::NAN, 3.0]);
        let sim = behaviour(vec![0.002, 0.098, 0.202], vec![1.5, 2.0, 2.5]);
        let noise = [("q_*".to_owned(), 0.001), ("tau_*".to_owned(), 0.25)].into_iter().collect();
        let whitened = Whitened { noise, ..Whitened::default() };
        assert!((whitened.distance(&real, &sim) - 2.0).abs() < 1e-9);
        let residuals = whitened.residuals(&real, &sim);
        assert_eq!(residuals.concat().iter().filter(|e| e.is_finite()).count(), 5);
    }

    #[test]
    fn noise_that_is_not_stated_is_estimated_from_the_real_log() {
        let mut rng = crate::random::stream(7, &[]);
        let mut rough = |i: usize| 0.5 * (i as f64 / 9.0).sin() + 0.01 * crate::random::normal(&mut rng);
        let real = behaviour((0..200).map(&mut rough).collect(), vec![f64::NAN; 200]);
        let sim = behaviour((0..200).map(|i| 0.5 * (i as f64 / 9.0).sin()).collect(), vec![0.0; 200]);
        let distance = Whitened::default().distance(&real, &sim);
        assert!((0.8..1.25).contains(&distance), "{distance}");
    }
}
