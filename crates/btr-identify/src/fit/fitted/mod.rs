//! The complete fit: from a model at its current values to estimates with intervals.

mod beginning;
mod ladder;

use self::beginning::{TRIAL, begin, placed};
use self::ladder::LadderRecorder;
use super::estimate::{Estimate, Intervals, NullDirection, Posterior, estimates, null_directions};
use super::measure::{ComparisonMeasure, held_out_squares};
use super::objective::{LogSet, Objective};
use super::remaining::{Degree, RemainingError, remaining};
use super::residual_vector::chi;
use super::second_look::{LEFT_OUT, NEW_FLOORS, with_torque_floors, without_glitches};
use super::solve::{FitPoint, FitStop, SearchBudget};
use crate::LadderStep;
use crate::quality::GlitchReport;
use crate::residual_model::{RecordedLog, TimeStep};
use btr_core::world::{Cancelled, WorldError};

pub use self::beginning::{FitStart, StartValues};

/// A search has converged if settling lowers the cost by at most this share.
const CONVERGED: f64 = 1e-3;

/// A finished fit.
#[derive(Clone, Debug)]
pub struct FitResult {
    /// The point, with residual and Jacobian.
    pub fit: FitPoint,
    /// Every free parameter.
    pub parameters: Vec<Estimate>,
    /// Error on the training logs, in multiples of the noise floor.
    pub train: f64,
    /// Error on held-out logs.
    pub held_out: Option<f64>,
    /// Combinations that these logs do not determine.
    pub null_directions: Vec<NullDirection>,
    /// What logs and priors leave of all parameters together; `None` without a derivative.
    pub posterior: Option<Posterior>,
    /// The steps of the fit, with the two errors after each.
    pub ladder: Vec<LadderStep>,
    /// Why the search ended.
    pub ended: FitStop,
    /// Why intervals are withheld; `None` where they are given.
    pub withheld: Option<String>,
    /// The integrator's error in multiples of the noise floor, on the training or on the held-out logs, whichever is
    /// larger.
    pub integrator_error: f64,
    /// The time step of its simulations.
    pub step: TimeStep,
    /// How far the error is explained.
    pub degree: Degree,
    /// What is left in each channel.
    pub left: Vec<RemainingError>,
    /// The logs, with the noise floors that errors are multiples of.
    pub logs: Vec<RecordedLog>,
    /// The glitches that showed beside the fitted model and were left out, each with its log.
    pub glitches: Vec<(usize, GlitchReport)>,
    /// Simulated logs.
    pub rollouts: usize,
}

/// A fit, why it ended, and the integrator's error.
type FinishedSearch = (FitPoint, FitStop, f64);

/// How often starts are searched again for a motion without contact, ...
pub(crate) const RESTARTS: usize = 3;
/// ... while the squares fall below this share, or to this one where that leaves something to explain.
const LESS: f64 = 0.99;
const MOST: f64 = 0.5;

/// Fits all free parameters; `on_step` is called with each step: what was done, and the error on training and held-out
/// logs. Where that leaves something to explain, it continues with starts from the fitted model.
///
/// # Errors
/// The reason why the model cannot be simulated at its current values, or cancelled work.
pub fn fitted(objective: &mut Objective, on_step: &dyn Fn(&LadderStep)) -> Result<FitResult, WorldError> {
    fitted_from(objective, &FitStart::default(), on_step)
}

/// The same from a start that is known.
///
/// # Errors
/// See [`fitted`]; the reason why the model cannot be simulated at the start.
pub fn fitted_from(
    objective: &mut Objective,
    start: &FitStart,
    on_step: &dyn Fn(&LadderStep),
) -> Result<FitResult, WorldError> {
    let mut ladder = LadderRecorder { steps: Vec::new(), on_step };
    let fit = begin(objective, start, &mut ladder)?;
    let done = finish(objective, fit, &mut ladder, "fitted");
    let done = from_another_start(objective, done, start, &mut ladder);
    let restarts_left = if objective.description.has_contact { 1 } else { RESTARTS };
    let fitted = refine_starts(objective, done, ladder, restarts_left)?;
    if objective.model.is_cancelled() { Err(Cancelled.into()) } else { Ok(fitted) }
}

