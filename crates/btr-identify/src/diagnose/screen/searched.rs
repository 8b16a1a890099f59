//! Sizes that no probe predicts: they are searched in the error, and then about what it shows.

use super::costs::{best, simulate_worst};
use super::start_point::{StartPoint, is_switched};
use crate::fit::{FitPoint, Objective};

/// How many candidates are probed whose sizes are searched in the error, and how many directions of joints.
pub(super) const SEARCHED: usize = 4;
/// How far about such a size others are simulated, as a share of it, and how many to each side.
const ABOUT: f64 = 0.04;
pub(super) const TO_A_SIDE: usize = 8;
/// Least share by which the cost of another size is lower.
const LOWER: f64 = 0.05;

/// The sizes of candidates that the error shows, those first that may explain most of it.
pub(super) fn found_in_error(
    objective: &Objective,
    index: usize,
    base: &FitPoint,
    searched: &[usize],
) -> Vec<StartPoint> {
    let residuals = base.by_log(objective);
    // Of each candidate the best size comes first: second sizes must not crowd out another joint.
    let sizes = |&candidate: &usize| {
        let sizes =
            objective.candidates()[candidate].amplitudes.iter().flat_map(|&k| objective.model.sizes(k, &residuals));
        sizes.enumerate().map(move |(rank, (size, explained))| (rank, candidate, size, explained))
    };
    let mut found: Vec<(usize, usize, f64, f64)> = searched.iter().flat_map(sizes).collect();
    found.sort_by(|a, b| a.0.cmp(&b.0).then(b.3.total_cmp(&a.3)));
    let start = |(_, candidate, size, _): (usize, usize, f64, f64)| {
        let mut u = base.u.clone();
        objective.candidates()[candidate].amplitudes.iter().for_each(|&k| u[k] = objective.parameters()[k].clamp(size));
        StartPoint { candidate, base: index, u, cost: f64::INFINITY }
    };
    let (switched, sizes): (Vec<_>, Vec<_>) = found.into_iter().partition(|one| is_switched(objective, one.1));
    let found: Vec<StartPoint> = sizes.into_iter().take(SEARCHED).map(start).collect();
    let near: Vec<StartPoint> = found.iter().filter_map(|start| sharpened(objective, base, start)).collect();
    found.into_iter().chain(near).chain(switched.into_iter().take(SEARCHED).map(start)).collect()
}

/// The size near one that the error of its joint shows with which the worst log is simulated best, if that is another
/// one: a stair that comes a sample too early or too late jolts the other joints as much as a wrong one.
fn sharpened(objective: &Objective, base: &FitPoint, start: &StartPoint) -> Option<StartPoint> {
    let amplitudes = &objective.candidates()[start.candidate].amplitudes;
    let at = |k: usize| {
        let mut near = start.clone();
        for &parameter in amplitudes {
            let factor = 1.0 + ABOUT * (k as f64 / TO_A_SIDE as f64 - 1.0);
            near.u[parameter] = objective.parameters()[parameter].clamp(factor * near.u[parameter]);
        }
        near
    };
    let mut tried: Vec<StartPoint> = (0..=2 * TO_A_SIDE).map(at).collect();
    simulate_worst(objective, base, &mut tried);
    let shown = tried[TO_A_SIDE].cost;
    let best = best(tried, 1).pop()?;
    (best.cost < (1.0 - LOWER) * shown).then_some(StartPoint { cost: start.cost, ..best })
}
