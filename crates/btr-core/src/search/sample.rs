//! Random numbers the searches share.

use super::UnitPoint;
use crate::random::Rng;
use rand::RngExt;

/// A point anywhere in the cube.
pub(crate) fn uniform(dims: usize, rng: &mut Rng) -> UnitPoint {
    (0..dims).map(|_| rng.random()).collect()
}

/// Whether this is a point of the cube with `dims` dimensions.
pub(crate) fn is_on_cube(dims: usize, point: &[f64]) -> bool {
    point.len() == dims && point.iter().all(|x| (0.0..=1.0).contains(x))
}

/// A point of the cube from a caller's point: clamped, and 0.5 where a number is missing.
pub(crate) fn on_cube(dims: usize, point: &[f64]) -> UnitPoint {
    (0..dims).map(|i| point.get(i).copied().filter(|x| !x.is_nan()).unwrap_or(0.5).clamp(0.0, 1.0)).collect()
}
