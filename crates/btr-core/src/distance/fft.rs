//! The discrete Fourier transform of power-of-two length.
//!
//! J. W. Cooley and J. W. Tukey, "An algorithm for the machine calculation of complex Fourier series", Mathematics of
//! Computation 19, 1965; in place, decimation in time.

use std::f64::consts::TAU;

/// Roots of unity for one length.
pub(crate) struct Fft {
    roots: Vec<(f64, f64)>,
}

impl Fft {
    /// Prepares transforms of `len` points, a power of two.
    pub(crate) fn new(len: usize) -> Self {
        debug_assert!(len.is_power_of_two());
        let angle = |i: usize| -TAU * i as f64 / len as f64;
        Fft { roots: (0..len / 2).map(|i| (angle(i).cos(), angle(i).sin())).collect() }
    }

    /// Replaces `z` (real, imaginary) by its transform: Z_k = sum of z_n·exp(-2πi·k·n/N).
    pub(crate) fn transform(&self, z: &mut [(f64, f64)]) {
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
