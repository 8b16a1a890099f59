//! Screens effects on short parts of logs, where an error has not grown yet; those that explain the parts are refitted
//! to whole logs.

use super::refit::{FOLLOWER, Rival, race};
use super::screen::{StartPoint, screen};
use super::state::DiagnosisState;
use crate::fit::residual_vector::chi;
use crate::fit::{FitPoint, LogSet, Objective, SearchBudget};
use crate::residual_model::Derivation;

/// The best of the candidates `offered` on short parts of logs, refitted to whole logs, and the starts that were
/// screened for that. Empty where such parts are not available.
pub(super) fn from_short_parts(
    objective: &mut Objective,
    state: &DiagnosisState,
    parts: &Derivation,
    offered: &[usize],
) -> (Vec<Rival>, Vec<StartPoint>) {
    let Some(model) = objective.model.derive(parts) else { return Default::default() };
    // With the effects found so far; without any, with the free parameters at their given values: the ends of logs may
    // have biased their fit.
    let origin = || vec![0.0; state.fit.u.len()];
    let u = if state.chosen.is_empty() { origin() } else { state.fit.u.clone() };
    let mut short = objective.going_on(&*model, &u);
    let Ok(mut base) = FitPoint::at(&short, state.fit.active.clone(), u, &[]) else { return Default::default() };
    base.renew_step_error(&mut short);
    base.solve(&short, SearchBudget::FULL);
    let mut bases = vec![base];
    let starts = screen(&short, &mut bases, offered);
    let leaders = race(&short, &bases, &starts, None);
    objective.count(&short);
    // A leader that cannot be simulated over whole logs is skipped.
    let on_whole_logs = |rival: Rival| {
        let mut fit = FitPoint::at(objective, rival.fit.active.clone(), rival.fit.u, &state.fit.step_error).ok()?;
        fit.solve(objective, FOLLOWER);
        if chi(fit.squares(), objective.samples(LogSet::Learn)) <= objective.noise_bound() {
            // The step error is only known once the fit follows the whole motion.
            fit.renew_step_error(objective);
            fit.solve(objective, FOLLOWER);
        }
        Some(Rival { fit, ..rival })
    };
    (leaders.into_iter().filter_map(on_whole_logs).collect(), starts)
}
