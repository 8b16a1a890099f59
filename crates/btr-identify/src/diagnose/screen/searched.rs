//! Sizes that no probe predicts: they are searched in the error, and then about what it shows.

use super::start_point::{StartPoint, is_switched};
use super::{best, simulate_worst};
use crate::fit::{FitPoint, Objective};

/// How many sizes are probed that are searched in the error, and how many directions of joints.
const SEARCHED: usize = 4;
/// How far about such a size others are simulated, as a share of it, and how many to each side.
const ABOUT: f64 = 0.04;
const TO_A_SIDE: i32 = 8;

/// The sizes of candidates that the error shows, those first that may explain most of it.
pub(super) fn found_in_error(
    objective: &Objective,
    index: usize,
    base: &FitPoint,
    searched: &[usize],
) -> Vec<StartPoint> {
    let residuals = base.by_log(objective);
    // Of each candidate the best size comes first: the others must not crowd out another joint.
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
    let on_stairs = sizes.into_iter().take(SEARCHED).map(|one| sharpened(objective, base, &start(one)));
    on_stairs.chain(switched.into_iter().take(SEARCHED).map(start)).collect()
}

/// A size that the error of its joint shows about, as a simulation of the worst log has it: a stair that comes a sample
/// too early or too late jolts the others as much as a wrong one.
fn sharpened(objective: &Objective, base: &FitPoint, start: &StartPoint) -> StartPoint {
    let amplitudes = &objective.candidates()[start.candidate].amplitudes;
    let at = |k: i32| {
        let mut near = start.clone();
        for &parameter in amplitudes {
            let factor = 1.0 + ABOUT * f64::from(k) / f64::from(TO_A_SIDE);
            near.u[parameter] = objective.parameters()[parameter].clamp(factor * near.u[parameter]);
        }
        near
    };
    let mut tried: Vec<StartPoint> = (-TO_A_SIDE..=TO_A_SIDE).map(at).collect();
    simulate_worst(objective, base, &mut tried);
    tried.retain(|near| near.cost.is_finite());
    let best = best(tried, 1).pop().unwrap_or_else(|| start.clone());
    StartPoint { cost: start.cost, ..best }
}
