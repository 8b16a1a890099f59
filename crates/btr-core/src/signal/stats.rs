//! Statistics of plain series.

/// Arithmetic mean; NaN of nothing.
pub fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

/// Standard deviation of the series itself (divided by N, not N - 1); NaN of nothing.
pub fn std(x: &[f64]) -> f64 {
    let mean = mean(x);
    (x.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / x.len() as f64).sqrt()
}

/// The value below which this share of the values lies; `None` of nothing.
pub fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    let at = ((share * values.len() as f64) as usize).min(values.len().saturating_sub(1));
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(at, f64::total_cmp).1)
}

/// Standard deviation of errors around zero by the median of their sizes, as if they were normal: a few large ones
/// hardly change it. NaN are missing; `None` of nothing.
pub fn robust_std(errors: impl Iterator<Item = f64>) -> Option<f64> {
    /// The median of the size of normal numbers, in their standard deviation.
    const MEDIAN: f64 = 0.6745;
    Some(quantile(errors.map(f64::abs).filter(|size| size.is_finite()).collect(), 0.5)? / MEDIAN)
}

/// Kendall's tau-b: how far two rankings agree, from -1 (reversed) to 1 (the same); ties are allowed.
/// M. G. Kendall, "The treatment of ties in ranking problems", Biometrika 33, 1945.
///
/// `None` where it is not defined: unequal lengths, fewer than two pairs, a series that is constant or holds a NaN.
/// Compares all pairs, O(n²): meant for populations, not for logs.
pub fn kendall_tau_b(x: &[f64], y: &[f64]) -> Option<f64> {
    if x.len() != y.len() || x.iter().chain(y).any(|v| v.is_nan()) {
        return None;
    }
    let (mut agreement, mut untied_x, mut untied_y) = (0i64, 0i64, 0i64);
    for i in 1..x.len() {
        for j in 0..i {
            let (a, b) = (order(x[i], x[j]), order(y[i], y[j]));
            agreement += a * b;
            untied_x += a * a;
            untied_y += b * b;
        }
    }
    if untied_x == 0 || untied_y == 0 {
        return None;
    }
    // The root of a square is exact, so that a perfect ranking gives exactly 1.
    Some(agreement as f64 / (untied_x as f64 * untied_y as f64).sqrt())
}

/// 1, 0 or -1 as `a` is above, equal to or below `b`.
fn order(a: f64, b: f64) -> i64 {
    i64::from(a > b) - i64::from(a < b)
}

/// Number of samples of the lagged product, and its sum, about the means of the present samples. NaN are skipped.
fn lagged_product(x: &[f64], y: &[f64], lag: usize) -> (f64, f64) {
    let pairs = x.iter().zip(y.iter().skip(lag));
    pairs.map(|(a, b)| a * b).filter(|product| !product.is_nan()).fold((0.0, 0.0), |(n, sum), p| (n + 1.0, sum + p))
}

/// The series without its mean; NaN stay NaN.
pub fn centred(x: &[f64]) -> Vec<f64> {
    let (n, sum) = x.iter().filter(|v| !v.is_nan()).fold((0.0, 0.0), |(n, sum), v| (n + 1.0, sum + v));
    x.iter().map(|v| v - sum / n).collect()
}

/// Autocorrelation at lags 0 to `most`, with the usual normalisation that keeps it within -1 and 1 (G. E. P. Box and G.
/// M. Jenkins, "Time Series Analysis: Forecasting and Control", 1970). NaN are samples that are missing; where they
/// are, a lag's sum is scaled up to what it would be without holes. Empty for a series that is constant or empty.
pub fn autocorrelation(x: &[f64], most: usize) -> Vec<f64> {
    let x = centred(x);
    let (count, squares) = lagged_product(&x, &x, 0);
    if squares.is_nan() || squares <= 0.0 {
        return Vec::new();
    }
    let at = |lag: usize| {
        let (pairs, sum) = lagged_product(&x, &x, lag);
        // With n samples and no hole there are n - lag pairs.
        let whole = (count - lag as f64).max(0.0);
        if pairs > 0.0 { sum / squares * (whole / pairs) } else { 0.0 }
    };
    (0..=most.min(x.len().saturating_sub(1))).map(at).collect()
}

