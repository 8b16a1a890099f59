//! Screening: every candidate is tried with finite probes, while all free parameters may adapt.
//!
//! Probes are finite because some effects have no slope at zero (backlash, delay, a limit). What the base's parameters
//! can produce as well is projected out, so that only the rest counts for a candidate. A first pass uses only the log
//! with the largest error, or a few where it says nothing by itself; the best candidates are then probed on all logs.

mod costs;
mod linear;
mod logs;
mod onset;
mod searched;
mod start_point;

use super::own;
use crate::fit::{FitPoint, LogSet, Objective, shared};
use crate::residual_model::{EffectCandidate, Needs, Parametrisation};
use btr_core::signal::ripple::ripples;
pub(crate) use costs::{best, simulate, simulate_worst};
use linear::{BasePoint, STRETCH};
use searched::{SEARCHED, TO_A_SIDE, found_in_error};
use start_point::ProbeSizes;
use start_point::is_switched;
pub(crate) use start_point::{StartPoint, has_two_sides, is_searched, with};
use std::cmp::Ordering::Equal;
use std::f64::consts::PI;
use std::ops::Range;

/// Probes of the first pass, and of the second one.
const COARSE: ProbeSizes = ProbeSizes {
    amplitudes: &[0.5],
    limits: &[1.02, 1.06, 1.15, 1.35, 1.8, 2.6, 4.0, 7.0, 13.0, 25.0, 50.0],
    compliances: &[0.02, 0.08, 0.15, 0.3, 0.6],
};
const FINE: ProbeSizes = ProbeSizes {
    amplitudes: &[0.3, 1.5],
    limits: &[0.3, 0.55, 0.77, 0.9, 0.97, 1.0, 1.04, 1.12, 1.35, 1.9, 3.2],
    compliances: &[0.01, 0.03, 0.07, 0.12, 0.18, 0.27, 0.4, 0.6, 1.0],
};
/// Probes for candidates whose best amplitude lies beyond the range of the second pass: after a foot has lost contact,
/// or a joint has reached its stop, the response is not linear.
const FAR: ProbeSizes = ProbeSizes { amplitudes: &[6.0, 24.0], limits: &[], compliances: &[] };
/// How many orders of ripples are tried that the error shows.
const ORDERS: usize = 4;
/// Largest share of the cost that a joint leaves which counted the other way round.
const HALF: f64 = 0.5;
/// How many candidates pass the first pass, and how many of those that show in one joint's channel alone.
const COARSE_PASS: (usize, usize) = (16, 6);
/// How many of the best predictions are simulated, and how many of one joint.
const VERIFIED: (usize, usize) = (10, 4);
/// How many of the best predictions continue whatever their simulated cost.
const PROMISED: usize = 4;
/// How many of the best of the first pass are simulated in any case: all logs together may hide what one log shows.
const STRIKING: usize = 3;
/// The shares of a predicted step that are simulated.
const SHARES: [f64; 2] = [1.0, 0.3];

/// About how many logs a screening simulates.
pub(super) fn rollouts(objective: &Objective) -> usize {
    let (candidates, logs) = (objective.candidates(), objective.logs(LogSet::Learn).len());
    let sides = |candidate: &EffectCandidate| if has_two_sides(objective, candidate) { 2 } else { 1 };
    let probes = |candidate: &EffectCandidate| {
        sides(candidate) * candidate.starts.len() * candidate.amplitudes.len() * COARSE.amplitudes.len()
    };
    // What needs another effect first is tried alone.
    let is_probed = |c: &usize| candidates[*c].needs == Needs::Nothing && !is_searched(objective, *c);
    let all: Vec<usize> = (0..candidates.len()).filter(is_probed).collect();
    let kinds = all.chunk_by(|&a, &b| candidates[a].effect == candidates[b].effect);
    let coarse = kinds.map(|kind| {
        probes(&candidates[kind[0]]) * shared(kind.iter().map(|&c| objective.description.channels_of(c))).len()
    });
    let sizes = (0..candidates.len()).filter(|&c| is_searched(objective, c)).count().min(SEARCHED);
    coarse.sum::<usize>()
        + sizes * (2 * TO_A_SIDE + 1)
        + logs * FINE.amplitudes.len() * COARSE_PASS.0.min(candidates.len())
}

