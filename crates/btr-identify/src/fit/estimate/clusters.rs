//! Uncertainty from the differences between parts of the logs, which what the model does not describe widens.

use super::precision::{NINETY_FIVE, posterior_precision, roots};
use crate::fit::solve::FitPoint;
use crate::residual_model::ModelDescription;
use btr_core::signal::student::student_95;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Fewest clusters of the residual per parameter for a covariance that is estimated from their differences.
const CLUSTERS: usize = 2;
/// Length of a cluster of a channel, in s, without contact.
const CLUSTER_S: f64 = 1.0;

/// Standard deviation of each free coordinate from the differences between clusters of the residual: the covariance is
/// H⁻¹·M·H⁻¹, with M the sum of the outer products of each cluster's gradient (K.-Y. Liang and S. L. Zeger,
/// "Longitudinal data analysis using generalized linear models", Biometrika 73, 1986). What the model does not describe
/// pulls a parameter one way in one part of the logs and another way in the next. `None` with too few clusters.
pub(super) fn by_clusters(description: &ModelDescription, fit: &FitPoint) -> Option<Vec<f64>> {
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

/// The same with each training log as one cluster, where logs are draws of what differs from run to run. The sum of
/// their gradients is zero at the fit, so that L logs have L - 1 degrees of freedom: the deviation is widened from a
/// normal to Student's 95 % interval. `None` with fewer than three logs.
pub(super) fn between_logs(description: &ModelDescription, fit: &FitPoint) -> Option<Vec<f64>> {
    let jacobian = fit.jacobian.as_ref().filter(|_| description.has_runs)?;
    let logs = description.logs.iter().filter(|log| !log.held_out);
    let (count, parameters) = (logs.clone().count(), fit.active.len());
    let wider = student_95(count)? / NINETY_FIVE;
    let (mut scatter, mut first) = (DMatrix::zeros(parameters, parameters), 0);
    for log in logs {
        let rows = first..first + log.rows();
        first = rows.end;
        let residual = DVector::from_column_slice(&fit.residual[rows.clone()]);
        let gradient = jacobian.rows_range(rows).tr_mul(&residual);
        scatter.ger(1.0, &gradient, &gradient, 1.0);
    }
    scatter *= count as f64 / (count - 1) as f64;
    let inverse = posterior_precision(&description.parameters, fit, 1.0, 1.0)?.try_inverse()?;
    Some(roots(&(&inverse * scatter * &inverse)).into_iter().map(|deviation| wider * deviation).collect())
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