/// Where a fit leaves more than noise, the one from the other start, if it leaves less.
fn from_another_start(
    objective: &mut Objective,
    done: FinishedSearch,
    start: &FitStart,
    ladder: &mut LadderRecorder,
) -> FinishedSearch {
    let leaves = chi(done.0.squares(), objective.samples(LogSet::Learn));
    let Some(search) = start.search.filter(|_| leaves > objective.noise_bound()) else { return done };
    let Some((values, rollouts)) = search() else { return done };
    objective.add_rollouts(rollouts);
    let u = placed(objective, &values, done.0.u.clone());
    // Another start that cannot be simulated is none.
    let Ok(mut other) = FitPoint::at(objective, done.0.active.clone(), u, &done.0.step_error) else { return done };
    other.solve(objective, SearchBudget::FULL);
    if other.cost < LESS * done.0.cost { finish(objective, other, ladder, "added effects searched") } else { done }
}

/// Continues with start states from the fitted model, at most `restarts_left` times. Without contact, that is always
/// tried, and accepted if it lowers the error enough. Glitches that show beside the fitted model are left out
/// first, and noise floors taken from it.
fn refine_starts(
    objective: &Objective,
    done: FinishedSearch,
    mut ladder: LadderRecorder,
    restarts_left: usize,
) -> Result<FitResult, WorldError> {
    let contact = objective.description.has_contact;
    let cleaner = without_glitches(objective, &done.0).map(|cleaner| (cleaner, LEFT_OUT));
    let asks_floors = cleaner.is_none() && restarts_left > 0;
    let floors = asks_floors.then(|| with_torque_floors(objective, &done.0)).flatten();
    let restarts_left = restarts_left - usize::from(floors.is_some());
    let look = cleaner.or_else(|| Some((floors?, NEW_FLOORS)));
    if let Some((model, step)) = look {
        let mut again = objective.going_on(model.as_ref(), &done.0.u);
        let mut fit = FitPoint::at(&again, done.0.active.clone(), done.0.u.clone(), &[])?;
        fit.renew_step_error(&mut again);
        let done = finish(&mut again, fit, &mut ladder, step);
        return refine_starts(&again, done, ladder, restarts_left);
    }
    if restarts_left == 0 || (contact && ladder.error() <= objective.noise_bound()) {
        return Ok(conclude(objective, done, ladder));
    }
    let seen = objective.with_starts_at(&done.0.u);
    if seen.is_none() && contact {
        return Ok(conclude(objective, done, ladder));
    }
    let mut again = objective.going_on(seen.as_deref().unwrap_or(objective.model), &done.0.u);
    let mut fit = FitPoint::at(&again, done.0.active.clone(), done.0.u.clone(), &[])?;
    fit.renew_step_error(&mut again);
    if !contact {
        fit.solve(&again, TRIAL);
        if !is_better(&again, &fit, objective, &done.0) {
            objective.count(&again);
            return Ok(conclude(objective, done, ladder));
        }
    }
    let done = finish(&mut again, fit, &mut ladder, "starts re-estimated");
    refine_starts(&again, done, ladder, restarts_left - 1)
}

/// Whether new starts are accepted: nothing is left to explain, and less than before; or the old ones were so wrong
/// that most is explained now. A model that lacks something prefers starts that compensate for a little of it.
fn is_better(again: &Objective, fit: &FitPoint, objective: &Objective, before: &FitPoint) -> bool {
    let squares =
        |objective: &Objective, fit: &FitPoint| (fit.squares(), held_out_squares(objective, &fit.u).unwrap_or(0.0));
    let ((learnt, judged), (learnt_before, judged_before)) = (squares(again, fit), squares(objective, before));
    let samples = |logs| again.samples(logs);
    let explained = chi(learnt, samples(LogSet::Learn)) <= objective.noise_bound()
        && chi(judged, samples(LogSet::HeldOut).max(1)) <= objective.noise_bound();
    let share = if explained { LESS } else { MOST };
    learnt < share * learnt_before || judged < share * judged_before
}

