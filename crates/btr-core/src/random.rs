//! Random numbers that belong to what they are for, never to a thread.
//!
//! Every consumer asks for a stream by a path of integers (what, iteration, generation, ...). The same path and seed
//! give the same numbers on every machine, thread count and after every resume; no generator state has to be saved.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// The generator used everywhere: portable, reproducible, cheap to seed.
pub type Rng = ChaCha8Rng;

/// The stream of random numbers that belongs to `path` under `seed`.
pub fn stream(seed: u64, path: &[u64]) -> Rng {
    let mut state = derive(seed, path);
    let mut bytes = [0u8; 32];
    for chunk in bytes.chunks_exact_mut(8) {
        state = splitmix(state);
        chunk.copy_from_slice(&state.to_le_bytes());
    }
    Rng::from_seed(bytes)
}

/// A seed of its own for `path` under `seed`.
pub fn derive(seed: u64, path: &[u64]) -> u64 {
    path.iter().fold(splitmix(seed), |state, &step| splitmix(state ^ splitmix(step.wrapping_add(GOLDEN))))
}

/// A standard normal number. Marsaglia and Bray's polar method (SIAM Review 6, 1964); its second number is dropped so
/// that no state has to be carried from call to call.
pub fn normal(rng: &mut Rng) -> f64 {
    loop {
        let (u, v) = (2.0 * rng.random::<f64>() - 1.0, 2.0 * rng.random::<f64>() - 1.0);
        let square = u * u + v * v;
        if square > 0.0 && square < 1.0 {
            return u * (-2.0 * square.ln() / square).sqrt();
        }
    }
}

/// SplitMix64's increment: 2^64 over the golden ratio.
const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

/// SplitMix64's output function: a bijection that scatters neighbouring integers.
/// Steele, Lea and Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014.
fn splitmix(x: u64) -> u64 {
    let mut z = x.wrapping_add(GOLDEN);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
