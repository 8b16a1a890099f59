//! Identifiability: what logs can determine about the free parameters before anything is fitted. G. H. Golub and C. F.
//! Van Loan's singular values of the scaled Jacobian ("Matrix Computations", 1983), at the model's current values.

use super::null_directions::{NullDirection, is_dead, null_directions};
use super::precision::{information, information_of_all};
use crate::fit::objective::{LogSet, Objective};
use crate::fit::solve::FitPoint;
use btr_core::world::WorldError;
use nalgebra::DMatrix;
use serde::Serialize;

/// What the logs determine about one free parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sensitivity {
    /// Its name.
    pub name: String,
    /// SI unit as text.
    pub unit: String,
    /// Its current value.
    pub value: f64,
    /// Root mean square change of the measured channels when it moves by one standard deviation of its prior, in noise
    /// floors.
    pub sensitivity: f64,
    /// Posterior over prior standard deviation, with all other parameters free as well: 1 means that the logs contain
    /// no information. Holds for white noise and a complete model.
    pub uncertainty_left: f64,
    /// Whether its effect on the measured channels is below the noise, here and in earlier logs.
    pub dead: bool,
}

/// What the logs determine about all free parameters.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Identifiable {
    /// Each free parameter.
    pub parameters: Vec<Sensitivity>,
    /// Number of independent combinations of them that the logs determine.
    pub rank: usize,
    /// Condition number: the best over the worst determined combination, in units of the priors; none where a
    /// combination is not determined at all.
    pub condition_number: Option<f64>,
    /// Combinations that these logs do not determine.
    pub null_directions: Vec<NullDirection>,
}

/// What the training logs determine about the free parameters. `None` without free parameters, or where a parameter
/// has no finite effect.
///
/// # Errors
/// The reason why the model cannot be simulated at its current values.
pub fn identifiable(objective: &Objective) -> Result<Option<Identifiable>, WorldError> {
    let (free, parameters) = (&objective.description.free, objective.parameters());
    if free.is_empty() {
        return Ok(None);
    }
    let mut fit = FitPoint::at(objective, free.clone(), vec![0.0; parameters.len()], &[])?;
    fit.differentiate_widely(objective);
    let Some(information) = information(parameters, &fit) else { return Ok(None) };
    let Some(of_all) = information_of_all(parameters, &fit) else { return Ok(None) };
    let posterior = DMatrix::identity(information.nrows(), information.nrows()) + &information;
    let Some(left) = posterior.cholesky().map(|factors| factors.inverse()) else { return Ok(None) };
    let samples = objective.samples(LogSet::Learn).max(1) as f64;
    let sensitivity = |(k, &index): (usize, &usize)| Sensitivity {
        name: parameters[index].name.clone(),
        unit: parameters[index].unit.clone(),
        value: parameters[index].origin,
        sensitivity: (information[(k, k)] / samples).sqrt(),
        uncertainty_left: left[(k, k)].max(0.0).sqrt(),
        dead: is_dead(of_all[(k, k)]),
    };
    let null_directions = null_directions(parameters, &fit);
    let parameters = fit.active.iter().enumerate().map(sensitivity).collect();
    let squares = information.symmetric_eigenvalues();
    let (most, least) = (squares.max(), squares.min());
    // Below this the smallest is rounding error.
    let is_determined = least > f64::EPSILON * squares.len() as f64 * most;
    Ok(Some(Identifiable {
        parameters,
        rank: fit.active.len() - null_directions.len(),
        condition_number: is_determined.then(|| (most / least).sqrt()),
        null_directions,
    }))
}
