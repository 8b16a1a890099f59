//! Sizes in which the cost is a stair ([`Parametrisation::Stair`]): a command that comes a sample too early or too late
//! is an error. No derivative leads to the lowest step, about the true size, so that the values around are tried.

use super::objective::{LogSet, Objective};
use super::solve::{FitPoint, SearchBudget};
use crate::residual_model::Parametrisation;

/// How far from a size others are tried, as shares of it, one after the other...
const AROUND: [f64; 4] = [1e-2, 3e-3, 1e-3, 3e-4];
/// ... and how many to each side.
const TO_A_SIDE: i32 = 10;
/// Costs that differ by less are on one step of the stair.
const SAME: f64 = 1.0;
/// How the other parameters follow.
const FOLLOWING: SearchBudget = SearchBudget { jacobians: 1, steps: 6 };
/// Rise of the cost of a residual without memory at the ends of a 95 % interval.
const NINETY_FIVE: f64 = 3.84;

impl FitPoint {
    /// The active parameters that no derivative leads to.
    fn searched(&self, objective: &Objective) -> impl Iterator<Item = usize> + use<> {
        let searched: Vec<usize> =
            self.active.iter().copied().filter(|&k| objective.parameters()[k].is_searched()).collect();
        searched.into_iter()
    }

    /// Points with other values of a parameter, up to a share of it to either side.
    fn around(&self, objective: &Objective, parameter: usize, share: f64) -> Vec<FitPoint> {
        let with = |k: i32| {
            let mut u = self.u.clone();
            let factor = 1.0 + share * f64::from(k) / f64::from(TO_A_SIDE);
            u[parameter] = objective.parameters()[parameter].clamp(factor * u[parameter]);
            u
        };
        self.at_points(objective, (-TO_A_SIDE..=TO_A_SIDE).map(with).collect())
    }

    /// Moves each such parameter to the middle of the values about its own at which the cost is lowest; the others
    /// follow.
    pub(crate) fn sharpen(&mut self, objective: &Objective) {
        let is_stair = |k: &usize| objective.parameters()[*k].law == Parametrisation::Stair;
        for parameter in self.searched(objective).filter(is_stair) {
            for share in AROUND {
                let tried = self.around(objective, parameter, share);
                let least = tried.iter().map(|fit| fit.cost).fold(f64::INFINITY, f64::min);
                let Some(first) = tried.iter().position(|fit| fit.cost <= least + SAME) else { break };
                let on_step = tried[first..].iter().take_while(|fit| fit.cost <= least + SAME).count();
                let mut middle = tried[first + (on_step - 1) / 2].clone();
                middle.solve(objective, FOLLOWING);
                if middle.cost < self.cost + SAME {
                    *self = middle;
                }
            }
        }
    }

    /// Searches each such parameter in the error that is left without its effect.
    pub(crate) fn search_stairs(&mut self, objective: &Objective) {
        for parameter in self.searched(objective) {
            let with = |from: &FitPoint, value: f64| {
                let mut u = from.u.clone();
                u[parameter] = objective.parameters()[parameter].clamp(value);
                let mut fit = FitPoint::at(objective, from.active.clone(), u, &from.step_error).ok()?;
                fit.solve(objective, SearchBudget::FULL);
                Some(fit)
            };
            let Some(without) = with(self, objective.parameters()[parameter].coordinate(0.0)) else { continue };
            let sizes = objective.model.sizes(parameter, &without.by_log(objective)).into_iter();
            let found = sizes.filter_map(|(size, _)| with(&without, size));
            let best = found.min_by(|a, b| a.cost.total_cmp(&b.cost)).filter(|best| best.cost < self.cost);
            *self = best.unwrap_or_else(|| self.clone());
        }
    }

    /// The residual of each training log, with its index.
    pub(crate) fn by_log<'a>(&'a self, objective: &Objective) -> Vec<(usize, &'a [f64])> {
        let mut rest = self.residual.as_slice();
        let of_log = |&log: &usize| Some((log, rest.split_off(..objective.description.logs[log].rows())?));
        objective.logs(LogSet::Learn).iter().filter_map(of_log).collect()
    }

    /// The ends, as coordinates, of the values of a parameter about its own at which the cost is hardly larger: beyond
    /// them is another step of the stair. `None` where no step ends nearby.
    pub(super) fn step_of_stair(&self, objective: &Objective, parameter: usize, inflation: f64) -> Option<[f64; 2]> {
        AROUND.iter().rev().find_map(|&share| {
            let mut tried = self.around(objective, parameter, share);
            tried.sort_by(|a, b| a.u[parameter].total_cmp(&b.u[parameter]));
            let rises = |fit: &&FitPoint| fit.cost > self.cost + NINETY_FIVE * inflation;
            let (below, above): (Vec<_>, Vec<_>) = tried.iter().partition(|fit| fit.u[parameter] < self.u[parameter]);
            let low = below.into_iter().rev().find(rises)?;
            Some([low.u[parameter], above.into_iter().find(rises)?.u[parameter]])
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::fit::{Intervals, estimates};
    use crate::fixture::{SyntheticModel, parameter};

    /// Size and gain.
    const TRUTH: [f64; 2] = [0.0371, 1.02];

    /// A wave of a gain that is rounded to whole steps, in noise floors.
    fn rounded(values: &[f64], row: usize) -> f64 {
        let (size, gain, t) = (values[0], values[1], row as f64 * 0.02);
        300.0 * gain * size * ((0.7 * t.sin() + 0.4 * (2.3 * t).cos()) / size).round()
    }

    #[test]
    fn the_size_of_steps_is_found_from_nearby_and_derivatives_leave_it() {
        let stair = parameter(Parametrisation::Stair, 0.0, 0.01);
        let parameters = vec![stair, parameter(Parametrisation::Exponential, 1.0, 0.1)];
        let parameters =
            parameters.into_iter().map(|k| crate::residual_model::FitParameter { bounds: (-9.0, 9.0), ..k });
        let model = SyntheticModel::new(parameters.collect(), 600, |values| {
            let noise = |row: usize| ((row * row) as f64 * 0.7).sin() * std::f64::consts::SQRT_2;
            (0..600).map(|row| rounded(&TRUTH, row) + noise(row) - rounded(values, row)).collect()
        });
        let objective = Objective::new(&model);
        let mut fit = FitPoint::at(&objective, vec![0, 1], vec![1.003 * 3.71, 0.0], &[]).unwrap();
        fit.solve(&objective, SearchBudget::FULL);
        assert!((fit.u[0] - 1.003 * 3.71).abs() < 1e-12, "{}", fit.u[0]);
        fit.sharpen(&objective);
        fit.solve(&objective, SearchBudget::FULL);
        assert!(fit.squares() < 1.2 * 600.0, "{}", fit.squares());
        let all = estimates(&objective, &fit, 1.0, Intervals::Given);
        let [low, high] = all[0].1.ci95.unwrap();
        assert!(low < TRUTH[0] && TRUTH[0] < high && high - low < 2e-4, "{low} to {high}");
    }
}
