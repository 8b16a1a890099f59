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
/// How many orders are taken from all strokes together, and the least share of the squares that one must explain.
const TOGETHER: usize = 2;
const WORTH: f64 = 0.1;
/// A ripple whose waves differ from each other, or from a trend, by less than this share is none.
const FLAT: f64 = 1e-6;

/// A stroke: samples in which the position goes one way, with their values freed from a trend; positions from their
/// mean.
struct Stroke {
    samples: Vec<(f64, f64)>,
    /// The mean position.
    mean: f64,
    /// Sum of the squared positions.
    spread: f64,
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
        let level = |(q, x): &(f64, f64)| (q - mean_q, x - mean - slope * (q - mean_q));
        (spread > 0.0).then(|| Stroke { samples: samples.iter().map(level).collect(), mean: mean_q, spread })
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

    /// The share of the squares of its values that a ripple of this order explains beside the trend, and its phase.
    fn share(&self, order: f64) -> (f64, f64) {
        let n = self.samples.len() as f64;
        let (mut ss, mut sc, mut cc) = (0.0, 0.0, 0.0);
        let (mut s1, mut c1, mut sq, mut cq) = (0.0, 0.0, 0.0, 0.0);
        let (mut sx, mut cx, mut xx) = (0.0, 0.0, 0.0);
        for (q, x) in &self.samples {
            let (sin, cos) = (order * q).sin_cos();
            (ss, sc, cc) = (ss + sin * sin, sc + sin * cos, cc + cos * cos);
            (s1, c1, sq, cq) = (s1 + sin, c1 + cos, sq + sin * q, cq + cos * q);
            (sx, cx, xx) = (sx + sin * x, cx + cos * x, xx + x * x);
        }
        // What a trend explains of the waves is taken off; the values have none.
        let beside =
            |product: f64, (a1, aq): (f64, f64), (b1, bq): (f64, f64)| product - a1 * b1 / n - aq * bq / self.spread;
        let (sin, cos) = ((s1, sq), (c1, cq));
        let (ss, sc, cc) = (beside(ss, sin, sin), beside(sc, sin, cos), beside(cc, cos, cos));
        let determinant = ss * cc - sc * sc;
        if determinant <= FLAT * ss * cc || xx == 0.0 {
            return (0.0, 0.0);
        }
        let (a, b) = ((cc * sx - sc * cx) / determinant, (ss * cx - sc * sx) / determinant);
        ((a * sx + b * cx) / xx, b.atan2(a) - order * self.mean)
    }
}

/// A ripple that a value shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ripple {
    /// Periods per 2π of the position.
    pub order: f64,
    /// The phase of its sine where the position is zero, in rad; none where it differs from stroke to stroke.
    pub phase: Option<f64>,
}

/// The clearest ripples of a value: at most two that all strokes show together, with one phase, and at most `most` that
/// show in single strokes, clearest first: what is behind a value may lag, and its strokes then have different phases.
/// Samples that are not finite are left out.
pub fn ripples(position: &[f64], value: &[f64], most: usize) -> Vec<Ripple> {
    let pairs = position.iter().copied().zip(value.iter().copied());
    let samples: Vec<(f64, f64)> = pairs.filter(|(q, x)| q.is_finite() && x.is_finite()).collect();
    let strokes = strokes(&samples);
    let (travel, steps) = strokes
        .iter()
        .fold((0.0, 0), |(travel, steps), stroke| (travel + stroke.range(), steps + stroke.samples.len()));
    // Four samples in a period at the usual speed.
    let highest = LARGEST.min(PI * steps as f64 / (2.0 * travel));
    let mut found = Stroke::new(&samples).map_or_else(Vec::new, |whole| of_all(&whole, highest));
    found.extend(of_strokes(&strokes, highest, most).into_iter().map(|order| Ripple { order, phase: None }));
    found
}

/// The ripples that all samples show with one phase, those first that explain most.
fn of_all(whole: &Stroke, highest: f64) -> Vec<Ripple> {
    let positions = || whole.samples.iter().map(|(q, _)| *q);
    let range = positions().fold(f64::NEG_INFINITY, f64::max) - positions().fold(f64::INFINITY, f64::min);
    let orders = tried(range, highest);
    let shares: Vec<f64> = orders.iter().map(|order| whole.share(*order).0).collect();
    let worth = peaks(&shares).map(|k| (shares[k], between(&orders, &shares, k))).filter(|(share, _)| *share > WORTH);
    let of_order = |order: f64| Ripple { order, phase: Some(whole.share(order).1) };
    clearest(worth, TOGETHER).into_iter().map(of_order).collect()
}

