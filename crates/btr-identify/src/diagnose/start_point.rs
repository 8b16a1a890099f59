//! Probes of candidates, and the points that they point to.

use crate::fit::{FitPoint, Objective};
use crate::residual_model::EffectCandidate;

/// How large probes are.
pub(super) struct ProbeSizes {
    /// Amplitudes, in typical sizes.
    pub amplitudes: &'static [f64],
    /// Limits act from some threshold on and are probed around it; they are not scaled.
    pub limits: &'static [f64],
}

/// A candidate at a promising point.
#[derive(Clone, Debug)]
pub(super) struct StartPoint {
    /// Index of the candidate.
    pub candidate: usize,
    /// Index of the base it goes on from.
    pub base: usize,
    /// The point.
    pub u: Vec<f64>,
    /// The cost there: promised, then simulated.
    pub cost: f64,
}

impl StartPoint {
    /// Part of the way from a base to here; shapes have nowhere to come from.
    pub(super) fn partly(&self, objective: &Objective, base: &FitPoint, share: f64) -> Vec<f64> {
        let mut u: Vec<f64> = base.u.iter().zip(&self.u).map(|(from, to)| from + share * (to - from)).collect();
        objective.candidates()[self.candidate].shapes.iter().for_each(|&k| u[k] = self.u[k]);
        u
    }

    pub(super) fn shapes(&self, objective: &Objective) -> Vec<f64> {
        objective.candidates()[self.candidate].shapes.iter().map(|&k| self.u[k]).collect()
    }
}

/// Whether an effect may show on one side of zero and not on the other, and has both: a foot that is pressed down slips
/// where one that is lifted does not.
pub(super) fn has_two_sides(objective: &Objective, candidate: &EffectCandidate) -> bool {
    let parameters = objective.parameters();
    objective.description.has_contact
        && candidate.amplitudes.iter().any(|&parameter| parameters[parameter].bounds.0 < 0.0)
}

/// The base's free parameters and a candidate's.
pub(super) fn with(base: &FitPoint, candidate: &EffectCandidate) -> Vec<usize> {
    base.active.iter().copied().chain(candidate.parameters()).collect()
}
