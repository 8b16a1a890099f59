//! Amplitudes that do nothing where they stand, as a static friction below Coulomb's: no slope leads away from there.

use super::derivative::columns;
use super::objective::{LogSet, Objective};
use super::residual_vector::chi;
use super::solve::{FitPoint, SearchBudget};

/// Sizes that are tried, in typical deviations: from the first one on, each larger by the factor.
const LEAST: f64 = 0.05;
const FACTOR: f64 = 1.5;
const SIZES: i32 = 18;
/// How the other parameters follow.
const FOLLOWING: SearchBudget = SearchBudget { jacobians: 1, steps: 6 };

impl FitPoint {
    /// While something is left to explain, tries other sizes of amplitudes that have no slope.
    pub(crate) fn leave_dead_sizes(&mut self, objective: &Objective) {
        if chi(self.squares(), objective.samples(LogSet::Learn)) <= objective.noise_bound() {
            return;
        }
        for parameter in self.dead(objective) {
            let sized = |k: i32| {
                let mut u = self.u.clone();
                u[parameter] = objective.parameters()[parameter].clamp(LEAST * FACTOR.powi(k));
                u
            };
            let tried = self.at_points(objective, (0..SIZES).map(sized).collect());
            let best = tried.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
            if let Some(mut best) = best.filter(|best| best.cost < self.cost) {
                best.solve(objective, FOLLOWING);
                *self = best;
            }
        }
    }

    /// The active amplitudes that the residual does not depend on near their values.
    fn dead(&self, objective: &Objective) -> Vec<usize> {
        let is_amplitude = |k: &usize| objective.parameters()[*k].amplitude;
        let amplitudes: Vec<usize> = self.active.iter().copied().filter(is_amplitude).collect();
        let columns = columns(objective, &self.u, &amplitudes, &self.residual, &self.step_error);
        let does_nothing = |column: &[f64]| column.iter().all(|change| *change == 0.0);
        amplitudes.into_iter().zip(columns).filter(|(_, column)| does_nothing(column)).map(|(k, _)| k).collect()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::fit::fitted;
    use crate::fit::objective::Objective;
    use crate::fixture::{SyntheticModel, parameter};
    use crate::residual_model::{FitParameter, Parametrisation};

    /// What friction shows: at rest it counts from Coulomb's on, as Stribeck's does, so that next to 0 it does nothing.
    fn shown(coulomb: f64, at_rest: f64) -> Vec<f64> {
        let above = at_rest.max(coulomb) - coulomb;
        (0..200).map(|row| 40.0 * (coulomb + above * (-0.03 * f64::from(row)).exp())).collect()
    }

    #[test]
    fn a_size_without_a_slope_is_left() {
        let size = |origin: f64| FitParameter {
            amplitude: origin == 0.0,
            bounds: (-origin / 0.1, 50.0),
            ..parameter(Parametrisation::Linear, origin, 0.1)
        };
        let model = SyntheticModel::new(vec![size(1.1), size(0.0)], 200, |values| {
            let measured = shown(1.1, 1.6);
            measured.iter().zip(shown(values[0], values[1])).map(|(a, b)| a - b).collect()
        });
        let found = fitted(&mut Objective::new(&model), &|_| {}).unwrap();
        assert!((found.parameters[1].value - 1.6).abs() < 0.01, "{:?}", found.parameters);
    }
}