/// The most promising of the candidates `offered`, best first, with simulated costs. Each is probed from all bases and
/// starts from the one with the best prediction: free parameters may have been biased by compensating for it.
pub(super) fn screen(objective: &Objective, bases: &mut [FitPoint], offered: &[usize]) -> Vec<StartPoint> {
    for (index, base) in bases.iter_mut().enumerate() {
        if index == 0 { base.differentiate_finely(objective) } else { base.differentiate(objective) }
    }
    let Some((log, rows)) = bases.first().and_then(|base| objective.worst_logs(&base.residual, 1).pop()) else {
        return Vec::new();
    };
    let (probed, probed_rows): (Vec<usize>, Vec<Range<usize>>) =
        bases.first().map_or_else(Vec::new, |base| logs::worst_that_tell(objective, base)).into_iter().unzip();
    let (searched, offered): (Vec<usize>, Vec<usize>) =
        offered.iter().partition(|&&candidate| is_searched(objective, candidate));
    let Some(reached) = bases.first().map(|base| onset::onsets(objective, base, (log, rows.clone()), &offered)) else {
        return Vec::new();
    };
    let probe_coarsely = |(index, base): (usize, &FitPoint)| {
        let starts = |&candidate: &usize| (candidate, starts(objective, candidate, log, &base.residual[rows.clone()]));
        let offered: Vec<(usize, Vec<Vec<f64>>)> = offered.iter().map(starts).collect();
        let on_logs = base.in_rows(&probed_rows);
        let base = BasePoint::new(objective, index, &on_logs, probed.clone());
        base.map_or_else(Vec::new, |base| base.predicted_together(objective, &offered, &COARSE, &reached))
    };
    let coarse = best_of_joints(objective, bases.iter().enumerate().flat_map(probe_coarsely).collect(), COARSE_PASS);
    // A joint that counts the other way round draws the free parameters to their bounds: it is tried without that, too.
    let in_error = |(index, base): (usize, &FitPoint)| {
        let from_here = |candidate: &usize| index == 0 || is_switched(objective, *candidate);
        let searched: Vec<usize> = searched.iter().copied().filter(from_here).collect();
        found_in_error(objective, index, base, &searched)
    };
    let found: Vec<StartPoint> = bases.iter().enumerate().flat_map(in_error).collect();
    // Each candidate is probed from the first base, and from the one with its best prediction.
    let probe_finely = |(index, base): (usize, &FitPoint)| {
        let Some(point) = BasePoint::new(objective, index, base, objective.logs(LogSet::Learn).to_vec()) else {
            return (vec![], vec![]);
        };
        let starts: Vec<&StartPoint> =
            coarse.iter().chain(&found).filter(|start| index == 0 || start.base == index).collect();
        let near = point.predicted(objective, &starts, &FINE);
        let beyond: Vec<&StartPoint> = near.iter().filter(|start| goes_further(objective, start)).collect();
        let far = point.predicted(objective, &beyond, &FAR);
        (near, far)
    };
    let (near, far): (Vec<Vec<StartPoint>>, Vec<Vec<StartPoint>>) = bases.iter().enumerate().map(probe_finely).unzip();
    let (switched, near): (Vec<StartPoint>, Vec<StartPoint>) =
        near.concat().into_iter().partition(|start| is_switched(objective, start.candidate));
    let mut predicted = best_of_joints(objective, near, VERIFIED);
    predicted.extend(best(far.concat(), STRIKING));
    predicted.extend(coarse.iter().take(STRIKING).cloned());
    let mut verified = verify(objective, bases, &predicted);
    verified.splice(0..0, that_halve_the_cost(objective, bases, switched));
    verified
}

/// The best of these starts, if its simulated cost is less than half of its base's: a prediction says nothing about
/// them.
fn that_halve_the_cost(objective: &Objective, bases: &[FitPoint], mut starts: Vec<StartPoint>) -> Vec<StartPoint> {
    simulate(objective, bases, &mut starts);
    starts.retain(|start| start.cost < HALF * bases[start.base].cost);
    best(starts, 1)
}

