//! The noise floor of a measured series: the standard deviation of its readings' errors.
//!
//! Motion is smooth, white noise is not. Differences of order p take away every polynomial of a lower degree and weaken
//! a motion of frequency w by (w·dt)^p, while white noise only grows by the root of the binomial C(2p, p) (J. von
//! Neumann, R. H. Kent, H. R. Bellinson and B. I. Hart, "The mean square successive difference", Annals of Mathematical
//! Statistics 12, 1941, for p = 1). Of several orders the lowest is taken whose estimate exceeds the least one by no
//! more than chance, so that fast motion does not count as noise; and the median over short blocks, so that impacts and
//! steps do not. The least of all estimates would be too low by chance: by 7 % on 400 readings.

/// Estimate of a sensor's errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseEstimate {
    /// Standard deviation of the white noise without quantisation, in the unit of the series.
    pub white: f64,
    /// Step of the readings; 0 where there is none.
    pub quantum: f64,
    /// Lower bound of the standard deviation; above zero.
    least: f64,
    /// Standard deviation assumed where the readings show no noise.
    assumed: f64,
}

/// Orders of the differences that are tried, each with what the median over blocks is of the root mean square for white
/// noise: squares scatter to the high side, the more so the fewer of a block's differences are independent.
const ORDERS: [(usize, f64); 8] =
    [(3, 0.978), (4, 0.976), (5, 0.972), (6, 0.970), (7, 0.967), (8, 0.964), (9, 0.961), (10, 0.961)];
/// An estimate may exceed the least one by chance by this share, divided by the root of the number of readings.
const CHANCE: f64 = 2.5;
/// Differences in a block.
const BLOCK: usize = 32;
/// Assumed best resolution of a sensor, as a share of the range of its readings.
const FINEST: f64 = 1e-5;
/// The share of the readings' own noise floor below which that of the difference from a simulation counts.
const FAR_LOWER: f64 = 0.5;
/// Assumed resolution of a constant channel: 13 bits of a range of 1 SI unit.
const ASSUMED: f64 = 1e-4;

impl NoiseEstimate {
    /// Estimated from readings alone; NaN are missing samples. `None` with fewer than a dozen readings.
    pub fn of(values: &[f64]) -> Option<Self> {
        let present: Vec<f64> = values.iter().copied().filter(|x| x.is_finite()).collect();
        if present.len() < 12 {
            return None;
        }
        let count = present.len() as f64;
        let (low, high) = present.iter().fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(*x), h.max(*x)));
        let quantum = quantum(present).unwrap_or(0.0);
        let estimates: Vec<f64> =
            ORDERS.iter().filter_map(|(order, median)| Some(roughness(values, *order)? / median)).collect();
        let within = estimates.iter().copied().fold(f64::INFINITY, f64::min) * (1.0 + CHANCE / count.sqrt());
        let rough = estimates.into_iter().find(|estimate| *estimate <= within).unwrap_or(f64::INFINITY);
        // The differences contain quantisation as well, as soon as the motion passes through its steps.
        let white = if rough.is_finite() { (rough * rough - quantum * quantum / 12.0).max(0.0).sqrt() } else { 0.0 };
        let least = FINEST * (high - low).max(FINEST * high.abs().max(low.abs())).max(f64::MIN_POSITIVE / FINEST);
        let assumed = if high > low { least } else { ASSUMED };
        Some(NoiseEstimate { white, quantum, least, assumed })
    }

    /// The standard deviation of a reading, quantisation included: sigma² = white² + quantum²/12, never zero.
    pub fn sigma(&self) -> f64 {
        (self.white.powi(2) + self.quantum.powi(2) / 12.0).sqrt().max(self.least)
    }

    /// The unit of errors: the standard deviation, or an assumed one where the readings show no noise.
    pub fn floor(&self) -> f64 {
        if self.is_negligible() { self.assumed.max(self.sigma()) } else { self.sigma() }
    }

    /// True for readings without noticeable errors: those of a simulation.
    pub fn is_negligible(&self) -> bool {
        self.sigma() <= self.least
    }
}

/// The noise floor of readings beside a simulation of them: that of the readings alone, or that of the difference where
/// this is far lower. Motion that is too fast for the clock looks like noise in the readings; a rough model of the
/// motion is enough for most of it to cancel. Where the simulation is wrong or missing, the difference is no lower.
pub fn floor_beside(readings: &[f64], simulated: &[f64]) -> Option<f64> {
    let alone = NoiseEstimate::of(readings)?;
    let difference: Vec<f64> = readings.iter().zip(simulated).map(|(reading, simulated)| reading - simulated).collect();
    let together = NoiseEstimate::of(&difference).map_or(f64::INFINITY, |estimate| estimate.sigma());
    let together = together.max(alone.quantum / 12.0_f64.sqrt()).max(alone.least);
    Some(if together < FAR_LOWER * alone.floor() { together } else { alone.floor() })
}

