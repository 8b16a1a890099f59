//! Smoothing by local quadratic fits: value, velocity and acceleration of a series that was only sampled, with noise.
//!
//! A. Savitzky and M. J. E. Golay, "Smoothing and differentiation of data by simplified least squares procedures",
//! Analytical Chemistry 36, 1964; here with the samples' own times, so that irregular clocks and missing samples are no
//! special case.

use nalgebra::{Matrix3, Vector3};
use std::ops::Range;

/// A parabola needs three points; one more, so that noise has something to average over.
const FEWEST: usize = 4;
/// Samples to each side of the fit, at least.
const REACH_SAMPLES: f64 = 4.0;
/// Time to each side of the fit, at least, in s: fast clocks need more samples for the same velocity.
const REACH_S: f64 = 0.02;

/// A smoothed sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// In the unit of the series.
    pub value: f64,
    /// Per second.
    pub velocity: f64,
    /// Per second squared.
    pub acceleration: f64,
}

impl Motion {
    /// What is not known.
    pub const MISSING: Motion = Motion { value: f64::NAN, velocity: f64::NAN, acceleration: f64::NAN };
}

/// The parabola that fits the samples of `range` best, at time `at_s`; `None` with fewer than four samples that are there.
pub fn parabola(clock_s: &[f64], values: &[f64], range: Range<usize>, at_s: f64) -> Option<Motion> {
    let there = || range.clone().filter(|i| values[*i].is_finite());
    let reach = there().map(|i| (clock_s[i] - at_s).abs()).fold(0.0, f64::max);
    if there().count() < FEWEST || reach <= 0.0 {
        return None;
    }
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for i in there() {
        // In units of the reach all three columns are of size one.
        let t = (clock_s[i] - at_s) / reach;
        let row = Vector3::new(1.0, t, t * t);
        normal += row * row.transpose();
        right += row * values[i];
    }
    let fit = normal.cholesky()?.solve(&right);
    Some(Motion { value: fit[0], velocity: fit[1] / reach, acceleration: 2.0 * fit[2] / (reach * reach) })
}

/// The smoothed series at every sample; [`Motion::MISSING`] where the sample itself, or too much around it, is missing.
pub fn smooth(clock_s: &[f64], values: &[f64]) -> Vec<Motion> {
    let reach_s = reach_s(clock_s);
    let (mut from, mut to) = (0, 0);
    (0..clock_s.len())
        .map(|i| {
            while clock_s[from] < clock_s[i] - reach_s {
                from += 1;
            }
            while to < clock_s.len() && clock_s[to] <= clock_s[i] + reach_s {
                to += 1;
            }
            let there = values[i].is_finite();
            there.then(|| parabola(clock_s, values, from..to, clock_s[i])).flatten().unwrap_or(Motion::MISSING)
        })
        .collect()
}

/// The state in which a series begins, at the very first tick of its clock; `sigma` is the standard deviation of its
/// readings: a parabola through as many of the first samples as a parabola fits. At rest where its velocity could as well be
/// noise: most recordings begin so, and a servo set in motion by noise would swing for long. `None` where too few are there.
pub fn start(clock_s: &[f64], values: &[f64], sigma: f64) -> Option<Motion> {
    /// A fit is good while what it leaves is no more than so many sigma.
    const GOOD: f64 = 1.5;
    /// A velocity of fewer deviations is none.
    const TELLING: f64 = 2.0;
    let first_s = *clock_s.first()?;
    let end = clock_s.partition_point(|t| *t <= first_s + 2.0 * reach_s(clock_s));
    let there = |to: usize| (0..to).filter(|i| values[*i].is_finite());
    let good = |to: usize, motion: &Motion, parameters: usize| {
        let at = |t: f64| motion.value + t * (motion.velocity + 0.5 * t * motion.acceleration);
        let squares: f64 = there(to).map(|i| (values[i] - at(clock_s[i] - first_s)).powi(2)).sum();
        squares <= (GOOD * sigma).powi(2) * there(to).count().saturating_sub(parameters) as f64
    };
    let fits = || (FEWEST..=end).filter_map(|to| Some((to, parabola(clock_s, values, 0..to, first_s)?)));
    let (to, moving) = fits().filter(|(to, motion)| good(*to, motion, 3)).last().or_else(|| fits().next())?;
    // The slope at the end of a parabola through n points over a time T has the deviation sigma·sqrt(192/n)/T.
    let deviation = sigma * (192.0 / there(to).count() as f64).sqrt() / (clock_s[to - 1] - first_s);
    if moving.velocity.abs() > TELLING * deviation {
        return Some(moving);
    }
    let rest = |to: usize| {
        let value = there(to).map(|i| values[i]).sum::<f64>() / there(to).count() as f64;
        Motion { value, velocity: 0.0, acceleration: 0.0 }
    };
    let resting = (2..=end).map(|to| (to, rest(to))).filter(|(to, motion)| good(*to, motion, 1)).last();
    Some(resting.map_or(Motion { velocity: 0.0, ..moving }, |(_, motion)| motion))
}

