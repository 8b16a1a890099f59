//! Smoothing by local quadratic fits: value, velocity and acceleration of a sampled, noisy series.
//!
//! A. Savitzky and M. J. E. Golay, "Smoothing and differentiation of data by simplified least squares procedures",
//! Analytical Chemistry 36, 1964; here with the samples' own times, so that irregular clocks and missing samples need
//! no special case.

use nalgebra::{Matrix3, Vector3};
use std::ops::Range;

/// A parabola needs three points; one more, so that noise has something to average over.
const FEWEST: usize = 4;
/// Least number of samples to each side of the fit.
const REACH_SAMPLES: f64 = 4.0;
/// Least time to each side of the fit, in s: fast clocks need more samples for the same velocity.
const REACH_S: f64 = 0.02;

/// A slope of fewer standard deviations than this counts as rest, if nothing else is known.
const TELLING: f64 = 2.0;

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
    /// An unknown motion.
    pub const MISSING: Motion = Motion { value: f64::NAN, velocity: f64::NAN, acceleration: f64::NAN };
}

/// The parabola that fits the samples of `range` best, at time `at_s`; `None` with fewer than four present samples.
pub fn parabola(clock_s: &[f64], values: &[f64], range: Range<usize>, at_s: f64) -> Option<Motion> {
    let present = || range.clone().filter(|i| values[*i].is_finite());
    let reach = present().map(|i| (clock_s[i] - at_s).abs()).fold(0.0, f64::max);
    if present().count() < FEWEST || reach <= 0.0 {
        return None;
    }
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for i in present() {
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
    within(clock_s, values, reach_s(clock_s))
}

/// Replaces a series by its smoothed values.
pub fn in_place(clock_s: &[f64], values: &mut [f64]) {
    let smoothed = smooth(clock_s, values);
    values.iter_mut().zip(smoothed).for_each(|(value, motion)| *value = motion.value);
}

/// The samples of a clock that keep clear of its ends: where a series is smoothed twice, by [`finely`] and by
/// [`in_place`], no fit that they depend on has samples to one side only. Such fits are up to ten times as noisy. All
/// samples, if few are left otherwise.
pub fn clear_of_ends(clock_s: &[f64]) -> Range<usize> {
    let (Some(first), Some(last)) = (clock_s.first(), clock_s.last()) else { return 0..0 };
    let margin_s = finest_reach_s(clock_s) + reach_s(clock_s);
    let clear = clock_s.partition_point(|t| *t < first + margin_s)..clock_s.partition_point(|t| *t <= last - margin_s);
    if 2 * clear.len() > clock_s.len() { clear } else { 0..clock_s.len() }
}

/// The weights with which [`in_place`] smooths on a clock, for many series: computing them takes most of its time.
#[derive(Clone, Debug, PartialEq)]
pub struct Smoother {
    clock_s: Vec<f64>,
    /// The first sample of each fit, and its weights as an index.
    fits: Vec<(usize, usize)>,
    weights: Vec<Vec<f64>>,
}

impl Smoother {
    /// On a clock.
    pub fn new(clock_s: &[f64]) -> Self {
        /// Clocks whose steps differ by less than this share of a fit's reach have the same weights.
        const SAME: f64 = 1e-9;
        let mut smoother = Smoother { clock_s: clock_s.to_vec(), fits: Vec::new(), weights: Vec::new() };
        let mut last: Vec<f64> = Vec::new();
        for (i, range) in windows(clock_s, reach_s(clock_s)).enumerate() {
            let times: Vec<f64> = clock_s[range.clone()].iter().map(|t| t - clock_s[i]).collect();
            let reach = times.iter().map(|t| t.abs()).fold(0.0, f64::max);
            let same = last.len() == times.len() && last.iter().zip(&times).all(|(a, b)| (a - b).abs() <= SAME * reach);
            if !same {
                smoother.weights.push(weights(&times, reach));
                last = times;
            }
            smoother.fits.push((range.start, smoother.weights.len() - 1));
        }
        smoother
    }

    /// A series, smoothed; as [`smooth`] where samples are missing.
    pub fn smoothed(&self, values: &[f64]) -> Vec<f64> {
        let fit = |(i, &(first, weights)): (usize, &(usize, usize))| {
            let weights = &self.weights[weights];
            let range = first..first + weights.len();
            let sum: f64 = weights.iter().zip(&values[range.clone()]).map(|(weight, value)| weight * value).sum();
            if sum.is_finite() || !values[i].is_finite() {
                return if values[i].is_finite() { sum } else { f64::NAN };
            }
            parabola(&self.clock_s, values, range, self.clock_s[i]).map_or(f64::NAN, |motion| motion.value)
        };
        self.fits.iter().enumerate().map(fit).collect()
    }
}

/// The weights of samples at these times in the value at time 0 of the parabola that fits them best; NaN where these
/// are too few.
fn weights(times: &[f64], reach: f64) -> Vec<f64> {
    let row = |t: &f64| Vector3::new(1.0, t / reach, (t / reach).powi(2));
    let normal = times.iter().map(row).fold(Matrix3::zeros(), |normal, row| normal + row * row.transpose());
    let first = if times.len() < FEWEST { None } else { normal.cholesky().map(|n| n.solve(&Vector3::x())) };
    times.iter().map(|t| first.map_or(f64::NAN, |first| first.dot(&row(t)))).collect()
}

/// The same as [`smooth`] with the shortest fits: four samples to each side. For motions whose accelerations should be
/// smoothed as little as possible.
pub fn finely(clock_s: &[f64], values: &[f64]) -> Vec<Motion> {
    within(clock_s, values, finest_reach_s(clock_s))
}

fn finest_reach_s(clock_s: &[f64]) -> f64 {
    // Rounded time stamps must not lose the outermost sample.
    usual_step_s(clock_s).map_or(REACH_S, |step| (REACH_SAMPLES + 0.1) * step)
}

fn within(clock_s: &[f64], values: &[f64], reach_s: f64) -> Vec<Motion> {
    let fit = |(i, range): (usize, Range<usize>)| {
        let present = values[i].is_finite();
        present.then(|| parabola(clock_s, values, range, clock_s[i])).flatten().unwrap_or(Motion::MISSING)
    };
    windows(clock_s, reach_s).enumerate().map(fit).collect()
}

/// For each sample, those within `reach_s` of it.
fn windows(clock_s: &[f64], reach_s: f64) -> impl Iterator<Item = Range<usize>> + '_ {
    let (mut from, mut to) = (0, 0);
    (0..clock_s.len()).map(move |i| {
        while clock_s[from] < clock_s[i] - reach_s {
            from += 1;
        }
        while to < clock_s.len() && clock_s[to] <= clock_s[i] + reach_s {
            to += 1;
        }
        from..to
    })
}

