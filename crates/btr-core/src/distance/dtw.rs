//! Dynamic time warping: the difference that remains when one series may run ahead or lag a little.
//!
//! H. Sakoe and S. Chiba, "Dynamic programming algorithm optimization for spoken word recognition", IEEE Transactions
//! on Acoustics, Speech and Signal Processing 26, 1978: here without slope constraint, with their band.

use super::channels::root_mean_square;
use super::{Channels, Distance, comparable};
use crate::settings;
use crate::world::Behaviour;
use serde::{Deserialize, Serialize};

/// Root mean square over the measured channels of their [`dtw`] distance, each divided by the standard deviation of the
/// real channel (held joints by a tenth of the largest one of their unit). Each channel is warped by itself, by sample
/// number: the clock should be even.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Dtw {
    /// Largest shift of a sample, as a share of the whole series; 0.1.
    #[serde(deserialize_with = "settings::share")]
    pub band: f64,
    /// Longer series are averaged in blocks down to at most this many samples; 512. The work grows with its square.
    #[serde(deserialize_with = "settings::at_least_two")]
    pub samples: usize,
    /// Channels to compare; all sensors unless given.
    pub channels: Channels,
}

impl Default for Dtw {
    fn default() -> Self {
        Dtw { band: 0.1, samples: 512, channels: Channels::default() }
    }
}

impl Distance for Dtw {
    fn name(&self) -> &'static str {
        "dtw"
    }

    fn distance(&self, real: &Behaviour, sim: &Behaviour) -> f64 {
        let errors = self.channels.scaled_errors(&real.log, &sim.log, |x, y| {
            let (x, y) = thin(x, y, self.samples);
            dtw(&x, &y, self.band)
        });
        comparable(root_mean_square(&errors))
    }
}

/// The warping distance of two series of equal length without missing samples, in their unit: the root of the least sum
/// of squares along any path within the band (a share of the length), divided by the length. Never above the root mean
/// square error, which is the straight path. `None` for empty or unequal series.
pub fn dtw(x: &[f64], y: &[f64], band: f64) -> Option<f64> {
    let n = x.len();
    if n == 0 || y.len() != n {
        return None;
    }
    // The cast saturates: NaN and negative bands are 0, a large one is the whole series.
    let reach = ((band * n as f64).ceil() as usize).min(n);
    // Index j + 1 holds the cheapest way to (i, j); outside the band the cost is infinite.
    let (mut before, mut now) = (vec![f64::INFINITY; n + 1], vec![f64::INFINITY; n + 1]);
    before[0] = 0.0;
    for (i, &a) in x.iter().enumerate() {
        let (from, to) = (i.saturating_sub(reach), (i + reach + 1).min(n));
        let mut left = f64::INFINITY;
        now[from] = left;
        for j in from..to {
            left = left.min(before[j]).min(before[j + 1]) + (a - y[j]) * (a - y[j]);
            now[j + 1] = left;
        }
        if to < n {
            now[to + 1] = f64::INFINITY;
        }
        std::mem::swap(&mut before, &mut now);
    }
    Some((before[n] / n as f64).sqrt())
}

/// Averages over blocks so that at most `most` samples remain; samples that either side misses are left out.
fn thin(x: &[f64], y: &[f64], most: usize) -> (Vec<f64>, Vec<f64>) {
    let block = x.len().div_ceil(most.max(1)).max(1);
    let average = |(x, y): (&[f64], &[f64])| {
        let present = || x.iter().zip(y).filter(|(a, b)| !(*a - *b).is_nan());
        let count = present().count() as f64;
        let sums = present().fold((0.0, 0.0), |sum, (a, b)| (sum.0 + a, sum.1 + b));
        (count > 0.0).then(|| (sums.0 / count, sums.1 / count))
    };
    x.chunks(block).zip(y.chunks(block)).filter_map(average).unzip()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::distance::rmse;
    use proptest::prelude::*;

    /// The definition: the cheapest way to (i, j), by trying all predecessors.
    fn cheapest(x: &[f64], y: &[f64], reach: usize, i: usize, j: usize) -> f64 {
        if i.abs_diff(j) > reach {
            return f64::INFINITY;
        }
        let here = (x[i] - y[j]).powi(2);
        let up = if i > 0 { cheapest(x, y, reach, i - 1, j) } else { f64::INFINITY };
        let left = if j > 0 { cheapest(x, y, reach, i, j - 1) } else { f64::INFINITY };
        let diagonal = if i > 0 && j > 0 { cheapest(x, y, reach, i - 1, j - 1) } else { f64::INFINITY };
        if i + j == 0 { here } else { here + up.min(left).min(diagonal) }
    }

    proptest! {
        #[test]
        fn equals_the_definition(rows in prop::collection::vec((-1.0..1.0f64, -1.0..1.0f64), 1..8), reach in 0usize..8) {
            let (x, y): (Vec<f64>, Vec<f64>) = rows.into_iter().unzip();
            let n = x.len();
            let expected = (cheapest(&x, &y, reach, n - 1, n - 1) / n as f64).sqrt();
            // A little below the exact share, so that rounding up cannot reach one sample further.
            let got = dtw(&x, &y, (reach as f64 - 1e-9) / n as f64).unwrap();
            prop_assert!((got - expected).abs() < 1e-12, "{got} {expected}");
        }

        #[test]
        fn lies_between_zero_and_the_straight_path(
            rows in prop::collection::vec((-1.0..1.0f64, -1.0..1.0f64), 1..60), narrow in 0.0..0.5f64, more in 0.0..0.5f64
        ) {
            let (x, y): (Vec<f64>, Vec<f64>) = rows.into_iter().unzip();
            let (straight, tight, wide) = (rmse(&x, &y).unwrap(), dtw(&x, &y, narrow).unwrap(), dtw(&x, &y, narrow + more).unwrap());
            prop_assert!(wide <= tight && tight <= straight + 1e-12);
            prop_assert!((tight - dtw(&y, &x, narrow).unwrap()).abs() < 1e-12);
            prop_assert!(dtw(&x, &x, narrow).unwrap() <= 0.0);
        }
    }

    #[test]
    fn a_delay_within_the_band_costs_little() {
        let wave = |delay: f64| (0..400).map(|i| ((f64::from(i) - delay) * 0.05).sin()).collect::<Vec<_>>();
        let (x, late) = (wave(0.0), wave(12.0));
        assert!(rmse(&x, &late).unwrap() > 0.4);
        assert!(dtw(&x, &late, 0.05).unwrap() < 0.1);
        assert!(dtw(&x, &late, 0.01).unwrap() > 0.2);
    }

    #[test]
    fn blocks_are_averages_of_what_both_have() {
        let (x, y) = thin(&[1.0, 3.0, f64::NAN, 5.0, f64::NAN, 1.0], &[0.0, 2.0, 9.0, 4.0, 1.0, f64::NAN], 3);
        assert_eq!((x, y), (vec![2.0, 5.0], vec![1.0, 4.0]));
    }
}
