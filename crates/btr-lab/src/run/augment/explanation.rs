//! Explanations of real tests: S with added effects, and what each costs.

use super::extended::{Added, Extended};
use btr_core::coevolve::{Estimated, FittedExtension, Posterior};
use btr_core::world::Simulator;

/// An explanation that was fitted: S with added effects, and its fit.
pub(super) struct PresentExplanation<'a> {
    pub added: Vec<Added>,
    pub fitted: FittedExtension,
    pub prior: Posterior,
    pub extended: Extended<'a>,
}

/// A candidate after a few turns.
pub(super) struct QuickEstimate {
    pub added: Vec<Added>,
    pub belief: Posterior,
    pub chi: f64,
    pub explains: bool,
}

/// Cost of an explanation: its deviance plus the penalty of its parameters (Schwarz's criterion).
#[derive(Clone, Copy)]
pub(super) struct ExplanationCost {
    explains: bool,
    /// Over the beginnings of the tests.
    early: f64,
    /// Over the whole tests.
    pub whole: f64,
}

impl ExplanationCost {
    pub(super) fn of(state: &PresentExplanation) -> Self {
        let parameters = state.extended.simulations().len() as f64;
        let cost = |estimated: &Estimated| estimated.deviance + parameters * estimated.samples.ln();
        let FittedExtension { early, estimated, .. } = &state.fitted;
        ExplanationCost { explains: estimated.explains, early: cost(early), whole: cost(estimated) }
    }

    /// By how much `other` costs more. Two explanations that both explain everything are compared over the beginnings:
    /// later on, what an ensemble takes for unpredictable changes the deviance by more than the penalty of a parameter.
    pub(super) fn less_than(self, other: ExplanationCost) -> f64 {
        match (self.explains, other.explains) {
            (true, true) => other.early - self.early,
            (false, false) => other.whole - self.whole,
            (true, false) => f64::INFINITY,
            (false, true) => f64::NEG_INFINITY,
        }
    }
}
