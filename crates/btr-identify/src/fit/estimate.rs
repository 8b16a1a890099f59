//! Estimates: the value of each parameter, its interval, and combinations that the logs do not determine.

use super::objective::{LogSet, Objective};
use super::solve::FitPoint;
use crate::residual_model::{FitParameter, ModelDescription};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Standard deviations of a 95 % interval.
const NINETY_FIVE: f64 = 1.96;
/// If priors that are wider by this factor...
const LOOSE: f64 = 3.0;
/// ... widen an interval by this factor, the interval is due to the bounds.
const BY_BOUNDS: f64 = 1.5;
/// Fewest clusters of the residual per parameter for a covariance that is estimated from their differences.
const CLUSTERS: usize = 2;
/// Length of a cluster of a channel, in s, without contact.
const CLUSTER_S: f64 = 1.0;
/// Largest information of the logs along a null direction, as a share of the prior's.
const NULL: f64 = 0.2;
/// Smallest share of a parameter that is named in a null direction.
const NAMED: f64 = 0.3;
/// Smallest ratio of two growths that count as the same.
const SAME: f64 = 0.7;

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
    let (description, parameters) = (&objective.description, objective.parameters());
    let covariance = covariance(parameters, fit, inflation, 1.0);
    let (deviations_within, widening) = (covariance.as_ref().map(roots), covariance.as_ref().map(independent));
    let by_logs = self::covariance(parameters, fit, inflation, LOOSE).as_ref().map(roots);
    let by_clusters = by_clusters(description, fit);
    let by_step = if given { by_step(objective, fit) } else { None };
    let estimate = |(k, &index): (usize, &usize)| {
        let (parameter, u) = (&parameters[index], fit.u[index]);
        let near = 1e-6 * (parameter.bounds.1 - parameter.bounds.0);
        let at_bound = u <= parameter.bounds.0 + near || u >= parameter.bounds.1 - near;
        let deviation = deviations_within.as_ref().map(|d| d[k]).filter(|_| given && !at_bound);
        let by_bounds =
            deviation.zip(by_logs.as_ref()).is_some_and(|(within, by_logs)| by_logs[k] > BY_BOUNDS * within);
        let deviation = deviation.map(|d| by_clusters.as_ref().map_or(d, |by_clusters| d.max(by_clusters[k])));
        let deviation = deviation.map(|d| by_step.as_ref().map_or(d, |by_step| d.hypot(by_step[k])));
        let ends = |d: f64| [-1.0, 1.0].map(|side| parameter.value(parameter.along(u, side * NINETY_FIVE * d)));
        let ci95 = deviation.map(ends).map(|[a, b]| [a.min(b), a.max(b)]);
        let prior_sd = deviation.zip(widening.as_ref()).filter(|_| !by_bounds);
        let prior_sd = prior_sd.map(|(d, widening)| widening[k] * d * parameter.slope(u).abs());
        let (name, unit) = (parameter.name.clone(), parameter.unit.clone());
        (index, Estimate { name, unit, value: parameter.value(u), ci95, at_bound, by_bounds, prior_sd })
    };
    fit.active.iter().enumerate().map(estimate).collect()
}

/// The information of the logs, JᵀJ in units of the priors, so that it can be compared with that of the priors.
pub(super) fn information(parameters: &[FitParameter], fit: &FitPoint) -> Option<DMatrix<f64>> {
    let jacobian = fit.jacobian.as_ref()?;
    let sd = |k: usize| parameters[fit.active[k]].prior_sd();
    let information = jacobian.tr_mul(jacobian);
    Some(information.map_with_location(|i, j, x| x * sd(i) * sd(j)))
}

/// The information of these logs and of earlier ones, in units of what is expected before any log.
pub(super) fn information_of_all(parameters: &[FitParameter], fit: &FitPoint) -> Option<DMatrix<f64>> {
    let jacobian = fit.jacobian.as_ref()?;
    let spread = |k: usize| parameters[fit.active[k]].spread;
    let information = jacobian.tr_mul(jacobian);
    let mut information = information.map_with_location(|i, j, x| x * spread(i) * spread(j));
    for (k, &index) in fit.active.iter().enumerate() {
        information[(k, k)] += parameters[index].known.map_or(0.0, |sd| (spread(k) / sd).powi(2));
    }
    Some(information)
}

