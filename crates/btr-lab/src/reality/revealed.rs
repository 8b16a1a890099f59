//! The truth that a reality reveals at the end of a run.

use btr_core::world::Reality;
use indexmap::IndexMap;
use serde::Serialize;

/// A reality that may reveal the truth at the end of a run.
pub trait Revealing: Reality + Send + Sync {
    /// The truth, if known: for hidden twins, not for robots.
    fn reveal(&self) -> Option<Revealed> {
        None
    }
}

/// The twin as it was in its last test.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Revealed {
    /// Its parameters by name, in the units of S.
    pub parameters: IndexMap<String, f64>,
    /// The effects that the model did not have.
    pub effects: Vec<String>,
}
