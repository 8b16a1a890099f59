//! The discrete Fourier transform of power-of-two length.
//!
//! J. W. Cooley and J. W. Tukey, "An algorithm for the machine calculation of complex Fourier series", Mathematics of
//! Computation 19, 1965; in place, decimation in time.
//!
//! It is btr's own because results must have the same bits on every machine: `rustfft` rounds differently (most bits of
//! random transforms of 64 points and more change), and chooses its algorithm by the processor's vector instructions.

use std::f64::consts::TAU;

/// Largest number of time bins in the search for a rate, and the factor of zero padding that refines its frequency
/// grid.
const BINS: usize = 16_384;
const PADDING: usize = 4;

/// The rate in rad/s at which samples (time in s, value) oscillate most: the peak of their power spectrum, from one
/// period over the whole duration up to half the Nyquist rate of samples every `step_s`. Several samples may share one
/// time.
pub fn peak_rate(samples: &[(f64, f64)], step_s: f64) -> Option<f64> {
    let last_s = samples.iter().map(|(t, _)| *t).fold(0.0, f64::max);
    let bin_s = step_s.max(last_s / BINS as f64);
    if !(bin_s > 0.0 && last_s > bin_s) {
        return None;
    }
    let bins = (last_s / bin_s) as usize + 1;
    let mut z = vec![(0.0, 0.0); (PADDING * bins).next_power_of_two()];
    samples.iter().filter(|(t, _)| *t >= 0.0).for_each(|(t, value)| z[(t / bin_s).round() as usize].0 += value);
    Fft::new(z.len()).transform(&mut z);
    let rate = |k: usize| TAU * k as f64 / (z.len() as f64 * bin_s);
    let least = (z.len() as f64 * bin_s / last_s).ceil() as usize;
    let power = |k: usize| z[k].0 * z[k].0 + z[k].1 * z[k].1;
    let peak = (least..z.len() / 4).max_by(|&a, &b| power(a).total_cmp(&power(b)))?;
    (power(peak) > 0.0).then(|| rate(peak))
}

/// Roots of unity for one length.
pub struct Fft {
    roots: Vec<(f64, f64)>,
}

impl Fft {
    /// Prepares transforms of `len` points, a power of two.
    pub fn new(len: usize) -> Self {
        debug_assert!(len.is_power_of_two());
        let angle = |i: usize| -TAU * i as f64 / len as f64;
        Fft { roots: (0..len / 2).map(|i| (angle(i).cos(), angle(i).sin())).collect() }
    }

    /// Replaces `z` (real, imaginary) by its transform: Z_k = sum of z_n·exp(-2πi·k·n/N).
    pub fn transform(&self, z: &mut [(f64, f64)]) {
        let len = z.len();
        for i in 0..len {
            let j = if len > 1 { i.reverse_bits() >> (usize::BITS - len.trailing_zeros()) } else { i };
            if i < j {
                z.swap(i, j);
            }
        }
        let mut half = 1;
        while half < len {
            let stride = len / (2 * half);
            for block in z.chunks_exact_mut(2 * half) {
                let (low, high) = block.split_at_mut(half);
                for ((a, b), w) in low.iter_mut().zip(high).zip(self.roots.iter().step_by(stride)) {
                    let turned = (b.0 * w.0 - b.1 * w.1, b.0 * w.1 + b.1 * w.0);
                    *b = (a.0 - turned.0, a.1 - turned.1);
                    *a = (a.0 + turned.0, a.1 + turned.1);
                }
            }
            half *= 2;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_rate_of_an_oscillation_is_found() {
        let samples: Vec<(f64, f64)> =
            (0..401).map(|i| 0.01 * f64::from(i)).map(|t| (t, 1.0 + (19.0 * t + 0.4).sin())).collect();
        let swinging: Vec<(f64, f64)> = samples.iter().map(|(t, y)| (*t, y - 1.0)).collect();
        assert!(peak_rate(&swinging, 0.01).is_some_and(|rate| (rate - 19.0).abs() < 0.2));
        assert_eq!(peak_rate(&[(0.0, 1.0)], 0.01), None);
        assert_eq!(peak_rate(&[], 0.01), None);
    }

    proptest! {
        #[test]
        fn equals_the_definition(power in 0u32..7, values in prop::collection::vec((-1.0..1.0f64, -1.0..1.0f64), 64)) {
            let n = 1usize << power;
            let mut z = values[..n].to_vec();
            Fft::new(n).transform(&mut z);
            for (k, got) in z.iter().enumerate() {
                let mut sum = (0.0, 0.0);
                for (i, v) in values[..n].iter().enumerate() {
                    let (sin, cos) = (-TAU * (k * i % n) as f64 / n as f64).sin_cos();
                    sum = (sum.0 + v.0 * cos - v.1 * sin, sum.1 + v.0 * sin + v.1 * cos);
                }
                prop_assert!((got.0 - sum.0).abs() < 1e-12 && (got.1 - sum.1).abs() < 1e-12);
            }
        }
    }
}