/// Precision of the free coordinates, with the residual's variance `inflation` times the noise's and priors widened by
/// the factor `looser`, except those of earlier logs.
fn posterior_precision(
    parameters: &[FitParameter],
    fit: &FitPoint,
    inflation: f64,
    looser: f64,
) -> Option<DMatrix<f64>> {
    let jacobian = fit.jacobian.as_ref()?;
    let mut information = jacobian.tr_mul(jacobian) / inflation;
    for (k, &parameter) in fit.active.iter().enumerate() {
        let FitParameter { spread, known, .. } = parameters[parameter];
        information[(k, k)] += known.unwrap_or(looser * spread).powi(-2);
    }
    Some(information)
}

/// Covariance of the free coordinates.
fn covariance(parameters: &[FitParameter], fit: &FitPoint, inflation: f64, looser: f64) -> Option<DMatrix<f64>> {
    posterior_precision(parameters, fit, inflation, looser)?.try_inverse()
}

/// For each coordinate, the factor on its deviation with which independent coordinates vary in no direction less than
/// together: their covariance minus this one is diagonally dominant.
fn independent(covariance: &DMatrix<f64>) -> Vec<f64> {
    let deviations = roots(covariance);
    let correlation = |i: usize, j: usize| covariance[(i, j)].abs() / (deviations[i] * deviations[j]);
    let all = 0..deviations.len();
    all.clone().map(|i| all.clone().map(|j| correlation(i, j)).sum::<f64>().sqrt()).collect()
}

fn roots(covariance: &DMatrix<f64>) -> Vec<f64> {
    covariance.diagonal().iter().map(|variance| variance.max(0.0).sqrt()).collect()
}

/// The same from the differences between clusters of the residual: the covariance is H⁻¹·M·H⁻¹, with M the sum of the
/// outer products of each cluster's gradient (K.-Y. Liang and S. L. Zeger, "Longitudinal data analysis using
/// generalized linear models", Biometrika 73, 1986). What the model does not describe pulls a parameter one way in one
/// part of the logs and another way in the next. `None` with too few clusters.
fn by_clusters(description: &ModelDescription, fit: &FitPoint) -> Option<Vec<f64>> {
    let jacobian = fit.jacobian.as_ref()?;
    let mut clusters = clusters(description);
    // Rows that are not compared are zero.
    clusters.retain(|rows| fit.residual[rows.clone()].iter().any(|r| *r != 0.0));
    let parameters = fit.active.len();
    if clusters.len() < CLUSTERS * parameters {
        return None;
    }
    let mut scatter = DMatrix::zeros(parameters, parameters);
    for rows in &clusters {
        let residual = DVector::from_column_slice(&fit.residual[rows.clone()]);
        let gradient = jacobian.rows_range(rows.clone()).tr_mul(&residual);
        scatter.ger(1.0, &gradient, &gradient, 1.0);
    }
    // The fit makes the gradients smaller than they would be at the true parameters.
    scatter *= clusters.len() as f64 / (clusters.len() - parameters) as f64;
    let inverse = posterior_precision(&description.parameters, fit, 1.0, 1.0)?.try_inverse()?;
    Some(roots(&(&inverse * scatter * &inverse)))
}

/// The clusters of the training logs' residual, as ranges of its rows: seconds of a channel; with contact whole
/// channels, as the offset that a foot leaves in a channel when it lands at another place is small but persistent.
fn clusters(description: &ModelDescription) -> Vec<Range<usize>> {
    let (mut clusters, mut first) = (Vec::new(), 0);
    for (log, clock_s) in description.logs.iter().zip(&description.clocks_s).filter(|(log, _)| !log.held_out) {
        for channel in &log.channels {
            let rows = first + channel.samples.start..first + channel.samples.end;
            if description.has_contact {
                clusters.push(rows);
                continue;
            }
            let second = |row: &usize| {
                let time_s = clock_s.get(row - rows.start).map_or(0.0, |t| t - clock_s[0]);
                (time_s / CLUSTER_S) as usize
            };
            let all: Vec<usize> = rows.clone().collect();
            let of_seconds = all.chunk_by(|a, b| second(a) == second(b));
            clusters.extend(of_seconds.map(|rows| rows[0]..rows[rows.len() - 1] + 1));
        }
        first += log.rows();
    }
    clusters
}

