//! Which logs the first pass probes: as few as tell candidates apart.

use super::linear::BasePoint;
use crate::fit::{FitPoint, LogSet, Objective, squares};
use std::ops::Range;

/// Largest share of the squared error above the noise that the base's parameters may explain in the logs that are
/// probed. Where they explain most of it, any candidate looks as good as any other.
const ABSORBED: f64 = 0.5;

/// The logs with the largest errors, in the order of the residual, with their rows: the worst one, or more where the
/// base's parameters could follow it and only disagree with the other logs. Empty without logs.
pub(super) fn worst_that_tell(objective: &Objective, base: &FitPoint) -> Vec<(usize, Range<usize>)> {
    let all = objective.logs(LogSet::Learn).len();
    let mut most = 1;
    loop {
        let mut worst = objective.worst_logs(&base.residual, most);
        worst.sort_by_key(|(_, rows)| rows.start);
        if most >= all || !is_absorbed(objective, base, &worst) {
            return worst;
        }
        most *= 2;
    }
}

/// Whether the base's parameters could explain most of the error in some logs, if the others did not count.
fn is_absorbed(objective: &Objective, base: &FitPoint, logs: &[(usize, Range<usize>)]) -> bool {
    let (numbers, rows): (Vec<usize>, Vec<Range<usize>>) = logs.iter().cloned().unzip();
    let noise: usize = numbers.iter().map(|&log| objective.description.logs[log].present).sum();
    let here = base.in_rows(&rows);
    let excess = squares(&here.residual) - noise as f64;
    BasePoint::new(objective, 0, &here, numbers).is_some_and(|point| point.falls_by() > ABSORBED * excess)
}
