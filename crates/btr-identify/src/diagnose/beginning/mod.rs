//! How a diagnosis begins, and a fit of effects that are known to act: each from where a diagnosis would begin it.

mod usual;

use super::evidence::MeanSquares;
use super::report::{DiagnoseOptions, MissingEffect, SecondLooks};
use super::round::rivals;
use super::state::{DiagnosisState, Tried};
use crate::LadderStep;
use crate::fit::{FitPoint, Objective, SearchBudget};
use btr_core::world::{Cancelled, WorldError};
pub(super) use usual::{GrantedTest, take_for_granted};

/// Fits the model's free parameters without any effect.
pub(super) fn begin(objective: &mut Objective, on_step: &dyn Fn(&LadderStep)) -> Result<DiagnosisState, WorldError> {
    let free = objective.description.free.clone();
    let origin = vec![0.0; objective.parameters().len()];
    let mut fit = FitPoint::at(objective, free.clone(), origin, &[])?;
    let mut state = DiagnosisState {
        held_out: None,
        fit: fit.clone(),
        bare: fit.clone(),
        chosen: Vec::new(),
        ladder: Vec::new(),
        rivals: Vec::new(),
        rounds: Vec::new(),
        unconfirmed: None,
        settled: Vec::new(),
        left_over: None,
        integrator: fit.renew_step_error(objective),
        unexplained_at_first: MeanSquares::default(),
        tried: Tried::default(),
    };
    state.fit = fit;
    state.record(objective, "model as it stands".to_owned(), on_step);
    objective.set_stoppable(true);
    if !free.is_empty() {
        state.fit.solve(objective, SearchBudget::FULL);
        state.integrator = state.fit.renew_step_error(objective);
        state.fit.solve(objective, SearchBudget { jacobians: 1, steps: 6 });
        state.record(objective, "its parameters fitted".to_owned(), on_step);
    }
    state.bare = state.fit.clone();
    Ok(state)
}

/// The fit of a model with effects that are known to act, as indices of candidates. They are added one after the other,
/// the one that explains most first; each is screened and fitted as in a round of a [diagnosis](super::diagnose), but
/// not judged. The free parameters begin at the model's values or, where that explains more, at `start`. What cannot be
/// simulated with an effect leaves it off.
///
/// # Errors
/// The reason why the model cannot be simulated at its current values, or cancelled work.
pub fn with_effects(objective: &mut Objective, effects: &[usize], start: &[f64]) -> Result<FitPoint, WorldError> {
    let mut state = begin(objective, &|_| {})?;
    if let Ok(begun) = FitPoint::at(objective, state.fit.active.clone(), start.to_vec(), &state.fit.step_error) {
        state.follow(objective, begun);
    }
    loop {
        let offered: Vec<usize> =
            state.offered(objective).into_iter().filter(|candidate| effects.contains(candidate)).collect();
        let mut second_looks = SecondLooks::new(DiagnoseOptions::default());
        let Some(best) = rivals(objective, &mut state, &mut second_looks, &offered).into_iter().next() else { break };
        let found = MissingEffect::of(best.candidate, &objective.candidates()[best.candidate], 1.0, 0.0);
        let best = state.beside_others(objective, best);
        state.accept(objective, best, found, &|_| {});
    }
    if objective.model.is_cancelled() { Err(Cancelled.into()) } else { Ok(state.fit) }
}

/// The state of a diagnosis that has found one candidate, where the search ends from a point.
#[cfg(test)]
#[allow(clippy::unwrap_used)]
pub(super) fn with_one_found(objective: &mut Objective, candidate: usize, u: &[f64]) -> DiagnosisState {
    let mut state = begin(objective, &|_| ()).unwrap();
    let effect = &objective.candidates()[candidate];
    let active = super::screen::with(&state.fit, effect);
    state.chosen.push(MissingEffect::of(candidate, effect, 1.0, 0.0));
    state.fit = FitPoint::at(objective, active, u.to_vec(), &[]).unwrap();
    state.fit.solve(objective, SearchBudget::FULL);
    state
}