/// By how much the integrator's error moves each free coordinate; `None` where motion is chaotic and the error unknown.
fn by_step(objective: &Objective, fit: &FitPoint) -> Option<Vec<f64>> {
    let jacobian = fit.jacobian.as_ref().filter(|_| !objective.description.is_chaotic)?;
    let error = objective.step_error(&fit.u, &fit.bare(), LogSet::Learn);
    let gradient = jacobian.tr_mul(&DVector::from_vec(error));
    let moved = posterior_precision(objective.parameters(), fit, 1.0, 1.0)?.cholesky()?.solve(&gradient);
    Some(moved.iter().map(|by| by.abs()).collect())
}

/// A combination of parameters that the logs do not determine: its parts with their shares, largest first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NullDirection {
    /// Names and shares (the largest is 1): moving the values by these shares, in typical deviations, changes less than
    /// the noise hides.
    pub parts: Vec<(String, f64)>,
    /// The same as a sentence, with a remedy.
    pub sentence: String,
}

/// Directions of the free parameters about which these logs and earlier ones have less than `NULL` of the information
/// of what is expected before any log: first the
/// parameters that are dead by themselves, then combinations of the others, each of as few as possible.
pub fn null_directions(parameters: &[FitParameter], fit: &FitPoint) -> Vec<NullDirection> {
    let Some(information) = information_of_all(parameters, fit) else { return Vec::new() };
    let (dead, alive): (Vec<usize>, Vec<usize>) = (0..information.nrows()).partition(|&k| is_dead(information[(k, k)]));
    let alone = dead.iter().map(|&k| vec![(k, 1.0)]);
    let among = null_space(&information.select_rows(&alive).select_columns(&alive));
    let together = among.into_iter().map(|x| alive.iter().copied().zip(x.iter().copied()).collect());
    alone.chain(together).map(|direction: Vec<(usize, f64)>| named(parameters, fit, &direction)).collect()
}

/// Directions with next to no information.
fn null_space(information: &DMatrix<f64>) -> Vec<DVector<f64>> {
    // An empty matrix has no eigenvectors.
    if information.is_empty() {
        return Vec::new();
    }
    let eigen = information.clone().symmetric_eigen();
    let null = (0..information.nrows()).filter(|&k| is_dead(eigen.eigenvalues[k]));
    simplified(null.map(|k| eigen.eigenvectors.column(k).into_owned()).collect())
}

/// Whether an amount of information, in units of the prior's, is next to none.
pub(super) fn is_dead(information: f64) -> bool {
    information < NULL
}

/// Another basis of the same directions with many zeros (Gauss-Jordan elimination with the largest pivots): two pairs
/// of indistinguishable parameters are two directions of two parameters, not two mixtures of four.
fn simplified(mut basis: Vec<DVector<f64>>) -> Vec<DVector<f64>> {
    for done in 0..basis.len() {
        let (mut row, mut column) = (done, 0);
        for (i, x) in basis.iter().enumerate().skip(done) {
            let largest = x.iamax();
            if x[largest].abs() > basis[row][column].abs() {
                (row, column) = (i, largest);
            }
        }
        basis.swap(done, row);
        let pivot = &basis[done] / basis[done][column];
        for other in basis.iter_mut() {
            *other -= &pivot * other[column];
        }
        basis[done] = pivot;
    }
    basis
}