/// How far a fit reaches to each side.
fn reach_s(clock_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = clock_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if steps.is_empty() {
        return REACH_S;
    }
    let middle = steps.len() / 2;
    // A little more, so that rounded stamps do not lose the outermost sample.
    let usual = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    (REACH_SAMPLES * usual).max(REACH_S) + 0.1 * usual
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn near(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-9
    }

    #[test]
    fn a_parabola_is_found_again_on_any_clock() {
        let clock: Vec<f64> = (0..40).map(|i| 0.01 * f64::from(i) + 0.003 * f64::from(i % 3)).collect();
        let law = |t: f64| 2.0 - 3.0 * t + 5.0 * t * t;
        let mut values: Vec<f64> = clock.iter().map(|t| law(*t)).collect();
        values[17] = f64::NAN;
        for (i, motion) in smooth(&clock, &values).iter().enumerate().filter(|(i, _)| *i != 17) {
            let t = clock[i];
            assert!(near(motion.value, law(t)) && near(motion.velocity, 10.0 * t - 3.0), "{motion:?}");
            assert!((motion.acceleration - 10.0).abs() < 1e-6, "{motion:?}");
        }
        let begin = start(&clock, &values, 1e-6).unwrap();
        assert!(near(begin.value, 2.0) && near(begin.velocity, -3.0), "{begin:?}");
    }

    #[test]
    fn what_rests_at_first_is_not_set_in_motion_by_what_comes_later() {
        let law = |t: f64| if t < 0.06 { 0.0 } else { 40.0 * (t - 0.06).powi(2) };
        let error = |i: u32| 1e-3 * (f64::from(i) * 12.9898).sin();
        let clock: Vec<f64> = (0..40).map(|i| 0.01 * f64::from(i)).collect();
        let values: Vec<f64> = (0..40).map(|i| law(0.01 * f64::from(i)) + error(i)).collect();
        let begin = start(&clock, &values, 1e-3).unwrap();
        assert!(begin.velocity.abs() < 1e-12 && begin.value.abs() < 1.5e-3, "{begin:?}");
        let moving: Vec<f64> = (0..40).map(|i| (9.0 * clock[i as usize]).sin() + error(i)).collect();
        let begin = start(&clock, &moving, 1e-3).unwrap();
        assert!((begin.velocity - 9.0).abs() < 0.4 && begin.value.abs() < 3e-3, "{begin:?}");
    }

    #[test]
    fn nothing_is_made_up_where_samples_are_missing() {
        let clock: Vec<f64> = (0..30).map(|i| 0.01 * f64::from(i) + if i >= 15 { 5.0 } else { 0.0 }).collect();
        let mut values = vec![1.0; 30];
        values[5..15].fill(f64::NAN);
        let motion = smooth(&clock, &values);
        assert!(motion[7].value.is_nan() && near(motion[20].value, 1.0) && near(motion[15].velocity, 0.0));
        assert!(start(&clock[..2], &values[..2], 1.0).is_none() && smooth(&[], &[]).is_empty());
    }
}
