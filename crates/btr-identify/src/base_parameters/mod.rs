//! Base parameters: the combinations of a linear model's parameters that its logs can tell, with values and standard
//! deviations.
//!
//! The torques that a motion requires are linear in masses, first moments, inertias and friction, but many of these
//! never act alone. M. Gautier, "Numerical calculation of the base inertial parameters of robots", Journal of Robotic
//! Systems 8(4), 1991: parameters without any effect are left out, and a QR factorisation with pivoting chooses
//! independent ones, to which it adds what the others contribute.

mod combination;
mod linear;
mod nearest;
mod regroup;

pub use combination::{Combination, CombinationPart};
pub use linear::{LinearModel, LinearParameter};
pub use nearest::{Family, Membership, Nearest, nearest};
pub use regroup::{Regrouping, regroup};

use crate::fit::residual_vector::chi;
use crate::fit::{
    ComparisonMeasure, Estimate, FitPoint, Intervals, LogSet, Objective, RelativeError, estimates, relative_errors,
    squares, withheld,
};
use crate::residual_model::FitParameter;
use btr_core::world::WorldError;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// The base parameters of a linear model.
#[derive(Clone, Debug, Serialize)]
pub struct BaseParameters {
    /// The combinations, in the order of the parameters that lead them.
    pub combinations: Vec<Combination>,
    /// Names of parameters without any effect in the training logs: no combination contains them.
    pub not_identifiable: Vec<String>,
    /// Error on training logs, in multiples of the noise floor.
    pub train: f64,
    /// Error on held-out logs, in multiples of the noise floor.
    pub held_out: Option<f64>,
    /// Why there are no standard deviations, if there are none.
    pub withheld: Option<String>,
    /// What is left of each channel.
    pub remaining: Vec<RelativeError>,
    /// The combinations as functions of all parameters: one row per combination.
    #[serde(skip)]
    pub map: DMatrix<f64>,
    /// Makes errors of the combinations independent numbers with a standard deviation of 1, for residuals as large and
    /// as correlated as those that are left.
    #[serde(skip)]
    pub whitening: DMatrix<f64>,
}

/// Estimates the base parameters by least squares on the training logs. `groups` has a number for each parameter:
/// parameters of a lower group lead combinations, those of a higher one are added to them where they do not act alone.
/// Standard deviations are those of [`estimates`], and withheld in the same way.
///
/// # Errors
/// The reason of the first failing evaluation.
pub fn base_parameters(model: &LinearModel, groups: &[usize]) -> Result<BaseParameters, WorldError> {
    let objective = Objective::new(model);
    let origin = vec![0.0; groups.len()];
    let residual = objective.residual(&origin, LogSet::Learn)?;
    let columns = columns(&objective, &residual)?;
    let regrouping = regroup(&columns, groups);
    let chosen = columns.select_columns(&regrouping.base);
    let fit = solved(&objective, &regrouping.base, &chosen, &residual)?;
    let measure = ComparisonMeasure::of(&objective, &fit);
    let train = chi(fit.squares(), objective.samples(LogSet::Learn));
    let held_out = held_out(&objective, &fit)?;
    let withheld = withheld(&objective, train, held_out).map(|(_, why)| why);
    let given = if withheld.is_none() { Intervals::Given } else { Intervals::Withheld };
    let estimates = estimates(&objective, &fit, measure.inflation(), given);
    let parameters = objective.parameters();
    let map = in_units(&regrouping.map(parameters.len()), parameters, &regrouping.base);
    let combinations =
        estimates.iter().enumerate().map(|(row, estimate)| combination(parameters, &map, row, estimate)).collect();
    let per_unit = |i: usize| parameters[regrouping.base[i]].size.recip() / measure.inflation().sqrt();
    let whitening = chosen.qr().r().map_with_location(|_, j, x| x * per_unit(j));
    Ok(BaseParameters {
        combinations,
        not_identifiable: regrouping.without_effect.iter().map(|&k| parameters[k].name.clone()).collect(),
        remaining: relative_errors(&objective, &fit.u),
        whitening,
        train,
        held_out,
        withheld,
        map,
    })
}

