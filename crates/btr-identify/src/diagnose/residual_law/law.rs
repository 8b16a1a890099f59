//! The law that a diagnosis reports.

use crate::fit::FitPoint;

/// A law that the error follows.
#[derive(Clone, Debug)]
pub struct ResidualLaw {
    /// Its terms, as indices of the family's features.
    pub terms: Vec<usize>,
    /// The base with it.
    pub fit: FitPoint,
    /// Whether it is added to the effects that were found, or replaces them.
    pub beside_effects: bool,
    /// The share of the squared error above the noise that it explains on held-out logs.
    pub explains: f64,
}