/// The orders that stand out among those nearby when each stroke has a phase of its own, clearest first.
fn of_strokes(strokes: &[Stroke], highest: f64, most: usize) -> Vec<f64> {
    let orders = tried(strokes.iter().map(Stroke::range).fold(0.0, f64::max), highest);
    let powers: Vec<f64> = orders.iter().map(|order| strokes.iter().map(|stroke| stroke.power(*order)).sum()).collect();
    let near = |k: usize| {
        let within = |other: &usize| (orders[k] / NEARBY..=orders[k] * NEARBY).contains(&orders[*other]);
        let others: Vec<f64> = (0..orders.len()).filter(within).map(|other| powers[other]).collect();
        others.iter().sum::<f64>() / others.len() as f64
    };
    clearest(peaks(&powers).map(|k| (powers[k] / near(k), orders[k])).filter(|(clear, _)| *clear > CLEAR), most)
}

/// The orders to try with a motion over this range.
fn tried(range: f64, highest: f64) -> Vec<f64> {
    let (lowest, step) = (FEWEST * 2.0 * PI / range, TURN / range);
    if !(step > 0.0 && lowest < highest) {
        return Vec::new();
    }
    (0..=((highest - lowest) / step) as usize).map(|k| lowest + step * k as f64).collect()
}

/// Where values are not below their neighbours.
fn peaks(values: &[f64]) -> impl Iterator<Item = usize> {
    (0..values.len())
        .filter(|&k| values[k] >= values[k.saturating_sub(1)] && values.get(k + 1).is_none_or(|next| values[k] > *next))
}

/// The order at the top of the parabola through a peak and its neighbours.
fn between(orders: &[f64], values: &[f64], peak: usize) -> f64 {
    let neighbours = peak.checked_sub(1).and_then(|before| values.get(before)).zip(values.get(peak + 1));
    let Some((left, right)) = neighbours else { return orders[peak] };
    let curvature = left - 2.0 * values[peak] + right;
    let shift = if curvature < 0.0 { 0.5 * (left - right) / curvature } else { 0.0 };
    orders[peak] + shift * (orders[peak] - orders[peak - 1])
}

/// The orders of the largest values, at most `most`.
fn clearest(peaks: impl Iterator<Item = (f64, f64)>, most: usize) -> Vec<f64> {
    let mut peaks: Vec<(f64, f64)> = peaks.collect();
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
    #![allow(clippy::unwrap_used)]
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
            let found = ripples(&position, &value, 4);
            prop_assert!(found.first().is_some_and(|first| (first.order - order).abs() < 0.5), "{found:?}");
        }
    }

    #[test]
    fn short_strokes_show_a_ripple_together() {
        // Moves by half a period and pauses: a servo's error is that of where it stands.
        let target = |i: usize| 0.15 * [0.0, 1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0][i / 250 % 8];
        let mut at = 0.0;
        let moves = |i: usize| {
            at += 0.05 * (target(i) - at);
            at
        };
        let position: Vec<f64> = (0..4000).map(moves).collect();
        let value: Vec<f64> = position.iter().map(|q| (14.0 * q + 1.0).sin() + 2.0 * q).collect();
        let found = ripples(&position, &value, 0)[0];
        assert!((found.order - 14.0).abs() < 0.2, "{found:?}");
        let turned = (found.phase.unwrap() + (found.order - 14.0) * 0.3 - 1.0).rem_euclid(2.0 * PI);
        assert!(turned.min(2.0 * PI - turned) < 0.1, "{found:?}");
    }

    #[test]
    fn still_joints_have_no_ripples() {
        assert!(ripples(&[0.3; 500], &[1.0; 500], 4).is_empty());
        assert!(ripples(&[], &[], 4).is_empty());
        assert!(ripples(&[f64::NAN, 1.0], &[0.0, f64::NAN], 4).is_empty());
    }
}
