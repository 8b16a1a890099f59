//! What logs and priors say together: information and covariance of the free coordinates.

use crate::fit::solve::FitPoint;
use crate::residual_model::FitParameter;
use nalgebra::DMatrix;

/// Standard deviations of a 95 % interval.
pub(crate) const NINETY_FIVE: f64 = 1.96;

/// The information of the logs, JᵀJ in units of the priors, so that it can be compared with that of the priors.
pub(in crate::fit) fn information(parameters: &[FitParameter], fit: &FitPoint) -> Option<DMatrix<f64>> {
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
pub(super) fn posterior_precision(
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
pub(super) fn covariance(
    parameters: &[FitParameter],
    fit: &FitPoint,
    inflation: f64,
    looser: f64,
) -> Option<DMatrix<f64>> {
    posterior_precision(parameters, fit, inflation, looser)?.try_inverse()
}

/// For each coordinate, the factor on its deviation with which independent coordinates vary in no direction less than
/// together: their covariance minus this one is diagonally dominant.
pub(super) fn independent(covariance: &DMatrix<f64>) -> Vec<f64> {
    let deviations = roots(covariance);
    let correlation = |i: usize, j: usize| covariance[(i, j)].abs() / (deviations[i] * deviations[j]);
    let all = 0..deviations.len();
    all.clone().map(|i| all.clone().map(|j| correlation(i, j)).sum::<f64>().sqrt()).collect()
}

pub(super) fn roots(covariance: &DMatrix<f64>) -> Vec<f64> {
    covariance.diagonal().iter().map(|variance| variance.max(0.0).sqrt()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    #[test]
    fn independent_deviations_are_in_no_direction_narrower() {
        let covariance = DMatrix::from_row_slice(3, 3, &[4.0, 1.9, 0.0, 1.9, 1.0, 0.1, 0.0, 0.1, 9.0]);
        let widened = DVector::from_vec(independent(&covariance)).component_mul(&DVector::from_vec(roots(&covariance)));
        let difference = DMatrix::from_diagonal(&widened.component_mul(&widened)) - &covariance;
        assert!(difference.symmetric_eigenvalues().min() > -1e-12);
        assert_eq!(independent(&DMatrix::from_diagonal(&DVector::from_vec(vec![4.0, 1.0]))), [1.0, 1.0]);
    }
}
