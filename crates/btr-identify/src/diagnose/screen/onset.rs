//! Where limits begin to act: a limit that is never reached changes nothing, and one that is far exceeded changes
//! everything. What explains an error is often within a few percent of the point where it is just reached.

use crate::fit::{FitPoint, LogSet, Objective, corrected};
use crate::residual_model::Parametrisation;
use std::collections::BTreeMap;
use std::ops::Range;

/// Coordinates between which limits are tried, in typical sizes, and how often the interval is halved.
pub(super) const WITHIN: (f64, f64) = (0.02, 3.0);
const HALVINGS: usize = 8;

/// For each amplitude that is a limit, the coordinate at which it is just reached; absent where it is not reached at
/// all.
pub(super) type Onsets = BTreeMap<usize, f64>;

/// The onsets of the limits among the candidates `offered`: in the log with these rows of the residual, or in all logs
/// where that one does not reach them.
pub(super) fn onsets(
    objective: &Objective,
    base: &FitPoint,
    (log, rows): (usize, Range<usize>),
    offered: &[usize],
) -> Onsets {
    let is_limit = |k: &usize| objective.parameters()[*k].law == Parametrisation::Inverse;
    let amplitudes = offered.iter().flat_map(|&candidate| objective.candidates()[candidate].amplitudes.iter().copied());
    let limits: Vec<usize> = amplitudes.filter(is_limit).collect();
    let mut onsets = onsets_in(objective, &base.in_rows(&[rows]), &[log], &limits);
    let others: Vec<usize> = limits.into_iter().filter(|limit| !onsets.contains_key(limit)).collect();
    if !others.is_empty() {
        onsets.extend(onsets_in(objective, base, objective.logs(LogSet::Learn), &others));
    }
    onsets
}

/// The onsets of those of the limits that are reached in some logs; `base` is the fit in these.
fn onsets_in(objective: &Objective, base: &FitPoint, logs: &[usize], limits: &[usize]) -> Onsets {
    let reached = |limits: &[usize], sizes: &[f64]| reached(objective, base, logs, limits, sizes);
    let far = reached(limits, &vec![WITHIN.1; limits.len()]);
    let limits: Vec<usize> = limits.iter().zip(far).filter(|(_, reached)| *reached).map(|(k, _)| *k).collect();
    let mut brackets = vec![WITHIN; limits.len()];
    for _ in 0..HALVINGS {
        let middles: Vec<f64> = brackets.iter().map(|(off, acts)| (off * acts).sqrt()).collect();
        let acts = reached(&limits, &middles);
        for ((bracket, middle), acts) in brackets.iter_mut().zip(middles).zip(acts) {
            *(if acts { &mut bracket.1 } else { &mut bracket.0 }) = middle;
        }
    }
    limits.into_iter().zip(brackets).map(|(limit, (_, acts))| (limit, acts)).collect()
}

/// Whether limits of these sizes change anything in some logs; one that cannot be simulated does.
fn reached(objective: &Objective, base: &FitPoint, logs: &[usize], limits: &[usize], sizes: &[f64]) -> Vec<bool> {
    let point = |(&limit, &size): (&usize, &f64)| {
        let mut u = base.u.clone();
        u[limit] = objective.parameters()[limit].clamp(size);
        u
    };
    let points: Vec<Vec<f64>> = limits.iter().zip(sizes).map(point).collect();
    let changes = |residual: Vec<f64>| {
        corrected(residual, &base.step_error).iter().zip(&base.residual).any(|(a, b)| a.to_bits() != b.to_bits())
    };
    objective.residuals_of(&points, logs).into_iter().map(|residual| residual.map_or(true, changes)).collect()
}
