//! Combinations of parameters that the logs do not determine.

use super::precision::information_of_all;
use crate::fit::solve::FitPoint;
use crate::residual_model::FitParameter;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Largest information of the logs along a null direction, as a share of the prior's.
const NULL: f64 = 0.2;
/// Smallest share of a parameter that is named in a null direction.
const NAMED: f64 = 0.3;
/// Smallest ratio of two growths that count as the same.
const SAME: f64 = 0.7;

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
/// of what is expected before any log: first the parameters that are dead by themselves, then combinations of the
/// others, each of as few as possible.
pub fn null_directions(parameters: &[FitParameter], fit: &FitPoint) -> Vec<NullDirection> {
    let Some(information) = information_of_all(parameters, fit) else { return Vec::new() };
    let (dead, alive): (Vec<usize>, Vec<usize>) = (0..information.nrows()).partition(|&k| is_dead(information[(k, k)]));
    // No derivative says how much is known of what is searched.
    let dead: Vec<usize> = dead.into_iter().filter(|&k| !parameters[fit.active[k]].is_searched()).collect();
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
    fn two_mixed_pairs_are_separated_into_pairs() {
        let (a, b) = (DVector::from_vec(vec![1.0, 1.0, 0.0, 0.0]), DVector::from_vec(vec![0.0, 0.0, 1.0, -0.5]));
        let basis = simplified(vec![&a * 0.6 + &b * 0.8, &a * -0.8 + &b * 0.6]);
        assert_eq!(basis.len(), 2);
        assert!((&basis[0] - b).norm() < 1e-12 && (&basis[1] - a).norm() < 1e-12, "{basis:?}");
    }
}