/// Searches with the full budget, then settles; with the reason of its end and the integrator's error.
fn finish(objective: &mut Objective, mut fit: FitPoint, ladder: &mut LadderRecorder, step: &str) -> FinishedSearch {
    fit.jacobian = None;
    fit.solve(objective, SearchBudget::FULL);
    fit.leave_dead_sizes(objective);
    fit.sharpen(objective);
    let integrator_error = fit.renew_step_error(objective);
    let ended = fit.solve(objective, SearchBudget { jacobians: 2, steps: 8 });
    let solved = fit.cost;
    fit.settle(objective);
    // Steps along differences as wide as the remaining uncertainty do not lower the cost any further either.
    let ended = if solved - fit.cost <= CONVERGED * solved { FitStop::Converged } else { ended };
    ladder.record(objective, step, &fit);
    (fit, ended, integrator_error)
}

/// Why intervals are withheld where these errors are left, and the larger one; `None` where both are noise. Where the
/// noise floors are only roughly known, the held-out logs decide.
pub(crate) fn withheld(objective: &Objective, train: f64, held_out: Option<f64>) -> Option<(f64, String)> {
    let judged = held_out.unwrap_or(train);
    let error = if objective.has_rough_floors() { judged } else { judged.max(train) };
    let unit =
        if objective.description.has_runs { "what runs of the same command differ by" } else { "the noise floor" };
    let logs = if error > judged { " on the training logs" } else { "" };
    let why = || {
        let left = format!("the error{logs} is still {error:.2} times {unit}");
        (error, format!("{left}: something is missing, and any interval would be wrong"))
    };
    (error > objective.noise_bound()).then(why)
}

