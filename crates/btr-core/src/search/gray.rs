//! Gray codes: numbers whose neighbours differ in one bit, so that a single mutation can always take the smallest step.
//!
//! Binary-reflected code: F. Gray, "Pulse code communication", US patent 2,632,058, 1953.

/// The finest coding: 32 bits.
pub const MAX_BITS: u32 = u32::BITS;

/// The Gray word of the grid point nearest to `u`; `u` in [0, 1], `bits` in 1..=[`MAX_BITS`] (both are clamped).
pub fn encode(u: f64, bits: u32) -> u32 {
    let top = f64::from(top(bits));
    // In range by construction: `top` fits 32 bits and NaN becomes 0.
    let n = (u.clamp(0.0, 1.0) * top).round() as u32;
    n ^ (n >> 1)
}

/// The grid point of a Gray word, in [0, 1]: 0 is exactly 0 and the top of the grid exactly 1.
/// `encode(decode(word, bits), bits) == word` for every word of `bits` bits.
pub fn decode(word: u32, bits: u32) -> f64 {
    let mut n = word;
    for shift in [16, 8, 4, 2, 1] {
        n ^= n >> shift;
    }
    let top = top(bits);
    f64::from(n.min(top)) / f64::from(top)
}

/// The largest number of `bits` bits.
fn top(bits: u32) -> u32 {
    u32::MAX >> (MAX_BITS - bits.clamp(1, MAX_BITS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn words_survive_the_round_trip(word: u32, bits in 1..=MAX_BITS) {
            let word = word & top(bits);
            prop_assert_eq!(encode(decode(word, bits), bits), word);
        }

        #[test]
        fn numbers_move_by_half_a_step_at_most(u in 0.0..=1.0, bits in 1..=MAX_BITS) {
            let back = decode(encode(u, bits), bits);
            prop_assert!((back - u).abs() <= 0.5 / f64::from(top(bits)) * (1.0 + 1e-9));
        }

        #[test]
        fn grid_neighbours_differ_in_one_bit(n: u32, bits in 2..=MAX_BITS) {
            let n = n % top(bits);
            let step = 1.0 / f64::from(top(bits));
            let word = |n: u32| encode(f64::from(n) * step, bits);
            prop_assert_eq!((word(n) ^ word(n + 1)).count_ones(), 1);
        }
    }

    #[test]
    fn the_ends_are_exact() {
        for bits in 1..=MAX_BITS {
            assert_eq!((decode(encode(0.0, bits), bits), decode(encode(1.0, bits), bits)), (0.0, 1.0));
        }
    }
}
