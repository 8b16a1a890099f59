//! Directions of joints: one that counts the other way round than the model says leaves a large error at that joint.

use crate::identification::catalogue::parameters::DIRECTION;
use crate::identification::problem::IdentificationProblem;
use btr_core::signal::stats::mean;
use btr_identify::fit::NOISE;

/// Coordinate of the other direction.
const REVERSED: f64 = 1.0;
/// Least error of the joint, in multiples of what counts as noise: a joint that is reversed does not follow the model.
const LEAST: f64 = 5.0;

impl IdentificationProblem {
    /// The coordinate of the other direction, with the squares that are left at the joint, where these are many; none
    /// where few are left. `None` for other parameters.
    pub(super) fn directions(&self, parameter: usize, residuals: &[(usize, &[f64])]) -> Option<Vec<(f64, f64)>> {
        let (_, joint) = self.parameters[parameter].name.split_once('@').filter(|(name, _)| *name == DIRECTION)?;
        let (_, link) = self.model.robot.movable().find(|(_, link)| link.joint.name == joint)?;
        let compared = link.joint.compared();
        let of_log = |(log, residual): &(usize, &[f64])| -> Vec<f64> {
            let channel = self.logs[*log].channels.iter().find(|channel| channel.name == compared);
            let rows = channel.and_then(|channel| residual.get(channel.samples.clone())).unwrap_or_default();
            rows.iter().filter(|x| x.is_finite()).map(|x| x * x).collect()
        };
        let squares: Vec<f64> = residuals.iter().flat_map(of_log).collect();
        let is_large = !squares.is_empty() && mean(&squares) > (LEAST * NOISE).powi(2);
        Some(if is_large { vec![(REVERSED, squares.iter().sum())] } else { Vec::new() })
    }
}