fn conclude(
    objective: &Objective,
    (mut fit, ended, integrator_error): FinishedSearch,
    mut ladder: LadderRecorder,
) -> FitResult {
    let (train, held_out) = ladder.errors();
    let is_noise = withheld(objective, train, held_out).is_none();
    if let Some(corrected) = is_noise.then(|| fit.without_attenuation(objective)).flatten() {
        fit = corrected;
        ladder.renew(objective, &fit);
    }
    let (train, held_out) = ladder.errors();
    let (left_error, withheld) = withheld(objective, train, held_out).unzip();
    let integrator_error = integrator_error.max(fit.held_out_step_error(objective));
    let rollouts = objective.rollouts();
    let left = remaining(objective, &fit.u);
    let degree = if withheld.is_none() { Degree::of_noise(&left) } else { Degree::Unexplained };
    let intervals = if withheld.is_none() { Intervals::Given } else { Intervals::Withheld };
    let inflation = ComparisonMeasure::of(objective, &fit).inflation();
    FitResult {
        parameters: estimates(objective, &fit, inflation, intervals).into_iter().map(|(_, e)| e).collect(),
        null_directions: null_directions(objective.parameters(), &fit),
        posterior: Posterior::of(objective, &fit, inflation, left_error),
        integrator_error,
        fit,
        train,
        held_out,
        ladder: ladder.steps,
        ended,
        withheld,
        step: objective.step(),
        degree,
        left,
        glitches: objective.description.glitches.clone(),
        logs: objective.description.logs.clone(),
        rollouts,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::fixture::{SyntheticModel, parameter};
    use crate::residual_model::{FitParameter, Parametrisation};

    /// A cosine of an unknown rate: the cost has a local minimum at many rates.
    fn cosine(residual: fn(&[f64]) -> Vec<f64>) -> SyntheticModel {
        let rate = FitParameter {
            spread: 3.0,
            reach: 0.01,
            ..parameter(Parametrisation::Exponential, 1.0, std::f64::consts::LN_2)
        };
        SyntheticModel::new(vec![rate], 120, residual)
    }

    /// What a rate leaves of the cosine with the true one.
    fn left(truth: f64, rate: f64) -> Vec<f64> {
        let swing = |rate: f64, row: usize| 30.0 * (rate * row as f64 * 0.05).cos();
        (0..120).map(|row| swing(truth, row) - swing(rate, row)).collect()
    }

    /// What a constant leaves of itself at 0.5 with noise, and another motion in some of the rows.
    fn left_beside(constant: f64, disturbed: std::ops::Range<usize>) -> Vec<f64> {
        let noise = |row: usize| if row.is_multiple_of(2) { 1.0 } else { -1.0 };
        let other = |row: usize| if disturbed.contains(&row) { 2.0 * (row as f64).sin() } else { 0.0 };
        (0..120).map(|row| 0.5 - constant + noise(row) + other(row)).collect()
    }

    #[test]
    fn intervals_are_withheld_where_the_training_logs_or_the_held_out_ones_leave_more_than_noise() {
        // A constant, noise of 1 and what no constant explains, in the first or in the last 60 rows.
        let asked = |residual: fn(&[f64]) -> Vec<f64>| {
            let constant = parameter(Parametrisation::Linear, 0.0, 1.0);
            let model = SyntheticModel::new(vec![constant], 60, residual).and_log(60).with_last_held_out();
            fitted(&mut Objective::new(&model), &|_| {}).unwrap().withheld
        };
        assert_eq!(asked(|values| left_beside(values[0], 120..120)), None);
        let of_training = asked(|values| left_beside(values[0], 0..60)).unwrap();
        assert!(of_training.contains("on the training logs"), "{of_training}");
        let of_held_out = asked(|values| left_beside(values[0], 60..120)).unwrap();
        assert!(!of_held_out.contains("training"), "{of_held_out}");
    }

    #[test]
    fn a_parameter_of_unknown_magnitude_is_started_at_several() {
        let model = cosine(|values| left(3.7, values[0]));
        let found = fitted(&mut Objective::new(&model), &|_| {}).unwrap();
        assert!((found.parameters[0].value - 3.7).abs() < 0.01, "{:?}", found.ladder);
    }

    #[test]
    fn a_start_that_is_known_is_begun_at_and_another_is_asked_for_where_more_than_noise_is_left() {
        let model = cosine(|values| left(11.0, values[0]));
        let found = |start: &FitStart| fitted_from(&mut Objective::new(&model), start, &|_| {}).unwrap();
        let is_found = |found: &FitResult| (found.parameters[0].value - 11.0).abs() < 0.01;
        let plain = found(&FitStart::default());
        assert!(!is_found(&plain), "{:?}", plain.ladder);
        let near = vec![Some(model.parameters[0].coordinate(11.1))];
        let begun = found(&FitStart { values: near.clone(), ..FitStart::default() });
        assert!(is_found(&begun), "{:?}", begun.ladder);
        let another = || Some((near.clone(), 500));
        let searched = found(&FitStart { search: Some(&another), ..FitStart::default() });
        assert!(is_found(&searched) && searched.rollouts > 500, "{:?}", searched.ladder);
        // Not where nothing is left, and not where it is no better.
        let never = || -> Option<(StartValues, usize)> { unreachable!("the fit leaves only noise") };
        found(&FitStart { values: near.clone(), search: Some(&never), ..FitStart::default() });
        let worse = || Some((vec![Some(model.parameters[0].coordinate(0.1))], 0));
        let kept = found(&FitStart { search: Some(&worse), ..FitStart::default() });
        assert_eq!((kept.fit.u, kept.ladder), (plain.fit.u, plain.ladder));
    }
}
