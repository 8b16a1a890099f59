//! What a reality reveals at the end of a run.

use btr_core::world::Reality;
use indexmap::IndexMap;
use serde::Serialize;

/// A reality that may tell at the end what it was.
pub trait Revealing: Reality + Send + Sync {
    /// The truth, where it is known: hidden twins know it, robots do not.
    fn reveal(&self) -> Option<Revealed> {
        None
    }
}

/// What the twin was in its last test, told at the end.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Revealed {
    /// Its parameters by name, in the units of S.
    pub parameters: IndexMap<String, f64>,
    /// The effects that the model did not have.
    pub effects: Vec<String>,
}