/// The integrated autocorrelation time tau = 1 + 2·sum of rho_k in samples: that many samples carry as much information
/// as one independent sample. The sum ends at the first lag k >= 5·tau (A. D. Sokal, "Monte Carlo methods in
/// statistical mechanics: foundations and new algorithms", 1997). At least 1.
pub fn autocorrelation_time(x: &[f64]) -> f64 {
    const WINDOW: f64 = 5.0;
    let x = centred(x);
    let (_, squares) = lagged_product(&x, &x, 0);
    let mut tau = 1.0;
    if squares.is_nan() || squares <= 0.0 {
        return tau;
    }
    for first in (1..x.len()).step_by(LAGS) {
        for (lag, sum) in (first..x.len()).zip(lagged_sums(&x, first)) {
            tau += 2.0 * sum / squares;
            if lag as f64 >= WINDOW * tau {
                return tau.max(1.0);
            }
        }
    }
    tau.max(1.0)
}

/// How many lags are summed in one pass over a series.
const LAGS: usize = 8;

/// The sums of the lagged products of a series at `LAGS` lags from `first`. Each is added up in the order of the
/// samples, so that it has the bits of a pass of its own; side by side they take the time of one.
fn lagged_sums(x: &[f64], first: usize) -> [f64; LAGS] {
    let mut sums = [0.0; LAGS];
    let mut add = |lag: usize, product: f64| sums[lag] += if product.is_nan() { 0.0 } else { product };
    let later = x.get(first..).unwrap_or_default();
    let whole = later.len().saturating_sub(LAGS - 1);
    for (a, window) in x.iter().zip(later.windows(LAGS).filter_map(<[f64]>::first_chunk::<LAGS>)) {
        window.iter().enumerate().for_each(|(lag, b)| add(lag, a * b));
    }
    for (i, a) in x.iter().enumerate().skip(whole).take(LAGS - 1) {
        later.iter().skip(i).enumerate().take(LAGS).for_each(|(lag, b)| add(lag, a * b));
    }
    sums
}

/// Result of a test of whiteness; results of several stretches add up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Whiteness {
    /// Q = n(n + 2)·sum of rho_k²/(n - k): chi-squared distributed if the series is white.
    pub q: f64,
    /// Number of autocorrelations in it.
    pub lags: f64,
}

impl Whiteness {
    /// Of a series; NaN are missing samples. No lags for fewer than twenty. G. M. Ljung and G. E. P.
    /// Box, "On a measure of lack of fit in time series models", Biometrika 65, 1978.
    pub fn of(x: &[f64]) -> Self {
        const MOST: usize = 25;
        let n = x.iter().filter(|v| !v.is_nan()).count();
        if n < 20 {
            return Whiteness::default();
        }
        let rho = autocorrelation(x, MOST.min(n / 5));
        let n = n as f64;
        let terms = rho.iter().enumerate().skip(1).map(|(k, rho)| rho * rho / (n - k as f64));
        Whiteness { q: n * (n + 2.0) * terms.sum::<f64>(), lags: rho.len().saturating_sub(1) as f64 }
    }

    /// This and another stretch together.
    #[must_use]
    pub fn and(self, other: Whiteness) -> Whiteness {
        Whiteness { q: self.q + other.q, lags: self.lags + other.lags }
    }

    /// Whether whiteness is not rejected at the level of 1 %. The quantile is the cube-root approximation of E. B.
    /// Wilson and M. M. Hilferty, "The distribution of chi-square", Proceedings of the National Academy of Sciences 17,
    /// 1931.
    pub fn is_white(&self) -> bool {
        const QUANTILE_99: f64 = 2.326;
        let spread = 2.0 / (9.0 * self.lags);
        self.lags > 0.0 && self.q <= self.lags * (1.0 - spread + QUANTILE_99 * spread.sqrt()).powi(3)
    }
}

/// Pearson's correlation of the samples present on both sides; `None` with fewer than three pairs or where one side is
/// constant.
pub fn correlation(x: &[f64], y: &[f64]) -> Option<f64> {
    let pairs = || x.iter().zip(y).filter(|(a, b)| a.is_finite() && b.is_finite());
    let n = pairs().count() as f64;
    let (sum_x, sum_y) = pairs().fold((0.0, 0.0), |(sx, sy), (a, b)| (sx + a, sy + b));
    let (mean_x, mean_y) = (sum_x / n, sum_y / n);
    let (xx, yy, xy) = pairs().fold((0.0, 0.0, 0.0), |(xx, yy, xy), (a, b)| {
        let (a, b) = (a - mean_x, b - mean_y);
        (xx + a * a, yy + b * b, xy + a * b)
    });
    // A constant leaves rounding errors behind, which correlate with anything.
    let varies = |squares: f64, mean: f64| squares / n > 1e-20 * mean * mean;
    (n >= 3.0 && varies(xx, mean_x) && varies(yy, mean_y)).then(|| (xy / (xx * yy).sqrt()).clamp(-1.0, 1.0))
}

