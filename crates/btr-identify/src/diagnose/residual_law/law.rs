//! The law that a diagnosis reports.

use crate::fit::FitPoint;

/// A law that fits the error.
#[derive(Clone, Debug)]
pub struct ResidualLaw {
    /// Its terms, as indices of the residual model's law terms.
    pub terms: Vec<usize>,
    /// The base with it.
    pub fit: FitPoint,
    /// Whether it is added to the missing effects rather than replacing them.
    pub beside_effects: bool,
    /// The share of the squared error above the noise that it explains, on held-out logs if there are any.
    pub explains: f64,
}
