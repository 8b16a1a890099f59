//! Ripples: parts of a value that repeat with a position, as the torque of a motor's magnets does.

use std::f64::consts::PI;

/// Fewest periods within a stroke, and largest order.
const FEWEST: f64 = 1.0;
const LARGEST: f64 = 100.0;
/// A stroke ends where the position has gone back by this share of its whole range.
const BACK: f64 = 0.02;
/// Fewest samples of a stroke.
const SAMPLES: usize = 8;
/// Orders are tried in steps that turn the ripple by this angle over the longest stroke, in rad.
const TURN: f64 = PI / 4.0;
/// A peak stands out from the mean of the orders within this factor of its own, by at least this factor.
const NEARBY: f64 = 2.0;
const CLEAR: f64 = 1.5;

/// A stroke: samples in which the position goes one way, with their values freed from a trend.
struct Stroke {
    samples: Vec<(f64, f64)>,
}

impl Stroke {
    fn new(samples: &[(f64, f64)]) -> Option<Self> {
        let n = samples.len() as f64;
        if samples.len() < SAMPLES {
            return None;
        }
        let (mean_q, mean) =
            (samples.iter().map(|(q, _)| q).sum::<f64>() / n, samples.iter().map(|(_, x)| x).sum::<f64>() / n);
        let spread: f64 = samples.iter().map(|(q, _)| (q - mean_q).powi(2)).sum();
        let slope = samples.iter().map(|(q, x)| (q - mean_q) * (x - mean)).sum::<f64>() / spread;
        let level = |(q, x): &(f64, f64)| (*q, x - mean - slope * (q - mean_q));
        (spread > 0.0).then(|| Stroke { samples: samples.iter().map(level).collect() })
    }

    fn range(&self) -> f64 {
        let ends = self.samples.first().zip(self.samples.last());
        ends.map_or(0.0, |(first, last)| (last.0 - first.0).abs())
    }

    /// How much of its values repeats with this order.
    fn power(&self, order: f64) -> f64 {
        if order * self.range() < FEWEST * 2.0 * PI {
            return 0.0;
        }
        let (mut a, mut b) = (0.0, 0.0);
        for (q, x) in &self.samples {
            let (sin, cos) = (order * q).sin_cos();
            (a, b) = (a + x * sin, b + x * cos);
        }
        (a * a + b * b) / self.samples.len() as f64
    }
}

/// The orders, in periods per 2π of the position, of the clearest ripples of a value; clearest first, at most `most`.
/// Samples that are not finite are left out. Each stroke counts by itself: what is behind a value may lag.
pub fn orders(position: &[f64], value: &[f64], most: usize) -> Vec<f64> {
    let pairs = position.iter().copied().zip(value.iter().copied());
    let samples: Vec<(f64, f64)> = pairs.filter(|(q, x)| q.is_finite() && x.is_finite()).collect();
    let strokes = strokes(&samples);
    let longest = strokes.iter().map(Stroke::range).fold(0.0, f64::max);
    let (travel, steps) = strokes
        .iter()
        .fold((0.0, 0), |(travel, steps), stroke| (travel + stroke.range(), steps + stroke.samples.len()));
    // Four samples in a period at the usual speed.
    let highest = LARGEST.min(PI * steps as f64 / (2.0 * travel));
    let (lowest, step) = (FEWEST * 2.0 * PI / longest, TURN / longest);
    if !(step > 0.0 && lowest < highest) {
        return Vec::new();
    }
    let count = ((highest - lowest) / step) as usize + 1;
    let order = |k: usize| lowest + step * k as f64;
    let powers: Vec<f64> = (0..count).map(|k| strokes.iter().map(|stroke| stroke.power(order(k))).sum()).collect();
    let near = |k: usize| {
        let within = |other: &usize| (order(k) / NEARBY..=order(k) * NEARBY).contains(&order(*other));
        let others: Vec<f64> = (0..count).filter(within).map(|other| powers[other]).collect();
        others.iter().sum::<f64>() / others.len() as f64
    };
    let is_peak =
        |&k: &usize| powers[k] >= powers[k.saturating_sub(1)] && powers.get(k + 1).is_none_or(|next| powers[k] > *next);
    let mut peaks: Vec<(f64, f64)> = (0..count).filter(is_peak).map(|k| (powers[k] / near(k), order(k))).collect();
    peaks.retain(|(contrast, _)| *contrast > CLEAR);
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    peaks.into_iter().take(most).map(|(_, order)| order).collect()
}

/// Cuts samples where the position turns round.
fn strokes(samples: &[(f64, f64)]) -> Vec<Stroke> {
    let positions = || samples.iter().map(|(q, _)| *q);
    let range = positions().fold(f64::NEG_INFINITY, f64::max) - positions().fold(f64::INFINITY, f64::min);
    let (mut cuts, mut extreme, mut forward) = (vec![0], 0, true);
    for (i, q) in positions().enumerate() {
        let ahead = if forward { q - samples[extreme].0 } else { samples[extreme].0 - q };
        if ahead >= 0.0 {
            extreme = i;
        } else if -ahead > BACK * range {
            cuts.push(extreme);
            (forward, extreme) = (!forward, i);
        }
    }
    cuts.push(samples.len());
    cuts.windows(2).filter_map(|cut| Stroke::new(&samples[cut[0]..cut[1]])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A joint that swings, read with noise, and a value with a ripple of this order.
    fn swinging(order: f64, amplitude: f64) -> (Vec<f64>, Vec<f64>) {
        let noise = |i: usize| ((i * 7919 % 1009) as f64 / 1009.0 - 0.5) * 2.0;
        let position = |i: usize| (0.9 * (0.011 * i as f64).sin()) + 0.001 * noise(i);
        let value = |i: usize| {
            amplitude * (order * position(i) + 1.0).sin()
                + noise(3 * i + 1)
                + 2.0 * position(i)
                + (i as f64 * 0.002).sin()
        };
        ((0..2000).map(position).collect(), (0..2000).map(value).collect())
    }

    proptest! {
        #[test]
        fn the_order_of_a_ripple_is_found(order in 8.0f64..40.0) {
            let (position, value) = swinging(order, 1.0);
            let found = orders(&position, &value, 4);
            prop_assert!(found.first().is_some_and(|first| (first - order).abs() < 0.5), "{found:?}");
        }
    }

    #[test]
    fn still_joints_have_no_ripples() {
        assert!(orders(&[0.3; 500], &[1.0; 500], 4).is_empty());
        assert!(orders(&[], &[], 4).is_empty());
        assert!(orders(&[f64::NAN, 1.0], &[0.0, f64::NAN], 4).is_empty());
    }
}
