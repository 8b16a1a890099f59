//! Difference of amplitude spectra: the strength of each frequency, not its phase.
//!
//! A gait that starts a moment later is the same gait. Spectra are taken through a Hann window (F. J. Harris, "On the
//! use of windows for harmonic analysis with the discrete Fourier transform", Proceedings of the IEEE 66, 1978).

use super::channels::{root_mean_square, sum_pairs};
use super::{Channels, Distance, comparable};
use crate::log::interpolate;
use crate::signal::fft::Fft;
use crate::world::Behaviour;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Root mean square over the measured channels of their [`spectral_difference`], each divided by the standard deviation
/// of the real channel (held joints by a tenth of the largest one of their unit).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Spectrum {
    /// Channels to compare; all sensors unless given.
    pub channels: Channels,
}

impl Distance for Spectrum {
    fn name(&self) -> &'static str {
        "spectrum"
    }

    fn distance(&self, real: &Behaviour, sim: &Behaviour) -> f64 {
        let Some(mut analyser) = Analyser::new(real.log.clock_s()) else { return f64::INFINITY };
        let errors = self.channels.scaled_errors(&real.log, &sim.log, |x, y| analyser.difference(x, y));
        comparable(root_mean_square(&errors))
    }
}

/// Difference of the amplitude spectra of two series on one increasing clock (seconds), in the unit of the series: the
/// root mean square a signal would have whose spectrum is the difference, the means included. It does not see phase,
/// and never exceeds the root mean square of the windowed difference. `None` when fewer than four samples are present
/// on both sides.
pub fn spectral_difference(clock_s: &[f64], x: &[f64], y: &[f64]) -> Option<f64> {
    Analyser::new(clock_s)?.difference(x, y)
}

/// What the channels of one log share: an even grid of a power of two points, the window, the transform.
struct Analyser<'a> {
    clock_s: &'a [f64],
    grid_s: Vec<f64>,
    window: Vec<f64>,
    fft: Fft,
    z: Vec<(f64, f64)>,
}

const FEWEST_SAMPLES: usize = 4;

impl<'a> Analyser<'a> {
    fn new(clock_s: &'a [f64]) -> Option<Self> {
        if clock_s.len() < FEWEST_SAMPLES {
            return None;
        }
        let points = clock_s.len().next_power_of_two();
        let (first, last) = (clock_s[0], clock_s[clock_s.len() - 1]);
        let step = (last - first) / (points - 1) as f64;
        Some(Analyser {
            clock_s,
            grid_s: (0..points).map(|i| first + step * i as f64).collect(),
            window: (0..points).map(|i| 0.5 - 0.5 * (TAU * i as f64 / points as f64).cos()).collect(),
            fft: Fft::new(points),
            z: vec![(0.0, 0.0); points],
        })
    }

    fn difference(&mut self, x: &[f64], y: &[f64]) -> Option<f64> {
        let (x, y) = self.on_grid(x, y)?;
        let points = self.z.len();
        let (mean_x, mean_y) = (self.mean(&x), self.mean(&y));
        // One transform for both: x in the real parts, y in the imaginary ones.
        for (i, z) in self.z.iter_mut().enumerate() {
            *z = ((x[i] - mean_x) * self.window[i], (y[i] - mean_y) * self.window[i]);
        }
        self.fft.transform(&mut self.z);
        let mut squares = 0.0;
        // The other half of a real signal's spectrum is its mirror image, and the constant part is taken out.
        for k in 1..=points / 2 {
            let (p, m) = (self.z[k], self.z[points - k]);
            let amplitude_x = 0.5 * ((p.0 + m.0).powi(2) + (p.1 - m.1).powi(2)).sqrt();
            let amplitude_y = 0.5 * ((p.1 + m.1).powi(2) + (m.0 - p.0).powi(2)).sqrt();
            let twins = if 2 * k == points { 1.0 } else { 2.0 };
            squares += twins * (amplitude_x - amplitude_y).powi(2);
        }
        // Parseval's theorem, and the power that the window takes away.
        let window: f64 = self.window.iter().map(|w| w * w).sum();
        Some((squares / (points as f64 * window) + (mean_x - mean_y).powi(2)).sqrt())
    }

    /// The mean through the window, which an oscillation cut off in mid-period hardly shifts.
    fn mean(&self, x: &[f64]) -> f64 {
        let (weighted, _) = sum_pairs(x, &self.window, |x, w| x * w);
        weighted / self.window.iter().sum::<f64>()
    }

    /// Both series on the even grid, across the samples present on both sides.
    fn on_grid(&self, x: &[f64], y: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
        if x.iter().zip(y).all(|(a, b)| !(a - b).is_nan()) {
            return Some((interpolate(self.clock_s, x, &self.grid_s), interpolate(self.clock_s, y, &self.grid_s)));
        }
        let present: Vec<usize> = (0..self.clock_s.len()).filter(|&i| !(x[i] - y[i]).is_nan()).collect();
        if present.len() < FEWEST_SAMPLES {
            return None;
        }
        let pick = |s: &[f64]| -> Vec<f64> { present.iter().map(|&i| s[i]).collect() };
        let clock_s = pick(self.clock_s);
        Some((interpolate(&clock_s, &pick(x), &self.grid_s), interpolate(&clock_s, &pick(y), &self.grid_s)))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    fn sine(clock_s: &[f64], amplitude: f64, hertz: f64, phase: f64) -> Vec<f64> {
        clock_s.iter().map(|t| amplitude * (TAU * hertz * t + phase).sin()).collect()
    }

    fn clock(samples: usize) -> Vec<f64> {
        (0..samples).map(|i| 0.01 * i as f64).collect()
    }

    proptest! {
        #[test]
        fn phase_does_not_matter_amplitude_does(hertz in 1.0..5.0f64, phase in 0.0..TAU, gain in 0.0..3.0f64) {
            let clock_s = clock(1000);
            let x = sine(&clock_s, 1.0, hertz, 0.4);
            let shifted = spectral_difference(&clock_s, &x, &sine(&clock_s, 1.0, hertz, phase)).unwrap();
            prop_assert!(shifted < 0.01, "shifted: {shifted}");
            let gained = spectral_difference(&clock_s, &x, &sine(&clock_s, gain, hertz, phase)).unwrap();
            prop_assert!((gained - (gain - 1.0).abs() * 0.5f64.sqrt()).abs() < 0.02, "gained: {gained}");
        }
    }

    #[test]
    fn frequency_and_offset_matter() {
        let clock_s = clock(1000);
        let x = sine(&clock_s, 1.0, 2.0, 0.0);
        // Different lines of a spectrum do not overlap: 0.5 + 0.5 in squares.
        let other = spectral_difference(&clock_s, &x, &sine(&clock_s, 1.0, 3.0, 0.0)).unwrap();
        assert!((other - 1.0).abs() < 0.01, "{other}");
        let raised: Vec<f64> = x.iter().map(|v| v + 0.7).collect();
        assert!((spectral_difference(&clock_s, &x, &raised).unwrap() - 0.7).abs() < 1e-9);
    }

    #[test]
    fn missing_samples_are_bridged() {
        let clock_s = clock(1000);
        let x = sine(&clock_s, 1.0, 2.0, 0.0);
        let mut holes = x.clone();
        holes[300..303].fill(f64::NAN);
        assert!(spectral_difference(&clock_s, &x, &holes).unwrap() < 1e-14);
        assert_eq!(spectral_difference(&clock_s, &x, &[f64::NAN; 1000]), None);
        assert_eq!(spectral_difference(&clock_s[..3], &x[..3], &x[..3]), None);
    }
}
