//! The time shift between two series, finer than their clock.
//!
//! The derivatives are correlated at every shift of whole steps, so that constants and slow drifts do not matter; a
//! parabola through the three highest correlations gives the fraction of a step (C. H. Knapp and G. C. Carter, "The
//! generalized correlation method for estimation of time delay", IEEE Transactions on Acoustics, Speech and Signal
//! Processing 24, 1976, for the method and its accuracy).

use super::smooth::{Motion, smooth};

/// Time shift between two series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lag {
    /// In s; positive when the second series comes later.
    pub seconds: f64,
    /// Correlation of the series when shifted by it, 0 to 1: the confidence. Below one half the lag means little.
    pub correlation: f64,
    /// Standard deviation of the lag, in s, if the uncorrelated part is noise.
    pub sd_s: f64,
}

/// Fewest pairs of samples of a correlation.
const FEWEST: usize = 20;
/// Most steps per sample: where a clock has leapt, gaps would take all memory.
const SPARSEST: f64 = 100.0;

/// The lag of `late` behind `early`, both on one clock, within `most_s` in both directions. NaN and gaps are skipped.
/// `None` where a series is constant, too few samples are present, nearly all of the clock is gaps, or the correlation
/// peaks at the end of the range.
pub fn lag(clock_s: &[f64], early: &[f64], late: &[f64], most_s: f64) -> Option<Lag> {
    let step_s = usual_step_s(clock_s)?;
    if !moves(early) || !moves(late) {
        return None;
    }
    let slopes = |values: &[f64]| -> Vec<f64> {
        let motion = smooth(clock_s, values);
        on_grid(clock_s, &motion.iter().map(|m: &Motion| m.velocity).collect::<Vec<_>>(), step_s)
    };
    let sparse = (clock_s.last()? - clock_s.first()?) / step_s > SPARSEST * clock_s.len() as f64;
    if sparse {
        return None;
    }
    let (early, late) = (slopes(early), slopes(late));
    let most = (most_s / step_s).ceil().min(early.len().min(clock_s.len()) as f64 / 2.0) as isize;
    let correlation: Vec<f64> =
        (-most..=most).map(|shift| correlation_at(&early, &late, shift).unwrap_or(f64::NAN)).collect();
    let best = (0..correlation.len())
        .filter(|i| !correlation[*i].is_nan())
        .max_by(|a, b| correlation[*a].total_cmp(&correlation[*b]))?;
    let (left, peak, right) = (correlation.get(best.checked_sub(1)?)?, correlation[best], correlation.get(best + 1)?);
    let curvature = 2.0 * peak - left - right;
    if curvature.is_nan() || curvature <= 0.0 || peak <= 0.0 {
        return None;
    }
    let fraction = 0.5 * (right - left) / curvature;
    let pairs = early.iter().filter(|x| !x.is_nan()).count() as f64;
    // The width of the correlation's peak is the series' time scale; a stretch of that length counts as one
    // observation.
    let rate = curvature.sqrt();
    let observations = (pairs * rate.min(1.0)).max(1.0);
    let unlike = (1.0 / (peak * peak) - 1.0).max(0.0);
    Some(Lag {
        seconds: (best as f64 - most as f64 + fraction) * step_s,
        correlation: peak.min(1.0),
        sd_s: (unlike / observations).sqrt() / rate * step_s,
    })
}

/// Correlation of `early` with `late` moved back by `shift` steps.
fn correlation_at(early: &[f64], late: &[f64], shift: isize) -> Option<f64> {
    let from = shift.unsigned_abs();
    let (early, late) = if shift >= 0 { (early, late.get(from..)?) } else { (early.get(from..)?, late) };
    let pairs = early.iter().zip(late).filter(|(a, b)| !(**a * **b).is_nan());
    let (n, ee, ll, el) =
        pairs.fold((0, 0.0, 0.0, 0.0), |(n, ee, ll, el), (a, b)| (n + 1, ee + a * a, ll + b * b, el + a * b));
    (n >= FEWEST && ee > 0.0 && ll > 0.0).then(|| el / (ee * ll).sqrt())
}

