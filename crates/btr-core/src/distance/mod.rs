//! How far a simulated behaviour is from the real one.

use crate::world::Behaviour;

/// A distance between what really happened and what a simulation says.
pub trait Distance: Send + Sync {
    /// Its name in experiment files.
    fn name(&self) -> &'static str;
    /// 0 for equal behaviours; NaN never, `f64::INFINITY` where they cannot be compared.
    fn distance(&self, real: &Behaviour, sim: &Behaviour) -> f64;
}
