//! Amplitudes that do nothing where they stand, as a static friction below Coulomb's: no slope leads away from there.

use super::derivative::columns;
use super::objective::{LogSet, Objective};
use super::residual_vector::{chi, corrected};
use super::solve::{FitPoint, SearchBudget, cost};

/// Sizes that are tried, in typical deviations: from the first one on, each larger by the factor.
const LEAST: f64 = 0.05;
const FACTOR: f64 = 1.5;
const SIZES: i32 = 18;
/// How the other parameters follow.
const FOLLOWING: SearchBudget = SearchBudget { jacobians: 1, steps: 6 };

/// A size of an amplitude, as a coordinate, and the cost with it.
#[derive(Clone, Copy)]
struct Size {
    parameter: usize,
    u: f64,
    cost: f64,
}

impl FitPoint {
    /// While something is left to explain, tries other sizes of amplitudes that have no slope: each alone, then all
    /// together that lower the cost.
    pub(crate) fn leave_dead_sizes(&mut self, objective: &Objective) {
        if chi(self.squares(), objective.samples(LogSet::Learn)) <= objective.noise_bound() {
            return;
        }
        let sizes = self.better_sizes(objective, &self.dead(objective));
        let Some(most) = sizes.iter().min_by(|a, b| a.cost.total_cmp(&b.cost)) else { return };
        let with = |sizes: &[Size]| {
            let mut u = self.u.clone();
            sizes.iter().for_each(|size| u[size.parameter] = size.u);
            u
        };
        let tried = self.at_points(objective, vec![with(&sizes), with(std::slice::from_ref(most))]);
        if let Some(mut best) = tried.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost)) {
            best.solve(objective, FOLLOWING);
            *self = best;
        }
    }

    /// The best other size of each of these amplitudes that lowers the cost, as all others stay.
    fn better_sizes(&self, objective: &Objective, dead: &[usize]) -> Vec<Size> {
        let (parameters, bare) = (objective.parameters(), self.bare());
        let with = |&(parameter, k): &(usize, i32)| {
            let mut u = self.u.clone();
            u[parameter] = parameters[parameter].clamp(LEAST * FACTOR.powi(k));
            (parameter, u)
        };
        let all: Vec<(usize, i32)> =
            (0..SIZES).flat_map(|k| dead.iter().map(move |&parameter| (parameter, k))).collect();
        let mut tried: Vec<Size> = Vec::new();
        // No more at once than a Jacobian holds.
        for some in all.chunks(self.active.len().max(1)) {
            let points: Vec<_> = some.iter().map(with).collect();
            let residuals = objective.moved(&points, &self.u, &bare);
            tried.extend(points.into_iter().zip(residuals).filter_map(|((parameter, u), residual)| {
                let residual = corrected(residual.ok()?, &self.step_error);
                Some(Size { parameter, u: u[parameter], cost: cost(parameters, &self.active, &u, &residual) })
            }));
        }
        let best = |&parameter: &usize| {
            let of = tried.iter().filter(|size| size.parameter == parameter);
            of.min_by(|a, b| a.cost.total_cmp(&b.cost)).filter(|best| best.cost < self.cost).copied()
        };
        dead.iter().filter_map(best).collect()
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
