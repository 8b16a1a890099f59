//! Where a fit begins.

use super::ladder::LadderRecorder;
use crate::fit::objective::{LogSet, Objective};
use crate::fit::residual_vector::chi;
use crate::fit::solve::{FitPoint, SearchBudget};
use crate::residual_model::FitParameter;
use btr_core::world::WorldError;

/// Start values of amplitudes that are off: off, where some effects have no slope, and two sizes next to it.
const STARTS: [f64; 3] = [0.0, 0.4, 1.5];
/// Factors of further start values of parameters of unknown magnitude, tried while something is left to explain: the
/// cost may have a separate local minimum where a limit is far too low or too high.
const MAGNITUDES: [f64; 4] = [0.5, 2.0, 0.25, 4.0];
/// Budget of each start; only the best one continues.
pub(super) const TRIAL: SearchBudget = SearchBudget { jacobians: 1, steps: 6 };

/// For each parameter of a model, the coordinate to begin at; `None` where nothing but the model's value is known.
pub type StartValues = Vec<Option<f64>>;

/// What is known of where a fit should begin. By default nothing is.
#[derive(Default)]
pub struct FitStart<'a> {
    /// The point to begin at; what is not known of it begins at the model's values, or at the best of several.
    pub values: StartValues,
    /// The step of the error ladder there.
    pub step: String,
    /// Searches another point to begin at, and says how many logs that simulated. It is asked where the fit leaves more
    /// than noise.
    pub search: Option<&'a dyn Fn() -> Option<(StartValues, usize)>>,
}

/// A point with the values that are known moved there, within their bounds.
pub(super) fn placed(objective: &Objective, values: &StartValues, mut u: Vec<f64>) -> Vec<f64> {
    for (k, value) in values.iter().enumerate().filter_map(|(k, value)| Some((k, (*value)?))) {
        u[k] = objective.parameters()[k].clamp(value);
    }
    u
}

/// The best of several starts; or the point to begin at, where one is known of all that would be varied.
pub(super) fn begin(
    objective: &mut Objective,
    start: &FitStart,
    ladder: &mut LadderRecorder,
) -> Result<FitPoint, WorldError> {
    let free = objective.description.free.clone();
    let mut fit = FitPoint::at(objective, free.clone(), vec![0.0; objective.parameters().len()], &[])?;
    fit.renew_step_error(objective);
    ladder.record(objective, "model as it stands", &fit);
    if start.values.iter().any(Option::is_some) {
        fit = FitPoint::at(objective, free.clone(), placed(objective, &start.values, fit.u), &[])?;
        fit.renew_step_error(objective);
        ladder.record(objective, &start.step, &fit);
    }
    let (objective, parameters) = (&*objective, objective.parameters());
    let is_known = |k: usize| start.values.get(k).is_some_and(Option::is_some);
    let unknown = |is: fn(&FitParameter) -> bool| -> Vec<usize> {
        free.iter().copied().filter(|&k| is(&parameters[k]) && !is_known(k)).collect()
    };
    let (off, open) = (unknown(|parameter| parameter.amplitude), unknown(FitParameter::is_of_any_magnitude));
    if off.is_empty() && open.is_empty() {
        fit.search_stairs(objective);
        return Ok(fit);
    }
    // A start that cannot be simulated is skipped: others can.
    let from = |(size, factor): (f64, f64)| {
        let mut u = fit.u.clone();
        off.iter().for_each(|&k| u[k] = parameters[k].clamp(size));
        open.iter().for_each(|&k| u[k] = parameters[k].clamp(parameters[k].coordinate(factor * parameters[k].origin)));
        let mut fit = FitPoint::at(objective, free.clone(), u, &fit.step_error).ok()?;
        fit.solve(objective, TRIAL);
        Some(fit)
    };
    let best_of = |sizes: &[f64], factors: &[f64]| {
        let starts = factors.iter().flat_map(|factor| sizes.iter().map(move |size| (*size, *factor)));
        starts.filter_map(from).min_by(|a, b| a.cost.total_cmp(&b.cost))
    };
    let (at_off, next_to_off) = STARTS.split_at(1);
    // The first start is the current fit, which can be simulated: a best one exists.
    let mut best = best_of(if off.is_empty() { at_off } else { &STARTS }, &[1.0]).unwrap_or_else(|| fit.clone());
    if !open.is_empty() && chi(best.squares(), objective.samples(LogSet::Learn)) > objective.noise_bound() {
        let other = best_of(if off.is_empty() { at_off } else { next_to_off }, &MAGNITUDES);
        best = other.filter(|other| other.cost < best.cost).unwrap_or(best);
    }
    best.search_stairs(objective);
    ladder.record(objective, "best of several starts", &best);
    Ok(best)
}
