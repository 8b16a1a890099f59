//! Estimates: the value of each parameter, its interval, and combinations that the logs do not determine.

mod clusters;
mod identifiable;
mod null_directions;
mod posterior;
mod precision;

pub use identifiable::{Identifiable, Sensitivity, identifiable};
pub use null_directions::{NullDirection, null_directions};
pub use posterior::{Coordinate, Marginal, Posterior};

use super::objective::{LogSet, Objective};
use super::solve::FitPoint;
use crate::residual_model::Parametrisation;
use clusters::{between_logs, by_clusters};
use nalgebra::DVector;
pub(crate) use precision::NINETY_FIVE;
pub(super) use precision::information;
use precision::{covariance, independent, posterior_precision, roots};
use serde::{Deserialize, Serialize};

/// If priors that are wider by this factor...
const LOOSE: f64 = 3.0;
/// ... widen an interval by this factor, the interval is due to the bounds.
const BY_BOUNDS: f64 = 1.5;

/// A fitted parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Its name.
    pub name: String,
    /// SI unit as text.
    pub unit: String,
    /// Its value; not finite for limits that are off.
    pub value: f64,
    /// A 95 % interval; none where the residual still has structure, or where the value stands at a bound.
    pub ci95: Option<[f64; 2]>,
    /// Whether it stands at a bound.
    pub at_bound: bool,
    /// Whether the interval is due to bounds of this and other parameters rather than to the logs.
    pub by_bounds: bool,
    /// Standard deviation of its prior on further logs, in its unit, so wide that independent priors are in no
    /// direction narrower than what these logs leave; none without an interval, or with one that is due to bounds.
    #[serde(skip)]
    pub prior_sd: Option<f64>,
}

/// Whether estimates have intervals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Intervals {
    /// The residual is noise: every estimate has an interval.
    Given,
    /// The residual still has structure, and any interval would be wrong.
    Withheld,
}

/// Values and intervals of the free parameters of a fit, with their indices. `inflation` is the factor of the
/// covariance that accounts for the residual's variance and memory. The effect of the time step on a parameter widens
/// its interval as well. Intervals are at least as wide as the differences between parts of the logs suggest.
pub fn estimates(
    objective: &Objective,
    fit: &FitPoint,
    inflation: f64,
    intervals: Intervals,
) -> Vec<(usize, Estimate)> {
    let given = intervals == Intervals::Given;
    let parameters = objective.parameters();
    let covariance = covariance(parameters, fit, inflation, 1.0);
    let (deviations_within, widening) = (covariance.as_ref().map(roots), covariance.as_ref().map(independent));
    let by_logs = precision::covariance(parameters, fit, inflation, LOOSE).as_ref().map(roots);
    let wider = deviations_within.as_ref().map(|within| wider(objective, fit, within));
    let by_step = if given { by_step(objective, fit) } else { None };
    let estimate = |(k, &index): (usize, &usize)| {
        let (parameter, u) = (&parameters[index], fit.u[index]);
        let near = 1e-6 * (parameter.bounds.1 - parameter.bounds.0);
        let at_bound = u <= parameter.bounds.0 + near || u >= parameter.bounds.1 - near;
        let deviation = deviations_within.as_ref().map(|d| d[k]).filter(|_| given && !at_bound);
        let by_bounds =
            deviation.zip(by_logs.as_ref()).is_some_and(|(within, by_logs)| by_logs[k] > BY_BOUNDS * within);
        let deviation = deviation.map(|d| wider.as_ref().map_or(d, |wider| wider[k]));
        let deviation = deviation.map(|d| by_step.as_ref().map_or(d, |by_step| d.hypot(by_step[k])));
        let ends = |d: f64| [-1.0, 1.0].map(|side| parameter.value(parameter.along(u, side * NINETY_FIVE * d)));
        let ci95 = match (parameter.law, deviation) {
            (Parametrisation::Switch, _) => None,
            (Parametrisation::Stair, Some(_)) => {
                fit.step_of_stair(objective, index, inflation).map(|ends| ends.map(|u| parameter.value(u)))
            }
            (_, deviation) => deviation.map(ends),
        };
        let ci95 = ci95.map(|[a, b]| [a.min(b), a.max(b)]);
        let prior_sd = deviation.zip(widening.as_ref()).filter(|_| !by_bounds);
        let prior_sd = prior_sd.map(|(d, widening)| widening[k] * d * parameter.slope(u).abs());
        let (name, unit) = (parameter.name.clone(), parameter.unit.clone());
        (index, Estimate { name, unit, value: parameter.value(u), ci95, at_bound, by_bounds, prior_sd })
    };
    fit.active.iter().enumerate().map(estimate).collect()
}

/// Standard deviations of the free coordinates that are `within` by the covariance, at least as wide as the differences
/// between parts of the logs suggest; between whole logs where these are runs that differ.
fn wider(objective: &Objective, fit: &FitPoint, within: &[f64]) -> Vec<f64> {
    let by_parts = || by_clusters(&objective.description, fit);
    between_logs(&objective.description, fit).unwrap_or_else(|| match by_parts() {
        Some(by_parts) => within.iter().zip(by_parts).map(|(within, by_parts)| within.max(by_parts)).collect(),
        None => within.to_vec(),
    })
}

/// By how much the integrator's error moves each free coordinate; `None` where motion is chaotic and the error unknown.
fn by_step(objective: &Objective, fit: &FitPoint) -> Option<Vec<f64>> {
    let jacobian = fit.jacobian.as_ref().filter(|_| !objective.description.is_chaotic)?;
    let error = objective.step_error(&fit.u, &fit.bare(), LogSet::Learn);
    let gradient = jacobian.tr_mul(&DVector::from_vec(error));
    let moved = posterior_precision(objective.parameters(), fit, 1.0, 1.0)?.cholesky()?.solve(&gradient);
    Some(moved.iter().map(|by| by.abs()).collect())
}
