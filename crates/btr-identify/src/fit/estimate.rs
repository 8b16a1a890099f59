//! Estimates: the value of each parameter, its interval, and combinations that the logs do not determine.

use super::objective::{LogSet, Objective};
use super::residual_vector::channels;
use super::solve::FitPoint;
use crate::residual_model::{FitParameter, ModelDescription};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Standard deviations of a 95 % interval.
const NINETY_FIVE: f64 = 1.96;
/// With priors this much looser than they are...
const LOOSE: f64 = 3.0;
/// ... an interval that is wider by this factor was given by the bounds.
const BY_BOUNDS: f64 = 1.5;
/// With so many channels for each number, channels bear out how sure it is.
const CHANNELS: usize = 2;
/// A direction in which the logs tell less than this share of what the priors alone say is a null direction.
const NULL: f64 = 0.2;
/// Parts of a null direction smaller than this are not named.
const NAMED: f64 = 0.3;
/// Growths of which the least is this share of the largest are about the same.
const SAME: f64 = 0.7;

/// A fitted number.
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
    /// Whether the interval is what its bounds and those of others leave rather than what the logs tell.
    pub by_bounds: bool,
}

/// Values and intervals of the free parameters of a fit, with their indices. `inflation` is by how much the residual's variance and
/// memory widen the intervals; `trusted` whether there are to be any. What the time step does to a number widens its interval,
/// too; with contact they are at least as wide as channels differ in what they say.
pub fn estimates(objective: &Objective, fit: &FitPoint, inflation: f64, trusted: bool) -> Vec<(usize, Estimate)> {
    let (description, parameters) = (&objective.description, objective.parameters());
    let deviations_within = deviations(parameters, fit, inflation, 1.0);
    let by_logs = deviations(parameters, fit, inflation, LOOSE);
    let by_channels = if description.has_contact { by_channels(description, fit) } else { None };
    let by_step = if trusted { by_step(objective, fit) } else { None };
    let estimate = |(k, &index): (usize, &usize)| {
        let (parameter, u) = (&parameters[index], fit.u[index]);
        let near = 1e-6 * (parameter.bounds.1 - parameter.bounds.0);
        let at_bound = u <= parameter.bounds.0 + near || u >= parameter.bounds.1 - near;
        let deviation = deviations_within.as_ref().map(|d| d[k]).filter(|_| trusted && !at_bound);
        let by_bounds =
            deviation.zip(by_logs.as_ref()).is_some_and(|(within, by_logs)| by_logs[k] > BY_BOUNDS * within);
        let deviation = deviation.map(|d| by_channels.as_ref().map_or(d, |by_channels| d.max(by_channels[k])));
        let deviation = deviation.map(|d| by_step.as_ref().map_or(d, |by_step| d.hypot(by_step[k])));
        let ends = |d: f64| [-1.0, 1.0].map(|side| parameter.value(parameter.along(u, side * NINETY_FIVE * d)));
        let ci95 = deviation.map(ends).map(|[a, b]| [a.min(b), a.max(b)]);
        let (name, unit) = (parameter.name.clone(), parameter.unit.clone());
        (index, Estimate { name, unit, value: parameter.value(u), ci95, at_bound, by_bounds })
    };
    fit.active.iter().enumerate().map(estimate).collect()
}

/// The information of the logs, JᵀJ in units of the priors, so that it can be compared with that of the priors.
pub(super) fn information(parameters: &[FitParameter], fit: &FitPoint) -> Option<DMatrix<f64>> {
    let jacobian = fit.jacobian.as_ref()?;
    let spread = |k: usize| parameters[fit.active[k]].spread;
    let information = jacobian.tr_mul(jacobian);
    Some(information.map_with_location(|i, j, x| x * spread(i) * spread(j)))
}

/// Precision of the free coordinates, with the residual's variance `inflation` times the noise's and priors `looser`
/// times as wide as they are.
fn posterior_precision(
    parameters: &[FitParameter],
    fit: &FitPoint,
    inflation: f64,
    looser: f64,
) -> Option<DMatrix<f64>> {
    let jacobian = fit.jacobian.as_ref()?;
    let mut information = jacobian.tr_mul(jacobian) / inflation;
    for (k, &parameter) in fit.active.iter().enumerate() {
        information[(k, k)] += (looser * parameters[parameter].spread).powi(-2);
    }
    Some(information)
}

/// Standard deviation of each free coordinate.
fn deviations(parameters: &[FitParameter], fit: &FitPoint, inflation: f64, looser: f64) -> Option<Vec<f64>> {
    posterior_precision(parameters, fit, inflation, looser)?.try_inverse().map(|covariance| roots(&covariance))
}

fn roots(covariance: &DMatrix<f64>) -> Vec<f64> {
    covariance.diagonal().iter().map(|variance| variance.max(0.0).sqrt()).collect()
}