/// Whether a series varies by more than rounding errors.
fn moves(values: &[f64]) -> bool {
    let present = values.iter().filter(|x| x.is_finite());
    let (low, high) = present.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
    high - low > 1e-9 * low.abs().max(high.abs())
}

fn usual_step_s(clock_s: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = clock_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let middle = steps.len() / 2;
    (!steps.is_empty()).then(|| *steps.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The series at even steps: linear between neighbours, NaN where these are further apart than two and a half steps.
fn on_grid(clock_s: &[f64], values: &[f64], step_s: f64) -> Vec<f64> {
    let (Some(first), Some(last)) = (clock_s.first(), clock_s.last()) else { return Vec::new() };
    let ticks = ((last - first) / step_s + 1e-6) as usize;
    let mut i = 0;
    (0..=ticks)
        .map(|k| {
            let t = first + k as f64 * step_s;
            while i + 2 < clock_s.len() && clock_s[i + 1] <= t {
                i += 1;
            }
            let width = clock_s[i + 1] - clock_s[i];
            let share = ((t - clock_s[i]) / width).min(1.0);
            if width > 2.5 * step_s { f64::NAN } else { values[i] + share * (values[i + 1] - values[i]) }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::random::stream;
    use rand::RngExt;

    fn motion(t: f64) -> f64 {
        (9.0 * t).sin() + 0.6 * (14.0 * t + 1.0).sin() + 0.3 * (3.1 * t).cos()
    }

    fn found(step_s: f64, delay_s: f64, noise: f64) -> Lag {
        let mut rng = stream(4, &[9]);
        let mut jitter = |size: f64| size * (rng.random::<f64>() - 0.5);
        let n = (8.0 / step_s) as u32;
        let clock: Vec<f64> = (0..n).map(|i| step_s * f64::from(i) + jitter(0.1 * step_s)).collect();
        let early: Vec<f64> = clock.iter().map(|t| motion(*t)).collect();
        let late: Vec<f64> = clock.iter().map(|t| 0.8 * motion(*t - delay_s) + 0.2 + jitter(noise)).collect();
        lag(&clock, &early, &late, 0.3).unwrap()
    }

    #[test]
    fn a_delay_is_found_to_half_a_millisecond() {
        for (step_s, noise) in [(0.001, 0.0), (0.005, 0.005), (0.01, 0.01), (0.02, 0.0)] {
            for delay_s in [0.0137, -0.0137, 0.0, 0.1212] {
                let lag = found(step_s, delay_s, noise);
                assert!((lag.seconds - delay_s).abs() < 5e-4, "{step_s} {delay_s}: {lag:?}");
                assert!(lag.correlation > 0.9 && lag.sd_s < 2e-3, "{lag:?}");
            }
        }
    }

    #[test]
    fn a_gap_does_not_matter_and_unrelated_series_have_no_lag() {
        let clock: Vec<f64> = (0..1600).map(|i| 0.005 * f64::from(i) + if i > 700 { 2.0 } else { 0.0 }).collect();
        let early: Vec<f64> = clock.iter().map(|t| motion(*t)).collect();
        let mut late: Vec<f64> = clock.iter().map(|t| motion(*t - 0.0137)).collect();
        late[200..260].fill(f64::NAN);
        assert!((lag(&clock, &early, &late, 0.3).unwrap().seconds - 0.0137).abs() < 5e-4);
        assert!(lag(&clock, &early, &vec![1.0; 1600], 0.3).is_none() && lag(&[], &[], &[], 0.3).is_none());
        // A clock that leaps: its even steps would be more than memory holds.
        let leaping: Vec<f64> = clock.iter().map(|t| if *t > 5.0 { t + 1e15 } else { *t }).collect();
        assert_eq!(lag(&leaping, &early, &late, 0.3), None);
        let mut rng = stream(1, &[1]);
        let strange: Vec<f64> = clock.iter().map(|_| rng.random::<f64>()).collect();
        assert!(lag(&clock, &early, &strange, 0.3).is_none_or(|lag| lag.correlation < 0.5));
    }
}