/// A direction, given as positions among the free parameters with their shares.
fn named(parameters: &[FitParameter], fit: &FitPoint, direction: &[(usize, f64)]) -> NullDirection {
    let largest = direction.iter().map(|(_, x)| *x).max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(1.0);
    let part =
        |&(k, x): &(usize, f64)| DirectionPart::new(&parameters[fit.active[k]], fit.u[fit.active[k]], x / largest);
    let parts: Vec<DirectionPart> = direction.iter().map(part).collect();
    let sentence = in_words(&parts);
    let mut shares: Vec<(String, f64)> =
        parts.iter().filter(|part| part.is_named()).map(|part| (part.parameter.name.clone(), part.share)).collect();
    shares.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    NullDirection { parts: shares, sentence }
}

/// A parameter in a direction.
struct DirectionPart<'a> {
    parameter: &'a FitParameter,
    /// How far it moves, in typical deviations; the largest is 1.
    share: f64,
    /// Relative growth of its value.
    growth: f64,
}

impl<'a> DirectionPart<'a> {
    fn new(parameter: &'a FitParameter, u: f64, share: f64) -> Self {
        DirectionPart { parameter, share, growth: share * parameter.spread * parameter.slope(u) / parameter.value(u) }
    }

    fn is_named(&self) -> bool {
        self.share.abs() >= NAMED
    }
}

/// A null direction as a sentence; `parts` are in the model's order.
fn in_words(parts: &[DirectionPart]) -> String {
    let named: Vec<&DirectionPart> = parts.iter().filter(|part| part.is_named()).collect();
    let has_mass = named.iter().any(|part| part.parameter.unit == "kg");
    if let Some(growth) = factor(&named) {
        // A parameter with a wide prior has a small share although it grows by the same factor as the others.
        let scaled: Vec<&DirectionPart> =
            parts.iter().filter(|part| SAME <= part.growth / growth && part.growth / growth <= 1.0 / SAME).collect();
        let remedy =
            if has_mass { "weigh one link, for example, or add a payload of known mass" } else { "fix one of them" };
        let all = list(&scaled);
        return format!(
            "a common factor of {all} changes nothing in these logs, so only their ratios can be determined; {remedy}"
        );
    }
    match named.as_slice() {
        [] => String::new(),
        [one] => format!("{} is dead: these logs contain almost no information about it", one.parameter.name),
        several => {
            let remedy = if has_mass { "add a payload of known mass" } else { "fix one of them" };
            format!("only {} together can be determined; {remedy} or add a log that separates them", list(several))
        }
    }
}

/// "a, b and c".
fn list(parts: &[&DirectionPart]) -> String {
    let names: Vec<&str> = parts.iter().map(|part| part.parameter.name.as_str()).collect();
    match names.as_slice() {
        [several @ .., last] if !several.is_empty() => format!("{} and {last}", several.join(", ")),
        names => names.concat(),
    }
}

/// The relative growth of the values of several parts, where that is about the same for all.
fn factor(parts: &[&DirectionPart]) -> Option<f64> {
    let growth = parts.iter().map(|part| part.growth).max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
    (parts.len() > 1 && parts.iter().all(|part| part.growth / growth >= SAME)).then_some(growth)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn independent_deviations_are_in_no_direction_narrower() {
        let covariance = DMatrix::from_row_slice(3, 3, &[4.0, 1.9, 0.0, 1.9, 1.0, 0.1, 0.0, 0.1, 9.0]);
        let widened = DVector::from_vec(independent(&covariance)).component_mul(&DVector::from_vec(roots(&covariance)));
        let difference = DMatrix::from_diagonal(&widened.component_mul(&widened)) - &covariance;
        assert!(difference.symmetric_eigenvalues().min() > -1e-12);
        assert_eq!(independent(&DMatrix::from_diagonal(&DVector::from_vec(vec![4.0, 1.0]))), [1.0, 1.0]);
    }

    #[test]
    fn two_mixed_pairs_are_separated_into_pairs() {
        let (a, b) = (DVector::from_vec(vec![1.0, 1.0, 0.0, 0.0]), DVector::from_vec(vec![0.0, 0.0, 1.0, -0.5]));
        let basis = simplified(vec![&a * 0.6 + &b * 0.8, &a * -0.8 + &b * 0.6]);
        assert_eq!(basis.len(), 2);
        assert!((&basis[0] - b).norm() < 1e-12 && (&basis[1] - a).norm() < 1e-12, "{basis:?}");
    }
}