/// The starts of a candidate; for ripples, also with the orders that the error in a log shows.
fn starts(objective: &Objective, candidate: usize, log: usize, residual: &[f64]) -> Vec<Vec<f64>> {
    let candidate = &objective.candidates()[candidate];
    let mut starts = candidate.starts.clone();
    let Some(ripple) = &candidate.ripple else { return starts };
    let channel = objective.description.logs[log].channels.iter().find(|channel| channel.name == ripple.channel);
    let Some(rows) = channel.map(|channel| channel.samples.clone()) else { return starts };
    let measured = objective.description.measured.get(log);
    let Some(position) = measured.and_then(|values| values.get(rows.clone())) else { return starts };
    let of = |shape: usize| &objective.parameters()[candidate.shapes[shape]];
    let (order, phase) = (of(ripple.order), of(ripple.phase));
    for seen in ripples(position, &residual[rows], ORDERS) {
        let mut with_order = candidate.starts.clone();
        with_order.iter_mut().for_each(|start| start[ripple.order] = order.clamp(order.coordinate(seen.order)));
        if let Some(shown) = seen.phase {
            // A torque moves the error its way, or against it.
            with_order.truncate(2);
            for (start, turned) in with_order.iter_mut().zip([0.0, PI]) {
                let within = (shown + turned + PI).rem_euclid(2.0 * PI) - PI;
                start[ripple.phase] = phase.clamp(phase.coordinate(within));
            }
        }
        with_order.sort_by(|a, b| a.iter().zip(b).map(|(a, b)| a.total_cmp(b)).find(|o| o.is_ne()).unwrap_or(Equal));
        with_order.dedup();
        starts.extend(with_order);
    }
    starts
}

/// Whether a prediction ends at the limit of extrapolation of the second pass, with room beyond.
fn goes_further(objective: &Objective, start: &StartPoint) -> bool {
    let limit = STRETCH * FINE.amplitudes.iter().fold(0.0, |most: f64, size| most.max(*size));
    let mut amplitudes = objective.candidates()[start.candidate].amplitudes.iter();
    amplitudes.any(|&parameter| {
        let (u, parameter) = (start.u[parameter], &objective.parameters()[parameter]);
        parameter.law == Parametrisation::Linear && u.abs() > 0.999 * limit && parameter.clamp(2.0 * u).abs() > u.abs()
    })
}

/// The best start of each candidate, best first: at most `most` of those that show in all channels, and so many of each
/// joint whose candidates show in its channel alone. Each joint is then a question of its own, and all are answered at
/// once.
fn best_of_joints(objective: &Objective, starts: Vec<StartPoint>, (most, of_joint): (usize, usize)) -> Vec<StartPoint> {
    let joints = own::joints(objective, starts.iter().map(|start| start.candidate));
    let (apart, shared): (Vec<_>, Vec<_>) =
        starts.into_iter().partition(|start| own::is_apart(objective, start.candidate));
    let mut kept = best(shared, most);
    for joint in joints {
        let here = apart.iter().filter(|start| own::shows_in(objective, start.candidate, joint)).cloned().collect();
        kept.extend(best(here, of_joint));
    }
    kept.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    kept
}

/// Simulates every predicted step, in full and in part: the linear model may predict too large a step. Sorted by the
/// simulated cost, except that the best predictions stay in front.
fn verify(objective: &Objective, bases: &[FitPoint], predicted: &[StartPoint]) -> Vec<StartPoint> {
    let partly = |start: &StartPoint| {
        SHARES.map(|share| StartPoint { u: start.partly(objective, &bases[start.base], share), ..start.clone() })
    };
    let mut tried: Vec<StartPoint> = predicted.iter().flat_map(partly).collect();
    simulate(objective, bases, &mut tried);
    let shares = tried.chunks(SHARES.len());
    let all: Vec<StartPoint> = shares.filter_map(|shares| best(shares.to_vec(), 1).pop()).collect();
    let beaten = |start: &&StartPoint| all.iter().any(|o| o.candidate == start.candidate && o.cost < start.cost);
    let mut verified: Vec<StartPoint> =
        all.iter().filter(|start| start.cost.is_finite() && !beaten(start)).cloned().collect();
    let rest = verified.len().min(PROMISED);
    verified[rest..].sort_by(|a, b| a.cost.total_cmp(&b.cost));
    verified
}
