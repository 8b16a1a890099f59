//! Probe sizes, and the start points that probes predict.

use crate::fit::{FitPoint, Objective};
use crate::residual_model::{EffectCandidate, Parametrisation};

/// Sizes of probes.
pub(super) struct ProbeSizes {
    /// Amplitudes, in typical sizes.
    pub amplitudes: &'static [f64],
    /// Limits, in multiples of the coordinate of a limit that is just reached in the first pass, and of the best one of
    /// that pass in the second. A limit acts only from some point on, so these are not extrapolated.
    pub limits: &'static [f64],
    /// Coordinates of compliances, over more than a decade: they are extrapolated a little.
    pub compliances: &'static [f64],
}

/// A candidate at its predicted best point.
#[derive(Clone, Debug)]
pub(crate) struct StartPoint {
    /// Index of the candidate.
    pub candidate: usize,
    /// Index of its base.
    pub base: usize,
    /// The point.
    pub u: Vec<f64>,
    /// The cost there: first predicted, then simulated.
    pub cost: f64,
}

impl StartPoint {
    /// The point at a share of the step from a base to this point; shapes are not interpolated.
    pub(crate) fn partly(&self, objective: &Objective, base: &FitPoint, share: f64) -> Vec<f64> {
        let mut u: Vec<f64> = base.u.iter().zip(&self.u).map(|(from, to)| from + share * (to - from)).collect();
        objective.candidates()[self.candidate].shapes.iter().for_each(|&k| u[k] = self.u[k]);
        u
    }

    pub(crate) fn shapes(&self, objective: &Objective) -> Vec<f64> {
        objective.candidates()[self.candidate].shapes.iter().map(|&k| self.u[k]).collect()
    }
}

/// Whether an effect's amplitude may have either sign and its response may differ between them: a foot that is pressed
/// down slips differently from one that is lifted.
pub(crate) fn has_two_sides(objective: &Objective, candidate: &EffectCandidate) -> bool {
    let parameters = objective.parameters();
    objective.description.has_contact
        && candidate.amplitudes.iter().any(|&parameter| parameters[parameter].bounds.0 < 0.0)
}

/// Whether a candidate's size is searched in the error: no probe says anything about it.
pub(crate) fn is_searched(objective: &Objective, candidate: usize) -> bool {
    let mut amplitudes = objective.candidates()[candidate].amplitudes.iter();
    amplitudes.any(|&k| objective.parameters()[k].is_searched())
}

/// Whether a candidate is one of two values.
pub(super) fn is_switched(objective: &Objective, candidate: usize) -> bool {
    let mut amplitudes = objective.candidates()[candidate].amplitudes.iter();
    amplitudes.any(|&k| objective.parameters()[k].law == Parametrisation::Switch)
}

/// The base's free parameters and a candidate's, which may be among them.
pub(crate) fn with(base: &FitPoint, candidate: &EffectCandidate) -> Vec<usize> {
    let added = candidate.parameters().filter(|parameter| !base.active.contains(parameter));
    base.active.iter().copied().chain(added).collect()
}