/// The state in which a series begins, at the very first tick of its clock; `sigma` is the standard deviation of its
/// readings. At rest where the slope of the first readings may be noise: most recordings begin so, and a servo set in
/// motion by noise would oscillate for long. Otherwise released from rest, if a cubic with its vertex at the first tick
/// fits nearly as many of the first samples as any parabola does, which has as many coefficients; otherwise the
/// parabola's. A velocity that was `measured` present, even if late and rough, decides between the two. `None` where
/// too few samples are present.
pub fn start(clock_s: &[f64], values: &[f64], sigma: f64, measured: Option<f64>) -> Option<Motion> {
    let first_s = *clock_s.first()?;
    let within = |long_s: f64| 0..clock_s.partition_point(|t| *t <= first_s + long_s);
    let all = within(2.0 * reach_s(clock_s));
    match resting(clock_s, values, sigma, TELLING) {
        Some(value) => Some(Motion { value, velocity: 0.0, acceleration: 0.0 }),
        None => moving((clock_s, values), all.end, sigma, measured),
    }
}

/// The mean of the first readings; `None` where they are fewer than three, or have a slope of more than `threshold`
/// standard deviations of the slope by noise alone.
pub fn resting(clock_s: &[f64], values: &[f64], sigma: f64, threshold: f64) -> Option<f64> {
    let first_s = *clock_s.first()?;
    // Short, as a command may come at the start.
    let last_s = first_s + REACH_S.max(0.5 * reach_s(clock_s));
    let readings = clock_s.iter().zip(values).take_while(|(t, _)| **t <= last_s);
    let present: Vec<(f64, f64)> = readings.map(|(t, x)| (*t, *x)).filter(|(_, x)| x.is_finite()).collect();
    let n = present.len() as f64;
    let (time, value) = present.iter().fold((0.0, 0.0), |(time, value), (t, x)| (time + t / n, value + x / n));
    let (along, square) = present
        .iter()
        .fold((0.0, 0.0), |(along, square), (t, x)| (along + (t - time) * (x - value), square + (t - time).powi(2)));
    // The slope has the deviation sigma/sqrt(sum of squared times).
    (present.len() >= 3 && along.abs() <= threshold * sigma * square.sqrt()).then_some(value)
}

