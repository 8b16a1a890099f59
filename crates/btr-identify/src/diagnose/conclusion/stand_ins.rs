//! Free parameters that ended far from the model's values although an effect that is missing would explain the logs as
//! well: a servo's damping takes up viscous friction. The logs cannot tell the two apart, but the user may know the
//! parameter.

use crate::diagnose::refit::FOLLOWER;
use crate::diagnose::report::StandIn;
use crate::diagnose::state::DiagnosisState;
use crate::diagnose::thresholds::DECISIVE;
use crate::fit::measure::ComparisonMeasure;
use crate::fit::{FitPoint, Objective, columns};
use crate::residual_model::{CandidateKind, FitParameter};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Smallest share of a value by which a parameter has moved far.
const FAR: f64 = 0.1;
/// An effect is fitted in the place of a parameter's move where at most this share of the change by the move is left,
/// to first order: far moves are bent.
const NEARLY: f64 = 0.5;

/// The free parameters that may stand in for effects.
pub(super) fn stand_ins(objective: &Objective, state: &DiagnosisState) -> Vec<StandIn> {
    let mut fit = state.fit.clone();
    let is_far = |&k: &usize| {
        let parameter = &objective.parameters()[k];
        !parameter.amplitude && (parameter.value(fit.u[k]) / parameter.origin - 1.0).abs() > FAR
    };
    let moved: Vec<usize> = objective.description.free.iter().copied().filter(is_far).collect();
    if fit.jacobian.is_none() && !moved.is_empty() {
        fit.differentiate(objective);
    }
    let stand_in = |k: usize| {
        let parameter = &objective.parameters()[k];
        let effects = effects_instead(objective, state, &fit, k)?;
        (!effects.is_empty()).then(|| StandIn {
            parameter: parameter.name.clone(),
            unit: parameter.unit.clone(),
            in_model: parameter.origin,
            value: parameter.value(fit.u[k]),
            effects: effects.into_iter().map(|candidate| objective.candidates()[candidate].name()).collect(),
        })
    };
    moved.into_iter().filter_map(stand_in).collect()
}

/// The effects at a parameter's site that explain the logs as well as its move; `None` where the model's value cannot
/// be simulated, or the move makes no difference.
fn effects_instead(
    objective: &Objective,
    state: &DiagnosisState,
    fit: &FitPoint,
    parameter: usize,
) -> Option<Vec<usize>> {
    let candidates = objective.candidates();
    let (_, site) = objective.parameters()[parameter].name.rsplit_once('@')?;
    let is_simple = |&candidate: &usize| {
        let candidate = &candidates[candidate];
        candidate.kind == CandidateKind::Effect
            && candidate.site == site
            && candidate.shapes.is_empty()
            && candidate.amplitudes.len() == 1
    };
    let offered: Vec<usize> = state.offered(objective).into_iter().filter(is_simple).collect();
    let amplitudes: Vec<usize> = offered.iter().map(|&candidate| candidates[candidate].amplitudes[0]).collect();
    let moved = MovedBack::of(objective, fit, parameter)?;
    let measure = ComparisonMeasure::of(objective, fit);
    let sizes = moved.sizes(objective, &amplitudes);
    let fitted = offered.into_iter().zip(amplitudes).zip(sizes);
    let instead = fitted.filter(|((_, amplitude), size)| {
        let with = size.and_then(|size| moved.with(objective, *amplitude, size));
        with.is_some_and(|with| measure.behind(&with, fit) <= DECISIVE)
    });
    Some(instead.map(|((candidate, _), _)| candidate).collect())
}

/// A fit with a parameter moved back to the model's value.
struct MovedBack<'a> {
    fit: &'a FitPoint,
    back: FitPoint,
    /// What moving back changes in the residual, and its square without what the other parameters make up for.
    change: DVector<f64>,
    square: f64,
    others: Others,
}

impl<'a> MovedBack<'a> {
    /// `None` where the model's value cannot be simulated, or the move makes no difference.
    fn of(objective: &Objective, fit: &'a FitPoint, parameter: usize) -> Option<Self> {
        let active: Vec<usize> = fit.active.iter().copied().filter(|&k| k != parameter).collect();
        let mut u = fit.u.clone();
        u[parameter] = 0.0;
        let back = FitPoint::at(objective, active, u, &fit.step_error).ok()?;
        let others = Others::of(fit, parameter, objective.parameters())?;
        let change = back.residual.iter().zip(&fit.residual).map(|(back, here)| back - here);
        let change = DVector::from_iterator(fit.residual.len(), change);
        let square = others.common(&change, &change);
        (square > DECISIVE).then_some(MovedBack { fit, back, change, square, others })
    }

    /// The size of each amplitude that makes up for the change to first order; `None` where it leaves most of it, or is
    /// beyond its bounds.
    fn sizes(&self, objective: &Objective, amplitudes: &[usize]) -> Vec<Option<f64>> {
        let responses = columns(objective, &self.back.u, amplitudes, &self.back.residual, &self.fit.step_error);
        let size_of = |(response, &amplitude): (Vec<f64>, &usize)| {
            let response = DVector::from_vec(response);
            let along = self.others.common(&self.change, &response);
            let square = self.others.common(&response, &response);
            let size = -along / square;
            let (least, most) = objective.parameters()[amplitude].bounds;
            let is_enough = self.square - along.powi(2) / square <= NEARLY * self.square;
            (is_enough && least < size && size < most).then_some(size)
        };
        responses.into_iter().zip(amplitudes).map(size_of).collect()
    }

    /// The fit with an amplitude of about this size in the place of the move.
    fn with(&self, objective: &Objective, amplitude: usize, size: f64) -> Option<FitPoint> {
        let mut u = self.back.u.clone();
        u[amplitude] = size;
        let active = self.back.active.iter().copied().chain([amplitude]).collect();
        let mut with = FitPoint::at(objective, active, u, &self.fit.step_error).ok()?;
        with.solve(objective, FOLLOWER);
        Some(with)
    }
}

/// The other free parameters, which adapt to any change of the residual.
struct Others {
    jacobian: DMatrix<f64>,
    factors: Cholesky<f64, Dyn>,
}

impl Others {
    fn of(fit: &FitPoint, parameter: usize, parameters: &[FitParameter]) -> Option<Self> {
        let kept: Vec<usize> = (0..fit.active.len()).filter(|&k| fit.active[k] != parameter).collect();
        let jacobian = fit.jacobian.as_ref()?.select_columns(&kept);
        let precision = kept.iter().map(|&k| parameters[fit.active[k]].prior_sd().powi(-2));
        let precision = DVector::from_iterator(kept.len(), precision);
        let factors = (jacobian.tr_mul(&jacobian) + DMatrix::from_diagonal(&precision)).cholesky()?;
        Some(Others { jacobian, factors })
    }

    /// The product of two changes without what the others make up for.
    fn common(&self, a: &DVector<f64>, b: &DVector<f64>) -> f64 {
        a.dot(b) - self.jacobian.tr_mul(a).dot(&self.factors.solve(&self.jacobian.tr_mul(b)))
    }
}
