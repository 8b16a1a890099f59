//! Spectral density of a residual by Welch's method: P. D. Welch, "The use of fast Fourier transform for the estimation
//! of power spectra", IEEE Transactions on Audio and Electroacoustics 15, 1967.

use btr_core::signal::fft::Fft;
use btr_core::signal::stats::mean;
use std::f64::consts::TAU;

/// Samples of a segment, at most and at least.
const SEGMENT: std::ops::RangeInclusive<usize> = 32..=1024;

/// Frequency in Hz and amplitude density in the unit of the series per root Hz, from segments of Hann windows that
/// overlap by half; segments with missing samples are left out. Empty where no segment is complete.
pub fn spectrum(clock_s: &[f64], values: &[f64]) -> Vec<(f64, f64)> {
    let n = clock_s.len();
    if n < *SEGMENT.start() {
        return Vec::new();
    }
    let step_s = (clock_s[n - 1] - clock_s[0]) / (n - 1) as f64;
    // A quarter of the log, so that several segments average the noise away; rounded down to a power of two.
    let len = 1usize << (n / 4).clamp(*SEGMENT.start(), *SEGMENT.end()).ilog2();
    let window: Vec<f64> = (0..len).map(|i| 0.5 - 0.5 * (TAU * i as f64 / len as f64).cos()).collect();
    let fft = Fft::new(len);
    let (mut power, mut count) = (vec![0.0; len / 2], 0.0);
    for from in (0..=n - len).step_by(len / 2) {
        let segment = &values[from..from + len];
        let duration_s = clock_s[from + len - 1] - clock_s[from];
        if segment.iter().any(|x| !x.is_finite()) || duration_s > 1.5 * step_s * len as f64 {
            continue;
        }
        let middle = mean(segment);
        let mut z: Vec<(f64, f64)> = segment.iter().zip(&window).map(|(x, w)| ((x - middle) * w, 0.0)).collect();
        fft.transform(&mut z);
        power.iter_mut().zip(&z).for_each(|(p, z)| *p += z.0 * z.0 + z.1 * z.1);
        count += 1.0;
    }
    if count <= 0.0 {
        return Vec::new();
    }
    // One-sided density: both halves of the spectrum, over the rate and the window's power.
    let scale = 2.0 * step_s / (count * window.iter().map(|w| w * w).sum::<f64>());
    let at = |(k, p): (usize, &f64)| (k as f64 / (len as f64 * step_s), (p * scale).sqrt());
    power.iter().enumerate().skip(1).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tone_is_at_its_frequency_with_its_power() {
        let clock: Vec<f64> = (0..2000).map(|i| 0.005 * f64::from(i)).collect();
        let mut values: Vec<f64> = clock.iter().map(|t| 3.0 + 2.0 * (TAU * 12.5 * t).sin()).collect();
        values[100] = f64::NAN;
        let spectrum = spectrum(&clock, &values);
        let peak = spectrum.iter().max_by(|a, b| a.1.total_cmp(&b.1)).copied().unwrap_or_default();
        let width = spectrum[1].0 - spectrum[0].0;
        let power: f64 = spectrum.iter().map(|(_, a)| a * a * width).sum();
        assert!((peak.0 - 12.5).abs() < width && (power - 2.0).abs() < 0.05, "{peak:?} {power}");
        assert!(super::spectrum(&clock, &[f64::NAN; 2000]).is_empty() && super::spectrum(&[], &[]).is_empty());
    }
}
