//! Values to which no derivative leads: what the error says of them.

mod commands;
mod directions;

use super::problem::IdentificationProblem;

impl IdentificationProblem {
    /// See [`ResidualModel::sizes`](btr_identify::residual_model::ResidualModel::sizes).
    pub(super) fn searched_sizes(&self, parameter: usize, residuals: &[(usize, &[f64])]) -> Vec<(f64, f64)> {
        self.directions(parameter, residuals).unwrap_or_else(|| self.command_sizes(parameter, residuals))
    }
}