/// The largest correlation of a residual with an input now or up to `most` samples earlier, in standard deviations of
/// what two independent series of the same autocorrelation would show: the independence test of residual analysis (L.
/// Ljung, "System Identification: Theory for the User", 1999), with M. S. Bartlett's variance of a correlation,
/// (1/n)·sum over k of rho_x(k)·rho_y(k) ("Some aspects of the time-correlation problem", Journal of the Royal
/// Statistical Society 98, 1935). 0 where one of them is constant or empty.
pub fn dependence(residual: &[f64], input: &[f64], most: usize) -> f64 {
    let both: Vec<bool> = residual.iter().zip(input).map(|(a, b)| a.is_finite() && b.is_finite()).collect();
    let masked = |x: &[f64]| -> Vec<f64> { x.iter().zip(&both).map(|(v, b)| if *b { *v } else { f64::NAN }).collect() };
    let (residual, input) = (masked(residual), masked(input));
    let n = both.iter().filter(|b| **b).count() as f64;
    let window = (5.0 * autocorrelation_time(&residual)).min(n / 4.0) as usize;
    let (rho_r, rho_i) = (autocorrelation(&residual, window), autocorrelation(&input, window));
    if rho_r.is_empty() || rho_i.is_empty() {
        return 0.0;
    }
    let shared: f64 = rho_r.iter().zip(&rho_i).skip(1).map(|(a, b)| 2.0 * a * b).sum();
    let deviation = ((1.0 + shared).max(1.0) / n).sqrt();
    let at = |lag: usize| {
        let (late, early) = (&residual[lag.min(residual.len())..], &input[..input.len().saturating_sub(lag)]);
        correlation(late, early).unwrap_or(0.0).abs()
    };
    (0..=most).map(at).fold(0.0, f64::max) / deviation
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    /// Few distinct values, so that ties are common; infinite ones are failed evaluations.
    fn pairs() -> impl Strategy<Value = Vec<(f64, f64)>> {
        let value = || prop_oneof![(0u8..5).prop_map(f64::from), Just(f64::INFINITY)];
        prop::collection::vec((value(), value()), 0..12)
    }

    proptest! {
        #[test]
        fn lags_side_by_side_have_the_bits_of_each_alone(
            x in prop::collection::vec(prop_oneof![9 => -1e3..1e3, 1 => Just(f64::NAN)], 0..40),
            first in 1usize..45,
        ) {
            for (lag, sum) in (first..).zip(lagged_sums(&x, first)) {
                prop_assert_eq!(sum.to_bits(), lagged_product(&x, &x, lag).1.to_bits());
            }
        }

        #[test]
        fn tau_is_the_textbooks_count(pairs in pairs()) {
            let (x, y): (Vec<f64>, Vec<f64>) = pairs.iter().copied().unzip();
            let (mut concordant, mut discordant, mut only_x_tied, mut only_y_tied) = (0.0, 0.0, 0.0, 0.0);
            for i in 0..x.len() {
                for j in i + 1..x.len() {
                    match (x[i].total_cmp(&x[j]), y[i].total_cmp(&y[j])) {
                        (a, b) if a.is_eq() && b.is_eq() => {}
                        (a, _) if a.is_eq() => only_x_tied += 1.0,
                        (_, b) if b.is_eq() => only_y_tied += 1.0,
                        (a, b) if a == b => concordant += 1.0,
                        _ => discordant += 1.0,
                    }
                }
            }
            let untied: f64 = concordant + discordant;
            let textbook = (concordant - discordant) / ((untied + only_x_tied) * (untied + only_y_tied)).sqrt();
            match kendall_tau_b(&x, &y) {
                Some(tau) => prop_assert!((tau - textbook).abs() < 1e-12),
                None => prop_assert!(textbook.is_nan()),
            }
        }

        #[test]
        fn tau_is_symmetric_and_changes_sign_on_reversal(pairs in pairs()) {
            let (x, y): (Vec<f64>, Vec<f64>) = pairs.iter().copied().unzip();
            let reversed: Vec<f64> = y.iter().map(|v| -v).collect();
            prop_assert_eq!(kendall_tau_b(&x, &y), kendall_tau_b(&y, &x));
            prop_assert_eq!(kendall_tau_b(&x, &y), kendall_tau_b(&x, &reversed).map(|tau| -tau));
        }
    }

    #[test]
    fn known_values() {
        assert_eq!(kendall_tau_b(&[1.0, 2.0, 3.0], &[10.0, 20.0, 30.0]), Some(1.0));
        // 3 concordant, 2 discordant, 1 tie in x of 6 pairs.
        let tau = kendall_tau_b(&[1.0, 1.0, 2.0, 3.0], &[2.0, 1.0, 4.0, 1.5]).unwrap();
        assert!((tau - 1.0 / 30f64.sqrt()).abs() < 1e-15, "{tau}");
        assert_eq!(kendall_tau_b(&[1.0, 1.0], &[1.0, 2.0]), None);
        assert_eq!(kendall_tau_b(&[1.0, f64::NAN], &[1.0, 2.0]), None);
        assert!((std(&[1.0, 3.0]) - 1.0).abs() < 1e-15 && (mean(&[1.0, 3.0]) - 2.0).abs() < 1e-15);
    }

    /// An autoregressive series x_k = phi·x_(k-1) + noise; white for phi = 0.
    fn autoregressive(phi: f64, n: usize, seed: u64) -> Vec<f64> {
        use rand::RngExt;
        let mut rng = crate::random::stream(seed, &[7]);
        let mut x = 0.0;
        let mut next = || {
            x = phi * x + (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
            x
        };
        (0..n).map(|_| next()).collect()
    }

    #[test]
    fn white_noise_is_called_white_and_an_autoregression_is_not() {
        let white = (0..40).filter(|seed| Whiteness::of(&autoregressive(0.0, 1000, *seed)).is_white()).count();
        assert!(white >= 37, "{white} of 40");
        for (phi, seed) in [(0.3, 1), (0.9, 2), (-0.5, 3)] {
            assert!(!Whiteness::of(&autoregressive(phi, 1000, seed)).is_white(), "{phi}");
        }
        let mut holed = autoregressive(0.0, 2000, 5);
        holed[500..900].fill(f64::NAN);
        assert!(Whiteness::of(&holed).is_white());
        assert!(!Whiteness::of(&[1.0; 100]).is_white() && Whiteness::of(&[]).lags < 1.0);
    }

    #[test]
    fn the_autocorrelation_time_of_an_autoregression_is_the_textbooks() {
        for phi in [0.0, 0.5, 0.9] {
            let tau = autocorrelation_time(&autoregressive(phi, 60_000, 11));
            let textbook = (1.0 + phi) / (1.0 - phi);
            assert!((tau / textbook - 1.0).abs() < 0.1, "{phi}: {tau} {textbook}");
        }
        let rho = autocorrelation(&autoregressive(0.5, 60_000, 12), 3);
        assert!(rho.iter().zip([1.0, 0.5, 0.25, 0.125]).all(|(a, b)| (a - b).abs() < 0.02), "{rho:?}");
    }

    #[test]
    fn a_response_depends_on_its_input_and_a_slow_series_does_not_by_itself() {
        let input = autoregressive(0.9, 3000, 21);
        let noise = autoregressive(0.0, 3000, 22);
        let follows: Vec<f64> = (0..3000).map(|i| if i < 4 { 0.0 } else { 0.2 * input[i - 4] } + noise[i]).collect();
        assert!(dependence(&follows, &input, 20) > 6.0);
        for seed in 30..40 {
            let z = dependence(&autoregressive(0.9, 3000, seed), &input, 20);
            assert!(z < 4.0, "{seed}: {z}");
        }
    }

    #[test]
    fn correlation_skips_what_is_missing() {
        let r = correlation(&[1.0, 2.0, f64::NAN, 3.0], &[2.0, 4.0, 1.0, 6.0]).unwrap();
        assert!((r - 1.0).abs() < 1e-12);
        assert!(correlation(&[1.0, 1.0, 1.0], &[1.0, 2.0, 3.0]).is_none());
    }
}
