//! What starts cost, by simulation, and the best of them.

use super::start_point::{StartPoint, with};
use crate::fit::{FitPoint, LogSet, Objective, corrected, cost as cost_of, squares};

/// The best start of each candidate, best first, at most `most`.
pub(crate) fn best(mut starts: Vec<StartPoint>, most: usize) -> Vec<StartPoint> {
    starts.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let mut kept: Vec<StartPoint> = Vec::new();
    for start in starts {
        if kept.len() < most && kept.iter().all(|other| other.candidate != start.candidate) {
            kept.push(start);
        }
    }
    kept
}

/// Simulates the cost of starts on the log with the largest error alone.
pub(crate) fn simulate_worst(objective: &Objective, base: &FitPoint, starts: &mut [StartPoint]) {
    let Some((log, rows)) = objective.worst_logs(&base.residual, 1).pop() else { return };
    let points: Vec<Vec<f64>> = starts.iter().map(|start| start.u.clone()).collect();
    for (start, residual) in starts.iter_mut().zip(objective.residuals_of(&points, &[log])) {
        let cost = |residual| squares(&corrected(residual, &base.step_error[rows.clone()]));
        start.cost = residual.map_or(f64::INFINITY, cost);
    }
}

/// Simulates the cost of starts; infinite where one cannot be simulated.
pub(crate) fn simulate(objective: &Objective, bases: &[FitPoint], starts: &mut [StartPoint]) {
    let points: Vec<Vec<f64>> = starts.iter().map(|start| start.u.clone()).collect();
    for (start, residual) in starts.iter_mut().zip(objective.residuals(&points, LogSet::Learn)) {
        let base = &bases[start.base];
        let active = with(base, &objective.candidates()[start.candidate]);
        let cost =
            |residual| cost_of(objective.parameters(), &active, &start.u, &corrected(residual, &base.step_error));
        // A start that cannot be simulated comes last.
        start.cost = residual.map_or(f64::INFINITY, cost);
    }
}