/// The same as the channels of the logs by themselves bear it out: what a foot that landed elsewhere leaves in a
/// channel is small and lasts, so that no memory of the residual shows it. The covariance is H⁻¹·M·H⁻¹, with M the sum
/// of the squares of what each channel's residual says. None where channels are too few to tell.
fn by_channels(description: &ModelDescription, fit: &FitPoint) -> Option<Vec<f64>> {
    let jacobian = fit.jacobian.as_ref()?;
    let channels = channels(description.logs.iter().filter(|log| !log.held_out));
    let numbers = fit.active.len();
    if channels.len() < CHANNELS * numbers {
        return None;
    }
    let mut said = DMatrix::zeros(numbers, numbers);
    for rows in &channels {
        let residual = DVector::from_column_slice(&fit.residual[rows.clone()]);
        let says = jacobian.rows_range(rows.clone()).tr_mul(&residual);
        said.ger(1.0, &says, &says, 1.0);
    }
    // A fit bends what channels say towards nothing.
    said *= channels.len() as f64 / (channels.len() - numbers) as f64;
    let inverse = posterior_precision(&description.parameters, fit, 1.0, 1.0)?.try_inverse()?;
    Some(roots(&(&inverse * said * &inverse)))
}

/// By how much the integrator's error moves each free coordinate; nothing is known of it where motion is chaotic.
fn by_step(objective: &Objective, fit: &FitPoint) -> Option<Vec<f64>> {
    let jacobian = fit.jacobian.as_ref().filter(|_| !objective.description.is_chaotic)?;
    let error = objective.step_error(&fit.u, &fit.bare(), LogSet::Learn);
    let says = jacobian.tr_mul(&DVector::from_vec(error));
    let moved = posterior_precision(objective.parameters(), fit, 1.0, 1.0)?.cholesky()?.solve(&says);
    Some(moved.iter().map(|by| by.abs()).collect())
}

/// A combination of parameters that the logs do not determine: its parts with their shares, largest first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NullDirection {
    /// Names and shares (the largest is 1); values that move along these shares, in typical deviations, change nothing that the
    /// noise would not hide.
    pub parts: Vec<(String, f64)>,
    /// A sentence.
    pub sentence: String,
}

/// Directions of the free parameters about which the logs have less than `NULL` of the priors' information: first the
/// parameters that are dead by themselves, then combinations of the others, each of as few as possible.
pub fn null_directions(parameters: &[FitParameter], fit: &FitPoint) -> Vec<NullDirection> {
    let Some(information) = information(parameters, fit) else { return Vec::new() };
    let (dead, alive): (Vec<usize>, Vec<usize>) = (0..information.nrows()).partition(|&k| is_dead(information[(k, k)]));
    let alone = dead.iter().map(|&k| vec![(k, 1.0)]);
    let among = null_space(&information.select_rows(&alive).select_columns(&alive));
    let together = among.into_iter().map(|x| alive.iter().copied().zip(x.iter().copied()).collect());
    alone.chain(together).map(|direction: Vec<(usize, f64)>| named(parameters, fit, &direction)).collect()
}

/// Directions of which next to nothing is told.
fn null_space(told: &DMatrix<f64>) -> Vec<DVector<f64>> {
    // There are no eigenvectors of nothing.
    if told.is_empty() {
        return Vec::new();
    }
    let eigen = told.clone().symmetric_eigen();
    let null = (0..told.nrows()).filter(|&k| is_dead(eigen.eigenvalues[k]));
    simplified(null.map(|k| eigen.eigenvectors.column(k).into_owned()).collect())
}

/// Whether so much information, in units of the prior, is next to none.
pub(super) fn is_dead(told: f64) -> bool {
    told < NULL
}

/// Another basis of the same directions with many zeros (Gauss and Jordan's elimination with the largest pivots): two pairs
/// that cannot be told apart are two directions of two, not two mixtures of four.
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
    /// By which share of itself its value grows.
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

/// What a direction, in the model's order, means.
fn in_words(parts: &[DirectionPart]) -> String {
    let named: Vec<&DirectionPart> = parts.iter().filter(|part| part.is_named()).collect();
    let has_mass = named.iter().any(|part| part.parameter.unit == "kg");
    if let Some(growth) = factor(&named) {
        // What may be of any size moves by a small share of what it may be, though it grows like the others.
        let scaled: Vec<&DirectionPart> =
            parts.iter().filter(|part| SAME <= part.growth / growth && part.growth / growth <= 1.0 / SAME).collect();
        let remedy = if has_mass { "weigh one link, say, or add a payload of known mass" } else { "fix one of them" };
        let all = list(&scaled);
        return format!(
            "a common factor of {all} changes nothing in these logs, so only their ratios can be told; {remedy}"
        );
    }
    match named.as_slice() {
        [] => String::new(),
        [one] => format!("{} is dead: these logs say next to nothing about it", one.parameter.name),
        several => {
            let remedy = if has_mass { "add a payload of known mass" } else { "fix one of them" };
            format!("only {} together can be told; {remedy} or add a log that separates them", list(several))
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

/// By which share of themselves the values of several parts grow, where that is about the same for all.
fn factor(parts: &[&DirectionPart]) -> Option<f64> {
    let growth = parts.iter().map(|part| part.growth).max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
    (parts.len() > 1 && parts.iter().all(|part| part.growth / growth >= SAME)).then_some(growth)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_pairs_that_were_mixed_are_two_pairs_again() {
        let (a, b) = (DVector::from_vec(vec![1.0, 1.0, 0.0, 0.0]), DVector::from_vec(vec![0.0, 0.0, 1.0, -0.5]));
        let basis = simplified(vec![&a * 0.6 + &b * 0.8, &a * -0.8 + &b * 0.6]);
        assert_eq!(basis.len(), 2);
        assert!((&basis[0] - b).norm() < 1e-12 && (&basis[1] - a).norm() < 1e-12, "{basis:?}");
    }
}