/// The motion at the first tick of the longest curve that fits the samples to `sigma`.
fn moving(series: SampledSeries, most: usize, sigma: f64, measured: Option<f64>) -> Option<Motion> {
    /// A release from rest is accepted if it fits this share of the samples that any parabola fits.
    const NEARLY: f64 = 0.7;
    let (clock_s, values) = series;
    let free = |to: usize| Some(Cubic { motion: parabola(clock_s, values, 0..to, clock_s[0])?, jerk: 0.0 });
    let free = FittedCurve::longest(series, most, sigma, free)?;
    let Some(rest) = FittedCurve::longest(series, most, sigma, |to| released(series, to)) else {
        return Some(free.cubic.motion);
    };
    let rests = match measured {
        Some(velocity) => velocity.abs() <= (free.cubic.motion.velocity - velocity).abs(),
        // Too fast for the clock: the curve with the smaller residuals on the very first samples.
        None if free.samples + rest.samples == 0 => rest.left <= free.left,
        None => rest.samples as f64 >= NEARLY * free.samples as f64,
    };
    Some(if rests { rest.cubic.motion } else { free.cubic.motion })
}

/// A clock in s, and readings.
type SampledSeries<'a> = (&'a [f64], &'a [f64]);

/// A motion at the first tick, whose acceleration changes: per second cubed.
struct Cubic {
    motion: Motion,
    jerk: f64,
}

/// A curve and the samples that it fits.
struct FittedCurve {
    cubic: Cubic,
    /// Number of first samples that it fits to their noise; 0 where it does not fit even the fewest.
    samples: usize,
    /// Sum of squared residuals of the fit.
    left: f64,
}

impl FittedCurve {
    /// The longest curve of a kind, over `most` samples at most, that fits to `sigma`; else that over the fewest
    /// samples.
    fn longest(series: SampledSeries, most: usize, sigma: f64, fit: impl Fn(usize) -> Option<Cubic>) -> Option<Self> {
        /// Largest residual of a good fit, in sigma.
        const GOOD: f64 = 1.3;
        let fitted = |to: usize| {
            let cubic = fit(to)?;
            let left = cubic.left(series, to);
            let present = series.1[..to].iter().filter(|x| x.is_finite()).count() as f64;
            let samples = if left <= (GOOD * sigma).powi(2) * (present - 3.0) { to } else { 0 };
            Some(FittedCurve { cubic, samples, left })
        };
        let good = (FEWEST..=most).rev().filter_map(fitted).find(|it| it.samples > 0);
        good.or_else(|| (FEWEST..=most).find_map(fitted))
    }
}

impl Cubic {
    /// Sum of squared residuals of the first `to` samples.
    fn left(&self, (clock_s, values): SampledSeries, to: usize) -> f64 {
        let Motion { value, velocity, acceleration } = self.motion;
        let at = |t: f64| value + t * (velocity + t * (0.5 * acceleration + t * self.jerk / 6.0));
        let errors = (0..to).map(|i| values[i] - at(clock_s[i] - clock_s[0])).filter(|e| e.is_finite());
        errors.map(|e| e * e).sum()
    }
}

/// The cubic with its vertex at the first tick that fits the first `to` samples best: a step command at the start gives
/// an acceleration that soon falls.
fn released((clock_s, values): SampledSeries, to: usize) -> Option<Cubic> {
    let present = || (0..to).filter(|&i| values[i].is_finite());
    let reach = present().map(|i| clock_s[i] - clock_s[0]).fold(0.0, f64::max);
    if present().count() < FEWEST || reach <= 0.0 {
        return None;
    }
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for i in present() {
        let t = (clock_s[i] - clock_s[0]) / reach;
        let row = Vector3::new(1.0, t * t, t * t * t);
        normal += row * row.transpose();
        right += row * values[i];
    }
    let fit = normal.cholesky()?.solve(&right);
    let motion = Motion { value: fit[0], velocity: 0.0, acceleration: 2.0 * fit[1] / (reach * reach) };
    Some(Cubic { motion, jerk: 6.0 * fit[2] / reach.powi(3) })
}

