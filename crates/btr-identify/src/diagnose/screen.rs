//! Screening: every candidate is tried with finite probes, while all free parameters may adapt.
//!
//! Probes are finite because some effects have no slope at zero (backlash, delay, a limit). What the base's parameters
//! can do as well is projected out, so that only what they cannot do counts for a candidate. A first pass uses the log
//! with the largest error alone; what is promising there is probed on all of them.

use super::linear::{BasePoint, STRETCH};
use super::start_point::{ProbeSizes, StartPoint, has_two_sides, with};
use crate::fit::{FitPoint, LogSet, Objective, corrected, shared};
use crate::residual_model::{EffectCandidate, Parametrisation};

/// Probes of the first pass, and of the second one.
const GLANCE: ProbeSizes = ProbeSizes { amplitudes: &[0.5], limits: &[0.15, 0.3, 0.6] };
const LOOK: ProbeSizes = ProbeSizes { amplitudes: &[0.3, 1.5], limits: &[0.12, 0.18, 0.27, 0.4, 0.6, 1.0] };
/// Probes for candidates whose best amplitude lies beyond what the largest probe of the second pass is trusted for: a
/// foot that lost the ground, or a joint at its stop, leaves no way back along a straight line.
const FAR: ProbeSizes = ProbeSizes { amplitudes: &[6.0, 24.0], limits: &[] };
/// How many candidates pass the first pass.
const GLANCED: usize = 16;
/// How many candidates are simulated where their probes promise most.
const VERIFIED: usize = 10;
/// How many of those that promise most go on however they fare when they are simulated.
const PROMISED: usize = 4;
/// How many of the best of the first pass are simulated in any case: all logs together may hide what one log shows.
const STRIKING: usize = 3;
/// Which shares of the way to a promise are simulated.
const SHARES: [f64; 2] = [1.0, 0.3];

/// About how many logs a screening simulates.
pub(super) fn rollouts(objective: &Objective) -> usize {
    let (candidates, logs) = (objective.candidates(), objective.logs(LogSet::Learn).len());
    let sides = |candidate: &EffectCandidate| if has_two_sides(objective, candidate) { 2 } else { 1 };
    let probes = |candidate: &EffectCandidate| {
        sides(candidate) * candidate.starts.len() * candidate.amplitudes.len() * GLANCE.amplitudes.len()
    };
    let all: Vec<usize> = (0..candidates.len()).collect();
    let kinds = all.chunk_by(|&a, &b| candidates[a].effect == candidates[b].effect);
    let glances = kinds.map(|kind| {
        probes(&candidates[kind[0]]) * shared(kind.iter().map(|&c| objective.description.channels_of(c))).len()
    });
    glances.sum::<usize>() + logs * LOOK.amplitudes.len() * GLANCED.min(candidates.len())
}

/// The most promising of the candidates `offered`, best first, with simulated costs. Each is seen from all bases and
/// starts from the one where it promises most: free parameters may have been biased by compensating for it.
pub(super) fn screen(objective: &Objective, bases: &mut [FitPoint], offered: &[usize]) -> Vec<StartPoint> {
    for (index, base) in bases.iter_mut().enumerate() {
        if index == 0 { base.differentiate_finely(objective) } else { base.differentiate(objective) }
    }
    let Some((log, rows)) = bases.first().and_then(|base| objective.worst_logs(&base.residual, 1).pop()) else {
        return Vec::new();
    };
    let all = |&candidate: &usize| (candidate, objective.candidates()[candidate].starts.clone());
    let offered: Vec<(usize, Vec<Vec<f64>>)> = offered.iter().map(all).collect();
    let glance = |(index, base): (usize, &FitPoint)| {
        let there = base.in_rows(rows.clone());
        let seen = BasePoint::new(objective, index, &there, vec![log]);
        seen.map_or_else(Vec::new, |seen| seen.promising_together(objective, &offered, &GLANCE))
    };
    let glanced = best(bases.iter().enumerate().flat_map(glance).collect(), GLANCED);
    // Everyone is looked at from the first base, and from the one where it promised most.
    let look = |(index, base): (usize, &FitPoint)| {
        let Some(seen) = BasePoint::new(objective, index, base, objective.logs(LogSet::Learn).to_vec()) else {
            return (vec![], vec![]);
        };
        let own = glanced.iter().filter(|start| index == 0 || start.base == index);
        let near: Vec<StartPoint> = own.filter_map(|start| seen.promising(objective, start, &LOOK)).collect();
        let beyond = near.iter().filter(|start| goes_further(objective, start));
        let far = beyond.filter_map(|start| seen.promising(objective, start, &FAR)).collect();
        (near, far)
    };
    let (near, far): (Vec<Vec<StartPoint>>, Vec<Vec<StartPoint>>) = bases.iter().enumerate().map(look).unzip();
    let mut promising = best(near.concat(), VERIFIED);
    promising.extend(best(far.concat(), STRIKING));
    promising.extend(glanced.iter().take(STRIKING).cloned());
    verify(objective, bases, &promising)
}

/// Whether a promise stops where the probes of the closer look are no longer believed, with room beyond.
fn goes_further(objective: &Objective, start: &StartPoint) -> bool {
    let believed = STRETCH * LOOK.amplitudes.iter().fold(0.0, |most: f64, size| most.max(*size));
    let mut amplitudes = objective.candidates()[start.candidate].amplitudes.iter();
    amplitudes.any(|&parameter| {
        let (u, parameter) = (start.u[parameter], &objective.parameters()[parameter]);
        parameter.law == Parametrisation::Linear
            && u.abs() > 0.999 * believed
            && parameter.clamp(2.0 * u).abs() > u.abs()
    })
}

/// The best of each candidate, best first, at most so many.
pub(super) fn best(mut starts: Vec<StartPoint>, most: usize) -> Vec<StartPoint> {
    starts.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let mut kept: Vec<StartPoint> = Vec::new();
    for start in starts {
        if kept.len() < most && kept.iter().all(|other| other.candidate != start.candidate) {
            kept.push(start);
        }
    }
    kept
}

/// Simulates every promise, all of it and a part of it: a picture drawn with straight lines may promise too much. In
/// the order of what came out, but those that promise most are not lost for it.
fn verify(objective: &Objective, bases: &[FitPoint], promising: &[StartPoint]) -> Vec<StartPoint> {
    let partly = |start: &StartPoint| {
        SHARES.map(|share| StartPoint { u: start.partly(objective, &bases[start.base], share), ..start.clone() })
    };
    let mut tried: Vec<StartPoint> = promising.iter().flat_map(partly).collect();
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

/// Simulates the cost of starts; infinite where one cannot be simulated.
pub(super) fn simulate(objective: &Objective, bases: &[FitPoint], starts: &mut [StartPoint]) {
    let points: Vec<Vec<f64>> = starts.iter().map(|start| start.u.clone()).collect();
    for (start, residual) in starts.iter_mut().zip(objective.residuals(&points, LogSet::Learn)) {
        let base = &bases[start.base];
        let active = with(base, &objective.candidates()[start.candidate]);
        let cost = |residual| {
            crate::fit::cost(objective.parameters(), &active, &start.u, &corrected(residual, &base.step_error))
        };
        // A start that cannot be simulated is the last choice.
        start.cost = residual.map_or(f64::INFINITY, cost);
    }
}
