//! How far the size of a finding depends on a single log.
//!
//! One Gauss-Newton step predicts where a fit without a log would end. Where more than noise is left, that step may be
//! far too long, so what it calls unstable is fitted again without the log.

use super::DiagnosisState;
use crate::diagnose::evidence::rows;
use crate::diagnose::refit::FOLLOWER;
use crate::diagnose::thresholds::STABLE;
use crate::fit::{FitPoint, LogSet, Objective};
use btr_core::optimize::QuadraticModel;
use nalgebra::DVector;
use std::ops::Range;

impl DiagnosisState {
    /// Notes for each finding the training log without which its size changes most, and by what share of it; at most
    /// so many fits tell what a linear step calls unstable. Nothing with one log alone.
    pub(in crate::diagnose) fn leave_one_out(&mut self, objective: &Objective, fits: usize) {
        let logs: Vec<(usize, Range<usize>)> =
            objective.logs(LogSet::Learn).iter().copied().zip(rows(objective, LogSet::Learn)).collect();
        if logs.len() < 2 {
            return;
        }
        let Some(mut without) = predicted(objective, &self.fit, &logs) else { return };
        let amplitudes = |index: usize| &objective.candidates()[self.chosen[index].candidate].amplitudes;
        let change = |index: usize, u: &[f64]| {
            let size = amplitudes(index).iter().map(|&parameter| self.fit.u[parameter].abs()).fold(0.0, f64::max);
            let by = |&parameter: &usize| (u[parameter] - self.fit.u[parameter]).abs() / size;
            amplitudes(index).iter().map(by).fold(0.0, f64::max)
        };
        let largest = |u: &[f64]| (0..self.chosen.len()).map(|index| change(index, u)).fold(0.0, f64::max);
        let mut unstable: Vec<usize> = (0..logs.len()).filter(|&log| largest(&without[log]) > STABLE).collect();
        unstable.sort_by(|&a, &b| largest(&without[b]).total_cmp(&largest(&without[a])));
        for log in unstable.into_iter().take(fits) {
            if let Some(u) = refitted(objective, &self.fit, &logs[log]) {
                without[log] = u;
            }
        }
        let most = |index: usize| {
            let changes = logs.iter().zip(&without).map(|((log, _), u)| (*log, change(index, u)));
            changes.max_by(|(_, a), (_, b)| a.total_cmp(b)).filter(|(_, change)| change.is_finite())
        };
        let all: Vec<Option<(usize, f64)>> = (0..self.chosen.len()).map(most).collect();
        for (found, most) in self.chosen.iter_mut().zip(all) {
            (found.evidence.leave_one_out_log, found.evidence.leave_one_out_change) = most.unzip();
        }
    }
}

/// Where one Gauss-Newton step from the fit to all logs leads without each of them, within the bounds.
fn predicted(objective: &Objective, fit: &FitPoint, logs: &[(usize, Range<usize>)]) -> Option<Vec<Vec<f64>>> {
    let jacobian = fit.jacobian.as_ref()?;
    let of_all = fit.quadratic_model(objective, jacobian).curvature;
    let without = |(_, rows): &(usize, Range<usize>)| {
        let of_log = jacobian.rows(rows.start, rows.len());
        let gradient = -of_log.tr_mul(&DVector::from_column_slice(&fit.residual[rows.clone()]));
        let others = QuadraticModel { curvature: &of_all - of_log.tr_mul(&of_log), gradient };
        let step = fit.step_within_bounds(objective.parameters(), &others)?;
        let mut u = fit.u.clone();
        fit.active.iter().zip(step.iter()).for_each(|(&parameter, by)| u[parameter] += by);
        Some(u)
    };
    logs.iter().map(without).collect()
}

/// Where a fit without a log ends that begins at the fit to all; `None` where that cannot be simulated.
fn refitted(objective: &Objective, fit: &FitPoint, (log, rows): &(usize, Range<usize>)) -> Option<Vec<f64>> {
    let others = objective.without_log(*log);
    let step_error = [&fit.step_error[..rows.start], &fit.step_error[rows.end..]].concat();
    let mut without = FitPoint::at(&others, fit.active.clone(), fit.u.clone(), &step_error).ok()?;
    without.solve(&others, FOLLOWER);
    objective.count(&others);
    Some(without.u)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::fit::SearchBudget;
    use crate::fixture::{SyntheticModel, parameter};
    use crate::residual_model::Parametrisation;

    #[test]
    fn a_fit_tells_how_far_a_size_changes_where_a_linear_step_goes_too_far() {
        // The first log alone has its least squares at 1, and is nearly flat where both together have theirs, at 1.6.
        let residual = |values: &[f64]| vec![40.0 * (3.0 * (values[0] - 1.0)).tanh(), 70.7 * (values[0] - 1.694)];
        let model = SyntheticModel::new(vec![parameter(Parametrisation::Linear, 0.0, 1.0)], 1, residual).and_log(1);
        let objective = Objective::new(&model);
        let mut fit = FitPoint::at(&objective, vec![0], vec![1.5], &[]).unwrap();
        fit.solve(&objective, SearchBudget::FULL);
        fit.differentiate(&objective);
        let logs = [(0, 0..1), (1, 1..2)];
        let change = |u: &[f64]| (u[0] - fit.u[0]).abs() / fit.u[0];
        let linear = change(&predicted(&objective, &fit, &logs).unwrap()[1]);
        let (before, fitted) = (objective.rollouts(), refitted(&objective, &fit, &logs[1]).unwrap());
        assert!(linear > 2.0 * STABLE, "{linear} at {:?}", fit.u);
        assert!((fitted[0] - 1.0).abs() < 0.1 && change(&fitted) < STABLE, "{fitted:?} from {:?}", fit.u);
        assert!(objective.rollouts() > before);
    }
}