/// Reach of a fit to each side, in s.
fn reach_s(clock_s: &[f64]) -> f64 {
    // A little more, so that rounded time stamps do not lose the outermost sample.
    usual_step_s(clock_s).map_or(REACH_S, |usual| (REACH_SAMPLES * usual).max(REACH_S) + 0.1 * usual)
}

/// The median step; `None` for fewer than two samples.
fn usual_step_s(clock_s: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = clock_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let middle = steps.len() / 2;
    (!steps.is_empty()).then(|| *steps.select_nth_unstable_by(middle, f64::total_cmp).1)
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
        let begin = start(&clock, &values, 1e-6, None).unwrap();
        assert!(near(begin.value, 2.0) && near(begin.velocity, -3.0), "{begin:?}");
    }

    #[test]
    fn kept_weights_smooth_as_fits_do() {
        let even: Vec<f64> = (0..300).map(|i| 0.004 * f64::from(i)).collect();
        let uneven: Vec<f64> = even.iter().enumerate().map(|(i, t)| t + 0.001 * (i as f64 * 1.7).sin()).collect();
        for clock in [even, uneven] {
            let mut values: Vec<f64> = clock.iter().map(|t| (7.0 * t).sin() + 0.1 * (311.0 * t).cos()).collect();
            values[100] = f64::NAN;
            let kept = Smoother::new(&clock).smoothed(&values);
            in_place(&clock, &mut values);
            let same = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-9 || a.is_nan() && b.is_nan();
            assert!(kept.iter().zip(&values).all(same));
        }
    }

    #[test]
    fn a_series_at_rest_first_begins_at_rest_whatever_follows() {
        let law = |t: f64| if t < 0.06 { 0.0 } else { 40.0 * (t - 0.06).powi(2) };
        let error = |i: u32| 1e-3 * (f64::from(i) * 12.9898).sin();
        let clock: Vec<f64> = (0..40).map(|i| 0.01 * f64::from(i)).collect();
        let values: Vec<f64> = (0..40).map(|i| law(0.01 * f64::from(i)) + error(i)).collect();
        let begin = start(&clock, &values, 1e-3, None).unwrap();
        assert!(begin.velocity.abs() < 1e-12 && begin.value.abs() < 1.5e-3, "{begin:?}");
        let moving: Vec<f64> = (0..40).map(|i| (9.0 * clock[i as usize]).sin() + error(i)).collect();
        let begin = start(&clock, &moving, 1e-3, None).unwrap();
        assert!((begin.velocity - 9.0).abs() < 0.4 && begin.value.abs() < 3e-3, "{begin:?}");
    }

    #[test]
    fn a_fall_from_rest_begins_without_velocity() {
        let error = |i: u32| 1e-3 * (f64::from(i) * 12.9898).sin();
        let clock: Vec<f64> = (0..40).map(|i| 0.01 * f64::from(i)).collect();
        let falling: Vec<f64> = (0..40).map(|i| 0.1 + 12.0 * clock[i as usize].powi(2) + error(i)).collect();
        let begin = start(&clock, &falling, 1e-3, None).unwrap();
        assert!(begin.velocity.abs() < 1e-12 && (begin.value - 0.1).abs() < 1.5e-3, "{begin:?}");
    }

    #[test]
    fn a_step_command_at_the_start_begins_at_rest() {
        // A servo of 19 rad/s, damped to a fifth, with a step command of 0.2 rad.
        let error = |i: u32| 7e-4 * (f64::from(i) * 12.9898).sin();
        let clock: Vec<f64> = (0..40).map(|i| 0.01 * f64::from(i)).collect();
        let swings = |t: f64| 0.2 * (1.0 - (-4.0 * t).exp() * ((18.6 * t).cos() + 0.215 * (18.6 * t).sin()));
        let values: Vec<f64> = (0..40).map(|i| swings(clock[i as usize]) + error(i)).collect();
        let begin = start(&clock, &values, 7e-4, None).unwrap();
        assert!(begin.velocity.abs() < 1e-12 && begin.value.abs() < 1.5e-3, "{begin:?}");
    }

    #[test]
    fn a_motion_too_fast_for_its_clock_does_not_begin_backwards() {
        // A light joint that sticks for a moment and then follows: readings without noise.
        let clock: Vec<f64> = (0..40).map(|i| 0.01 * f64::from(i)).collect();
        let values: Vec<f64> = clock.iter().map(|t| 0.4 * (1.0 - (-(t / 0.06f64).powf(3.6)).exp())).collect();
        let begin = start(&clock, &values, 1e-6, None).unwrap();
        assert!(begin.velocity.abs() < 1e-12 && begin.value.abs() < 2e-3, "{begin:?}");
        let with_sensor = start(&clock, &values, 1e-6, Some(-0.4)).unwrap();
        assert!(with_sensor.velocity < -0.2, "the sensor decides: {with_sensor:?}");
    }

    /// Of 400 motions that begin at some speed with any acceleration, how many are taken to begin at rest.
    fn taken_for_rest(speed: f64, rate: f64, sigma: f64, measured: Option<f64>) -> usize {
        let mut rng = crate::random::stream(7, &[]);
        let mut even = move || rand::RngExt::random::<f64>(&mut rng);
        let clock: Vec<f64> = (0..60).map(|i| 0.01 * f64::from(i)).collect();
        let mut rests = || {
            let push = 8.0 * (even() - 0.5) * (speed + 0.3);
            let at = |t: f64| speed / rate * (rate * t).sin() + push / (rate * rate) * (1.0 - (rate * t).cos());
            // The sum of four even numbers is nearly normal, of variance 1/3.
            let noise =
                |even: &mut dyn FnMut() -> f64| 3f64.sqrt() * sigma * ((0..4).map(|_| even()).sum::<f64>() - 2.0);
            let values: Vec<f64> = clock.iter().map(|t| at(*t) + noise(&mut even)).collect();
            start(&clock, &values, sigma, measured).unwrap().velocity.abs() < 1e-12
        };
        (0..400).filter(|_| rests()).count()
    }

    #[test]
    fn rest_and_motion_are_distinguished() {
        for rate in [3.0, 6.0, 12.0, 20.0] {
            assert!(taken_for_rest(0.0, rate, 1e-3, None) > 390);
            assert!(taken_for_rest(1.0, rate, 3e-4, None) == 0 && taken_for_rest(3.0, rate, 1e-3, None) == 0);
            assert!(taken_for_rest(1.0, rate, 1e-3, None) < 20);
            // Where noise hides a slow motion, a velocity sensor shows it.
            assert!(taken_for_rest(0.3, rate, 1e-3, Some(0.3)) < taken_for_rest(0.3, rate, 1e-3, None) / 2);
        }
    }

    #[test]
    fn samples_near_the_ends_are_noisier_and_no_others() {
        let clock: Vec<f64> = (0..400).map(|i| 0.005 * f64::from(i)).collect();
        let clear = clear_of_ends(&clock);
        assert_eq!(clear, 9..391);
        let mut squares = vec![0.0; 400];
        for draw in 0..200 {
            let mut rng = crate::random::stream(draw, &[]);
            let noise: Vec<f64> = clock.iter().map(|_| crate::random::normal(&mut rng)).collect();
            let mut accelerations: Vec<f64> = finely(&clock, &noise).iter().map(|m| m.acceleration).collect();
            in_place(&clock, &mut accelerations);
            squares.iter_mut().zip(&accelerations).for_each(|(sum, a)| *sum += a * a);
        }
        let usual = squares[100..300].iter().sum::<f64>() / 200.0;
        assert!(squares[0] > 20.0 * usual && squares[399] > 20.0 * usual);
        assert!(squares[clear].iter().all(|square| *square < 1.6 * usual));
        assert_eq!(clear_of_ends(&clock[..20]), 0..20);
        assert_eq!(clear_of_ends(&[]), 0..0);
    }

    #[test]
    fn missing_samples_stay_missing() {
        let clock: Vec<f64> = (0..30).map(|i| 0.01 * f64::from(i) + if i >= 15 { 5.0 } else { 0.0 }).collect();
        let mut values = vec![1.0; 30];
        values[5..15].fill(f64::NAN);
        let motion = smooth(&clock, &values);
        assert!(motion[7].value.is_nan() && near(motion[20].value, 1.0) && near(motion[15].velocity, 0.0));
        assert!(start(&clock[..2], &values[..2], 1.0, None).is_none() && smooth(&[], &[]).is_empty());
    }
}
