//! What a fit says about each number: its value, how sure it is, and what nothing can be said about.

use super::solve::Fit;
use crate::family::{Family, Knob};
use nalgebra::DMatrix;
use serde::Serialize;

/// Standard deviations of a 95 % interval.
const NINETY_FIVE: f64 = 1.96;
/// A direction in which the logs tell less than this share of what the priors alone say is a null direction.
const NULL: f64 = 0.2;
/// Parts of a null direction smaller than this are not named.
const NAMED: f64 = 0.3;

/// A fitted number.
#[derive(Clone, Debug, PartialEq, Serialize)]
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
}

/// Values and intervals of the free knobs of a fit, with their indices. `inflation` is by how much the residual's variance and
/// memory widen the intervals; `trusted` whether there are to be any.
pub fn estimates(family: &dyn Family, fit: &Fit, inflation: f64, trusted: bool) -> Vec<(usize, Estimate)> {
    let knobs = family.knobs();
    let deviations = deviations(knobs, fit, inflation);
    let estimate = |(k, &index): (usize, &usize)| {
        let (knob, u) = (&knobs[index], fit.u[index]);
        let near = 1e-6 * (knob.bounds.1 - knob.bounds.0);
        let at_bound = u <= knob.bounds.0 + near || u >= knob.bounds.1 - near;
        let deviation = deviations.as_ref().map(|d| d[k]).filter(|_| trusted && !at_bound);
        let ends = |d: f64| [-1.0, 1.0].map(|side| knob.value(knob.clamp(u + side * NINETY_FIVE * d)));
        let ci95 = deviation.map(ends).map(|[a, b]| [a.min(b), a.max(b)]);
        let (name, unit) = (knob.name.clone(), knob.unit.clone());
        (index, Estimate { name, unit, value: knob.value(u), ci95, at_bound })
    };
    fit.active.iter().enumerate().map(estimate).collect()
}

/// JᵀJ, and the same with the priors.
fn information(knobs: &[Knob], fit: &Fit) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let jacobian = fit.jacobian.as_ref()?;
    let told = jacobian.tr_mul(jacobian);
    let mut all = told.clone();
    for (k, &knob) in fit.active.iter().enumerate() {
        all[(k, k)] += knobs[knob].spread.powi(-2);
    }
    Some((told, all))
}

/// Standard deviation of each free coordinate.
fn deviations(knobs: &[Knob], fit: &Fit, inflation: f64) -> Option<Vec<f64>> {
    let jacobian = fit.jacobian.as_ref()?;
    let mut information = jacobian.tr_mul(jacobian) / inflation;
    for (k, &knob) in fit.active.iter().enumerate() {
        information[(k, k)] += knobs[knob].spread.powi(-2);
    }
    let covariance = information.try_inverse()?;
    Some((0..fit.active.len()).map(|k| covariance[(k, k)].max(0.0).sqrt()).collect())
}

/// A combination of numbers that the logs do not tell: its parts with their shares, largest first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NullDirection {
    /// Names and shares (the largest is 1); values that move along these shares, in typical deviations, change nothing that the
    /// noise would not hide.
    pub parts: Vec<(String, f64)>,
    /// A sentence.
    pub sentence: String,
}

/// Directions in the free knobs of a fit about which its logs say less than `NULL` of what the priors say.
pub fn null_directions(family: &dyn Family, fit: &Fit) -> Vec<NullDirection> {
    let knobs = family.knobs();
    let Some((told, _)) = information(knobs, fit) else { return Vec::new() };
    // In units of the priors, what the logs tell is comparable with what is believed anyway.
    let spread: Vec<f64> = fit.active.iter().map(|&knob| knobs[knob].spread).collect();
    let scaled = DMatrix::from_fn(told.nrows(), told.ncols(), |i, j| told[(i, j)] * spread[i] * spread[j]);
    let eigen = scaled.symmetric_eigen();
    let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).filter(|&k| eigen.eigenvalues[k] < NULL).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    order.iter().map(|&k| named(knobs, fit, eigen.eigenvectors.column(k).as_slice())).collect()
}

fn named(knobs: &[Knob], fit: &Fit, direction: &[f64]) -> NullDirection {
    let largest = direction.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(1.0);
    let mut parts: Vec<(String, f64)> = fit
        .active
        .iter()
        .zip(direction)
        .map(|(&knob, x)| (knobs[knob].name.clone(), x / largest))
        .filter(|(_, share)| share.abs() >= NAMED)
        .collect();
    parts.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    let names: Vec<&str> = parts.iter().map(|(name, _)| name.as_str()).collect();
    let sentence = match names.as_slice() {
        [] => String::new(),
        [one] => format!("{one} is dead: these logs say nothing about it"),
        [several @ .., last] => {
            format!(
                "only together can {} and {last} be told: fix one of them, or add a log that separates them",
                several.join(", ")
            )
        }
    };
    NullDirection { parts, sentence }
}
