//! The paper's phi_2 (eqs. 5 and 6): d(X,Y) = H(X|Y) + H(Y|X) in bits, summed over the motors and the sensors.
//!
//! d is a metric on series of symbols: J. P. Crutchfield, "Information and its metric", in Nonlinear Structures in
//! Physical Systems, Springer 1990. Real-valued series become symbols by binning, with these pitfalls:
//!
//! * Both series share their bins, which span both ranges. With bins of its own each series would be scaled to the same
//!   symbols, and a wrong gain or offset would not show at all.
//! * A one-to-one exchange of symbols costs nothing. A sign flip of a symmetric series remains invisible even with
//!   shared bins, and so does an offset by whole bins of a series that fills only part of them, or between constants.
//! * A little noise or delay costs much: near the edges of bins it decides the symbol.
//!
//! So pair it with a distance of amplitudes when the numbers themselves matter.

use super::{Channels, Distance};
use crate::settings;
use crate::world::Behaviour;
use serde::{Deserialize, Serialize};

/// phi_2, in bits.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Information {
    /// Equal bins across the range of both series; 16. The paper gives no number.
    #[serde(deserialize_with = "settings::bins")]
    pub bins: usize,
    /// Channels to compare; all commands and sensors unless given.
    pub channels: Channels,
}

impl Default for Information {
    fn default() -> Self {
        Information { bins: 16, channels: Channels::default() }
    }
}

impl Distance for Information {
    fn name(&self) -> &'static str {
        "information"
    }

    fn distance(&self, real: &Behaviour, sim: &Behaviour) -> f64 {
        let mut joint = JointHistogram::new(self.bins);
        let bits = |pair: super::channels::ChannelPair| {
            let bins = Bins::spanning(pair.real, &pair.sim, self.bins)?;
            joint.count(pair.real, &pair.sim, &bins);
            Some(joint.entropies().distance())
        };
        self.channels.pairs(&real.log, &sim.log).filter_map(bits).reduce(|a, b| a + b).unwrap_or(f64::INFINITY)
    }
}

/// Entropies of two series of symbols, in bits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InformationDistance {
    /// H(X|Y): the uncertainty about X given Y.
    pub h_x_given_y: f64,
    /// H(Y|X): the uncertainty about Y given X.
    pub h_y_given_x: f64,
    /// H(X).
    pub h_x: f64,
    /// H(Y).
    pub h_y: f64,
}

impl InformationDistance {
    /// d(X,Y) = H(X|Y) + H(Y|X), in bits.
    pub fn distance(&self) -> f64 {
        self.h_x_given_y + self.h_y_given_x
    }
}

/// The information distance of two series of equal length in `bins` (1 to 1024) equal bins that both share. Pairs with
/// a missing or infinite sample are ignored; `None` when none remain.
pub fn information_distance(x: &[f64], y: &[f64], bins: usize) -> Option<InformationDistance> {
    let shared = Bins::spanning(x, y, bins)?;
    let mut joint = JointHistogram::new(bins);
    joint.count(x, y, &shared);
    Some(joint.entropies())
}

/// Equal bins from `low`, the last one closed.
struct Bins {
    low: f64,
    per_unit: f64,
    last: usize,
}

impl Bins {
    fn new(low: f64, high: f64, count: usize) -> Self {
        let count = clamp(count);
        let per_unit = if high > low { count as f64 / (high - low) } else { 0.0 };
        Bins { low, per_unit, last: count - 1 }
    }

    fn spanning(x: &[f64], y: &[f64], count: usize) -> Option<Self> {
        const LANES: usize = 4;
        // Side by side, as one running extreme would wait for each comparison.
        let (mut low, mut high) = ([f64::INFINITY; LANES], [f64::NEG_INFINITY; LANES]);
        for (xs, ys) in x.chunks(LANES).zip(y.chunks(LANES)) {
            for (lane, (&a, &b)) in xs.iter().zip(ys).enumerate() {
                let (smaller, larger) = if a < b { (a, b) } else { (b, a) };
                let there = (a - b).is_finite();
                low[lane] = if there && smaller < low[lane] { smaller } else { low[lane] };
                high[lane] = if there && larger > high[lane] { larger } else { high[lane] };
            }
        }
        let low = low.into_iter().fold(f64::INFINITY, f64::min);
        let high = high.into_iter().fold(f64::NEG_INFINITY, f64::max);
        (low <= high).then(|| Bins::new(low, high, count))
    }

    fn of(&self, value: f64) -> usize {
        // Through 32 bits, which machines convert faster.
        (((value - self.low) * self.per_unit) as u32 as usize).min(self.last)
    }
}

fn clamp(bins: usize) -> usize {
    bins.clamp(1, settings::MOST_BINS)
}

/// How often each pair of symbols occurs.
struct JointHistogram {
    side: usize,
    counts: Vec<u32>,
    x: Vec<u32>,
    y: Vec<u32>,
}

impl JointHistogram {
    fn new(bins: usize) -> Self {
        let side = clamp(bins);
        JointHistogram { side, counts: vec![0; side * side], x: vec![0; side], y: vec![0; side] }
    }

    fn count(&mut self, x: &[f64], y: &[f64], bins: &Bins) {
        self.counts.fill(0);
        for (&a, &b) in x.iter().zip(y) {
            if (a - b).is_finite() {
                self.counts[bins.of(a) * self.side + bins.of(b)] += 1;
            }
        }
        self.y.fill(0);
        for (total, row) in self.x.iter_mut().zip(self.counts.chunks_exact(self.side)) {
            *total = row.iter().sum();
            self.y.iter_mut().zip(row).for_each(|(total, count)| *total += count);
        }
    }

    /// Conditional entropies from conditional frequencies, not as differences of entropies: never negative, and exactly
    /// zero where one series decides the other.
    fn entropies(&self) -> InformationDistance {
        let samples: u32 = self.x.iter().sum();
        let logs = |counts: &[u32]| counts.iter().map(|&count| bits(count)).collect::<Vec<f64>>();
        let (bits_x, bits_y) = (logs(&self.x), logs(&self.y));
        let (mut x_given_y, mut y_given_x) = (0.0, 0.0);
        for (row, of_x) in self.counts.chunks_exact(self.side).zip(&bits_x) {
            for (&count, of_y) in row.iter().zip(&bits_y).filter(|(count, _)| **count > 0) {
                let (weight, of_both) = (f64::from(count), bits(count));
                x_given_y += weight * (of_y - of_both);
                y_given_x += weight * (of_x - of_both);
            }
        }
        let marginal = |counts: &[u32], logs: &[f64]| {
            let taken = counts.iter().zip(logs).filter(|(count, _)| **count > 0);
            taken.map(|(&count, log)| f64::from(count) * (bits(samples) - log)).sum::<f64>()
        };
        let per_sample = 1.0 / f64::from(samples);
        InformationDistance {
            h_x_given_y: x_given_y * per_sample,
            h_y_given_x: y_given_x * per_sample,
            h_x: marginal(&self.x, &bits_x) * per_sample,
            h_y: marginal(&self.y, &bits_y) * per_sample,
        }
    }
}

fn bits(count: u32) -> f64 {
    f64::from(count).log2()
}

#[cfg(test)]
mod tests;