/// Standard deviation of white noise whose differences of this order would be as large as observed: the median over
/// blocks. `None` when there are too few samples without a gap between them.
fn roughness(values: &[f64], order: usize) -> Option<f64> {
    // Blocks go on after a gap: short ones would be small by chance, and the lowest of several orders is taken.
    let mut all = Vec::new();
    for run in values.split(|x| !x.is_finite()) {
        let mut differences = run.to_vec();
        for _ in 0..order.min(run.len()) {
            differences = differences.windows(2).map(|pair| pair[1] - pair[0]).collect();
        }
        all.extend(differences);
    }
    let long_enough = |block: &&[f64]| block.len() >= BLOCK / 4;
    let mean_square = |block: &[f64]| block.iter().map(|d| d * d).sum::<f64>() / block.len() as f64;
    let mut blocks: Vec<f64> = all.chunks(BLOCK).filter(long_enough).map(mean_square).collect();
    // C(2p, p): the sum of the squared binomials that weigh the samples.
    let gain = (1..=order).fold(1.0, |c, k| c * (order + k) as f64 / k as f64);
    Some((median(&mut blocks)? / gain).sqrt())
}

fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The step that all readings are multiples of, up to a common offset and the digits they were written with; `None`
/// where there is none, or where the readings are too far apart.
pub fn quantum(mut readings: Vec<f64>) -> Option<f64> {
    /// Gaps of more steps than this are too uncertain to count.
    const FAR: f64 = 20.0;
    /// Root mean square distance from a multiple, in steps. Numbers without a step have 0.29.
    const OFF: f64 = 0.1;
    readings.sort_by(f64::total_cmp);
    let range = readings.last()? - readings.first()?;
    // The same reading twice, or one that differs in the last bits.
    let gaps: Vec<f64> = readings.windows(2).map(|p| p[1] - p[0]).filter(|gap| *gap > 1e-9 * range).collect();
    let mut step = gaps.iter().copied().fold(f64::INFINITY, f64::min);
    let near = |step: f64| gaps.iter().copied().filter(move |gap| *gap < FAR * step);
    if gaps.len() < 2 || 2 * near(step).count() < gaps.len() {
        return None;
    }
    // The smallest gap has the largest relative error; the others give the step more precisely.
    let (along, square) = near(step).fold((0.0, 0.0), |(along, square), gap| {
        let steps = (gap / step).round();
        (along + steps * gap, square + steps * steps)
    });
    step = along / square;
    let off = near(step).map(|gap| (gap / step - (gap / step).round()).powi(2)).sum::<f64>();
    ((off / near(step).count() as f64).sqrt() < OFF).then_some(step)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::random::stream;
    use rand::RngExt;

    /// Fast motion: 5 Hz and 2 Hz at 200 Hz sampling, with steps of the velocity.
    fn motion(n: u32) -> Vec<f64> {
        let at = |t: f64| (31.4 * t).sin() + 0.4 * (12.6 * t + 1.0).sin() + 0.2 * (3.0 * t).sin().abs();
        (0..n).map(|i| at(0.005 * f64::from(i))).collect()
    }

    fn noisy(n: u32, sigma: f64, quantum: f64) -> Vec<f64> {
        let mut rng = stream(3, &[1]);
        let mut gaussian = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        let round = |x: f64| if quantum > 0.0 { (x / quantum).round() * quantum } else { x };
        motion(n).iter().map(|x| round(x + sigma * gaussian())).collect()
    }

    #[test]
    fn noise_is_found_under_fast_motion_and_quantisation() {
        for (sigma, quantum) in [(5e-4, 0.0), (1e-2, 0.0), (5e-4, 1.7e-3), (1e-3, 1.5e-3), (0.0, 1.5e-3), (2e-3, 1e-3)]
        {
            let noise = NoiseEstimate::of(&noisy(3000, sigma, quantum)).unwrap();
            let truth = (sigma * sigma + quantum * quantum / 12.0_f64).sqrt();
            assert!((noise.sigma() / truth - 1.0).abs() < 0.1, "{sigma} {quantum}: {noise:?}, {truth}");
            assert!((noise.quantum - quantum).abs() < 1e-3 * quantum.max(1e-9), "{sigma} {quantum}: {noise:?}");
        }
    }

    /// A short log with a gap every 15 samples, as where glitches are left out.
    #[test]
    fn gaps_do_not_lower_the_noise_of_a_short_log() {
        let ratio = |seed: u64| {
            let mut rng = stream(seed, &[2]);
            let mut gaussian = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
            let mut values: Vec<f64> = (0..150).map(|i| (0.05 * f64::from(i)).sin() + 1e-3 * gaussian()).collect();
            values.iter_mut().skip(7).step_by(15).for_each(|x| *x = f64::NAN);
            NoiseEstimate::of(&values).unwrap().sigma() / 1e-3
        };
        let mean = (0..60).map(ratio).sum::<f64>() / 60.0;
        assert!((0.85..1.05).contains(&mean), "{mean}");
    }

    /// At 20 Hz the motion is too fast to tell from noise, unless a model follows it roughly.
    #[test]
    fn motion_that_is_too_fast_cancels_against_a_rough_model() {
        let (sigma, coarse) = (5e-4, |values: Vec<f64>| values.into_iter().step_by(10).collect::<Vec<f64>>());
        let readings = coarse(noisy(6000, sigma, 0.0));
        let model: Vec<f64> = coarse(motion(6000)).iter().map(|x| 1.02 * x + 0.05).collect();
        let (alone, beside) = (floor_beside(&readings, &[]).unwrap(), floor_beside(&readings, &model).unwrap());
        assert!(alone > 50.0 * sigma && beside < 5.0 * sigma, "{alone}, {beside}");
        let wrong: Vec<f64> = model.iter().map(|x| -3.0 * x).collect();
        assert_eq!(floor_beside(&readings, &wrong), Some(alone));
        // Where readings alone show their noise, a model changes nothing.
        let fine = noisy(3000, 1e-2, 0.0);
        assert_eq!(floor_beside(&fine, &motion(3000)), Some(NoiseEstimate::of(&fine).unwrap().floor()));
    }

    /// Of white noise beside a slow motion; few readings scatter, and must not be told too low on the whole.
    #[test]
    fn the_noise_of_a_short_log_is_not_told_too_low() {
        let ratio = |seed: u64| {
            let mut rng = stream(seed, &[4]);
            let mut gaussian = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
            let values: Vec<f64> = (0..400).map(|i| (0.05 * f64::from(i)).sin() + 1e-3 * gaussian()).collect();
            NoiseEstimate::of(&values).unwrap().sigma() / 1e-3
        };
        let mean = (0..100).map(ratio).sum::<f64>() / 100.0;
        assert!((0.97..1.02).contains(&mean), "{mean}");
    }

    #[test]
    fn holes_and_jumps_do_not_count_as_noise() {
        let mut values = noisy(3000, 1e-3, 0.0);
        values.iter_mut().step_by(211).for_each(|x| *x = f64::NAN);
        values[1000..].iter_mut().for_each(|x| *x += 0.7);
        let sigma = NoiseEstimate::of(&values).unwrap().sigma();
        assert!((sigma / 1e-3 - 1.0).abs() < 0.1, "{sigma}");
    }

    #[test]
    fn the_floor_is_never_zero_and_simulations_have_none() {
        for values in [motion(1000), vec![0.0; 50], vec![3.0; 50]] {
            let noise = NoiseEstimate::of(&values).unwrap();
            assert!(noise.sigma() > 0.0 && noise.is_negligible(), "{noise:?}");
            let spread = |pick: fn(f64, f64) -> f64| values.iter().copied().reduce(pick).unwrap();
            let range = spread(f64::max) - spread(f64::min);
            let expected = if range > 0.0 { FINEST * range } else { ASSUMED };
            assert!((noise.floor() / expected - 1.0).abs() < 1e-9, "{noise:?}");
        }
        assert!(!NoiseEstimate::of(&noisy(500, 1e-4, 0.0)).unwrap().is_negligible());
        assert!(NoiseEstimate::of(&[1.0; 5]).is_none() && NoiseEstimate::of(&[f64::NAN; 50]).is_none());
    }

    #[test]
    fn a_step_survives_six_written_digits() {
        let step = std::f64::consts::TAU / 4096.0;
        let written = |x: f64| format!("{:.5e}", (x / step).round() * step).parse::<f64>().unwrap();
        let found = quantum(motion(2000).into_iter().map(written).collect()).unwrap();
        assert!((found / step - 1.0).abs() < 1e-3, "{found} {step}");
        assert!(quantum(motion(2000)).is_none());
    }
}
