//! Searches on the unit cube, with an ask-and-tell interface.
//!
//! A search proposes a population ([`Search::ask`]), the caller evaluates it - on two cores or on a slow robot - and
//! reports the costs ([`Search::tell`]). Costs are minimised; a failed evaluation costs `f64::INFINITY`. The state of a
//! search is plain data, so that a run can be stopped and resumed at any generation. Points whose evaluation failed are
//! never kept, hence a state holds finite numbers only and survives text formats as well.

mod best;
pub mod cmaes;
pub mod ga;
pub mod gray;
#[cfg(test)]
mod laws;
pub mod map_elites;
mod pool;
pub mod real_ga;
mod sample;
pub mod spec;

pub use map_elites::MapElites;
pub(crate) use sample::{is_on_cube, uniform};
pub use spec::{AnySearch, SEARCHES, SearchSpec};

use crate::random::Rng;

/// A point of the unit cube.
pub type UnitPoint = Vec<f64>;

/// A search over the unit cube; the caller evaluates its populations.
pub trait Search {
    /// The next population to evaluate. `rng` belongs to this generation.
    fn ask(&mut self, rng: &mut Rng) -> Vec<UnitPoint>;
    /// Reports the costs of the last proposed population, in its order.
    fn tell(&mut self, population: &[UnitPoint], costs: &[f64]);
    /// The best point reported so far, with its cost; `None` until an evaluation has succeeded.
    fn best(&self) -> Option<(&[f64], f64)>;
}