impl BaseParameters {
    /// The estimates of the combinations.
    pub fn estimates(&self) -> DVector<f64> {
        DVector::from_iterator(self.combinations.len(), self.combinations.iter().map(|c| c.value))
    }
}

/// The errors of a linear model on training and held-out logs with other values of its parameters, in multiples of the
/// noise floor.
///
/// # Errors
/// The reason of the first failing evaluation.
pub fn errors_at(model: &LinearModel, values: &[f64]) -> Result<(f64, Option<f64>), WorldError> {
    let objective = Objective::new(model);
    let u = objective.parameters().iter().zip(values).map(|(parameter, value)| parameter.coordinate(*value)).collect();
    let fit = FitPoint::at(&objective, Vec::new(), u, &[])?;
    Ok((chi(fit.squares(), objective.samples(LogSet::Learn)), held_out(&objective, &fit)?))
}

/// How the predictions on the training logs change with each coordinate.
fn columns(objective: &Objective, residual: &[f64]) -> Result<DMatrix<f64>, WorldError> {
    let count = objective.parameters().len();
    let unit = |k: usize| (0..count).map(|i| f64::from(u8::from(i == k))).collect();
    let moved = objective.residuals(&(0..count).map(unit).collect::<Vec<_>>(), LogSet::Learn);
    let mut columns = DMatrix::zeros(residual.len(), count);
    for (mut column, moved) in columns.column_iter_mut().zip(moved) {
        let pairs = residual.iter().zip(moved?);
        column.iter_mut().zip(pairs).for_each(|(x, (before, after))| *x = before - after);
    }
    Ok(columns)
}

/// The least squares along the chosen columns, with their slopes.
fn solved(
    objective: &Objective,
    base: &[usize],
    chosen: &DMatrix<f64>,
    residual: &[f64],
) -> Result<FitPoint, WorldError> {
    let mut u = vec![0.0; objective.parameters().len()];
    let qr = chosen.clone().qr();
    let mut rotated = DVector::from_column_slice(residual);
    qr.q_tr_mul(&mut rotated);
    let best = qr.r().solve_upper_triangular(&rotated.rows(0, base.len()).into_owned()).unwrap_or_default();
    base.iter().zip(best.iter()).for_each(|(&k, by)| u[k] = *by);
    let mut fit = FitPoint::at(objective, base.to_vec(), u, &[])?;
    fit.jacobian = Some(-chosen);
    Ok(fit)
}

/// The error on held-out logs, if there are any.
fn held_out(objective: &Objective, fit: &FitPoint) -> Result<Option<f64>, WorldError> {
    if objective.logs(LogSet::HeldOut).is_empty() {
        return Ok(None);
    }
    let residual = objective.residual(&fit.u, LogSet::HeldOut)?;
    Ok(Some(chi(squares(&residual), objective.samples(LogSet::HeldOut))))
}

/// A map of coordinates as one of values: what one unit of a parameter adds to a combination, in the unit of the
/// parameter that leads it.
fn in_units(map: &DMatrix<f64>, parameters: &[FitParameter], base: &[usize]) -> DMatrix<f64> {
    map.map_with_location(|row, k, x| x * parameters[base[row]].size / parameters[k].size)
}

fn combination(parameters: &[FitParameter], map: &DMatrix<f64>, row: usize, lead: &(usize, Estimate)) -> Combination {
    let (leading, estimate) = lead;
    // The estimate is that of the leading parameter while the others keep their values.
    let added = |&k: &usize| k != *leading && map[(row, k)] != 0.0;
    let others: Vec<usize> = (0..parameters.len()).filter(added).collect();
    let rest: f64 = others.iter().map(|&k| map[(row, k)] * parameters[k].origin).sum();
    let part = |k: usize| CombinationPart { parameter: parameters[k].name.clone(), coefficient: map[(row, k)] };
    let parts = std::iter::once(*leading).chain(others).map(part).collect();
    let unit = estimate.unit.clone();
    let sd = estimate.ci95.map(|[low, high]| (high - low) / (2.0 * crate::fit::NINETY_FIVE));
    Combination::new(parts, unit, parameters[*leading].origin + rest, estimate.value + rest, sd)
}

#[cfg(test)]
mod tests;
