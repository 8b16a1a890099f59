//! Fitting the screened candidates: a few cheap steps for many, the full budget for the leaders.

use super::own;
use super::screen::{StartPoint, best, has_two_sides, simulate, simulate_worst, with};
use crate::fit::residual_vector::chi;
use crate::fit::{FitPoint, FitStop, LogSet, Objective, SearchBudget, columns};
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Number of candidates that start the race, and of those that are fitted with the full budget whatever their rank,
/// unless the best explains everything and they are behind it by more than this factor of the sum of squares. Those
/// that show in one joint's channel alone run against each other, in further places.
const RUNNERS: usize = 8;
const RUNNERS_OF_JOINT: usize = 4;
const LEADERS: usize = 3;
const BEATEN: f64 = 10.0;
/// Candidates within this factor of the leader's sum of squares are fitted with the full budget as well, up to this
/// many.
pub(super) const CLOSE: f64 = 1.5;
const MOST: usize = 6;
/// Candidates within this factor of a leader that leaves only noise are fitted further: what a search of few steps
/// leaves behind would make one of two twins certain.
const LEVEL: f64 = 1.1;
/// Start size of a candidate that only passed the first screening, or none.
const TYPICAL: f64 = 0.5;
/// ... or sizes at which it is simulated, and how many of those that do best there take part in the race.
const SIZES: [f64; 3] = [0.5, 3.0, 16.0];
const CHANCES: usize = 8;
/// The same with contact, where one log shows little.
const CHANCES_ON_CONTACT: usize = 16;
/// The budget for the leader of the race, and for each of the others.
const LEADER: SearchBudget = SearchBudget { jacobians: 3, steps: 16 };
pub(super) const FOLLOWER: SearchBudget = SearchBudget { jacobians: 2, steps: 12 };

/// How many of the start shapes that are tried again are fitted: those with the lowest cost.
const RESHAPES: usize = 4;
/// The budget for each of them.
const RESHAPED: SearchBudget = SearchBudget { jacobians: 1, steps: 6 };

/// A candidate with its fit.
#[derive(Clone, Debug)]
pub(super) struct Rival {
    /// Index of the candidate.
    pub candidate: usize,
    /// The fit of the base with it.
    pub fit: FitPoint,
}

/// The candidates that the race left, fully fitted, lowest cost first; `leader` is the best fit from before. Only the
/// first of the starts take part.
pub(super) fn race(
    objective: &Objective,
    bases: &[FitPoint],
    starts: &[StartPoint],
    leader: Option<&FitPoint>,
) -> Vec<Rival> {
    let apart = |start: &&StartPoint| own::is_apart(objective, start.candidate);
    let mut taken: Vec<StartPoint> = starts.iter().filter(|start| !apart(start)).take(RUNNERS).cloned().collect();
    for joint in own::joints(objective, starts.iter().map(|start| start.candidate)) {
        let here = |start: &&StartPoint| own::shows_in(objective, start.candidate, joint);
        taken.extend(starts.iter().filter(here).take(RUNNERS_OF_JOINT).cloned());
    }
    run(objective, bases, &taken, leader)
}

/// All candidates that were not fitted yet, from a typical size: where no leader explains much of the error, probes
/// may have predicted too little (a joint with much play responds differently from one with little play).
pub(super) fn last_chance(objective: &Objective, base: &FitPoint, others: &[usize], leader: &FitPoint) -> Vec<Rival> {
    let mut base = base.clone();
    base.differentiate(objective);
    let starts: Vec<StartPoint> =
        others.iter().map(|&candidate| of_size(objective, &base, candidate, TYPICAL)).collect();
    run(objective, &[base], &starts, Some(leader))
}

/// The same with fewer rollouts: all candidates are simulated at a few sizes, and those that do best there are fitted.
pub(super) fn last_chance_of_the_best(
    objective: &Objective,
    base: &FitPoint,
    others: &[usize],
    leader: &FitPoint,
) -> Vec<Rival> {
    let signs = |candidate: usize| {
        let two = has_two_sides(objective, &objective.candidates()[candidate]);
        if two { [1.0, -1.0].iter() } else { [1.0].iter() }
    };
    let sizes = |candidate: usize| signs(candidate).flat_map(|sign| SIZES.map(|size| sign * size));
    let all = others.iter().flat_map(|&c| sizes(c).map(move |size| (c, size)));
    let mut starts: Vec<StartPoint> = all.map(|(candidate, size)| of_size(objective, base, candidate, size)).collect();
    let chances = if objective.description.has_contact {
        simulate(objective, std::slice::from_ref(base), &mut starts);
        CHANCES_ON_CONTACT
    } else {
        simulate_worst(objective, base, &mut starts);
        CHANCES
    };
    let starts = best(starts, chances);
    let mut base = base.clone();
    base.differentiate(objective);
    run(objective, &[base], &starts, Some(leader))
}

/// A candidate at a multiple of its typical size.
fn of_size(objective: &Objective, base: &FitPoint, candidate: usize, size: f64) -> StartPoint {
    let effect = &objective.candidates()[candidate];
    let mut u = base.u.clone();
    effect.amplitudes.iter().for_each(|&parameter| u[parameter] = objective.parameters()[parameter].clamp(size));
    effect.shapes.iter().zip(&effect.starts[0]).for_each(|(&parameter, &shape)| u[parameter] = shape);
    StartPoint { candidate, base: 0, u, cost: f64::INFINITY }
}

/// Runs races: of the candidates that show in all channels, and, at once, of those of each joint.
fn run(objective: &Objective, bases: &[FitPoint], starts: &[StartPoint], leader: Option<&FitPoint>) -> Vec<Rival> {
    let (apart, shared): (Vec<&StartPoint>, Vec<&StartPoint>) =
        starts.iter().partition(|start| own::is_apart(objective, start.candidate));
    let mut rivals = run_together(objective, bases, &shared, leader);
    let of_joint = |joint: &&[String]| {
        let here = apart.iter().copied().filter(|start| own::shows_in(objective, start.candidate, joint));
        run_together(objective, bases, &here.collect::<Vec<_>>(), leader)
    };
    let joints = own::joints(objective, apart.iter().map(|start| start.candidate));
    let points: Vec<&[f64]> = bases.iter().map(|base| base.u.as_slice()).collect();
    rivals.extend(objective.around(&points, || joints.par_iter().flat_map_iter(of_joint).collect::<Vec<_>>()));
    sort(&mut rivals);
    rivals
}

/// A race of candidates that show in the same channels.
fn run_together(
    objective: &Objective,
    bases: &[FitPoint],
    starts: &[&StartPoint],
    leader: Option<&FitPoint>,
) -> Vec<Rival> {
    let started = starts.iter().filter_map(|start| begin(objective, &bases[start.base], start));
    let mut rivals: Vec<Rival> = started.collect();
    for rival in &mut rivals {
        own::solve(objective, rival.candidate, &mut rival.fit, SearchBudget::RACE);
    }
    sort(&mut rivals);
    let (mut polished, mut unfinished): (Vec<Rival>, Vec<usize>) = (Vec::new(), Vec::new());
    for mut rival in rivals {
        let left = |fit: &FitPoint| own::learnt(objective, rival.candidate, fit);
        let best = polished.iter().map(|r| &r.fit).chain(leader).map(left).fold(f64::INFINITY, f64::min);
        let explains = chi(best, own::samples(objective, rival.candidate, LogSet::Learn)) <= objective.noise_bound();
        let most = match left(&rival.fit) / best {
            behind if behind <= CLOSE => MOST,
            behind if behind > BEATEN && explains => 0,
            _ => LEADERS,
        };
        if polished.len() < most {
            rival.fit.jacobian = None;
            let budget = if polished.is_empty() { LEADER } else { FOLLOWER };
            if own::solve(objective, rival.candidate, &mut rival.fit, budget) == FitStop::Effort {
                unfinished.push(rival.candidate);
            }
            // With contact every rollout is slow, and this rarely changes the order.
            if !objective.description.is_chaotic || left(&rival.fit) <= best {
                reshape(objective, &mut rival);
            }
            polished.push(rival);
        }
    }
    finish(objective, &mut polished, &unfinished, leader);
    polished
}

/// Fits those further that are level with the best, if that leaves only noise, and whose search was not over.
fn finish(objective: &Objective, rivals: &mut [Rival], unfinished: &[usize], leader: Option<&FitPoint>) {
    let Some(first) = rivals.first().map(|rival| rival.candidate) else { return };
    let left = |fit: &FitPoint| own::learnt(objective, first, fit);
    let best = rivals.iter().map(|rival| &rival.fit).chain(leader).map(left).fold(f64::INFINITY, f64::min);
    let alone = rivals.len() + usize::from(leader.is_some()) < 2;
    if alone
        || objective.description.is_chaotic
        || chi(best, own::samples(objective, first, LogSet::Learn)) > objective.noise_bound()
    {
        return;
    }
    for rival in rivals.iter_mut().filter(|rival| unfinished.contains(&rival.candidate)) {
        if left(&rival.fit) <= LEVEL * best {
            rival.fit.jacobian = None;
            own::solve(objective, rival.candidate, &mut rival.fit, FOLLOWER);
        }
    }
}

/// Where much is left to explain, a candidate may have lost its shape (a Stribeck velocity of zero is Coulomb's law):
/// tries its other start shapes from where it ended.
fn reshape(objective: &Objective, rival: &mut Rival) {
    let candidate = &objective.candidates()[rival.candidate];
    if candidate.starts.len() < 2
        || chi(rival.fit.squares(), objective.samples(LogSet::Learn)) <= objective.noise_bound()
    {
        return;
    }
    let with_shapes = |shapes: &Vec<f64>| {
        let mut u = rival.fit.u.clone();
        candidate.shapes.iter().zip(shapes).for_each(|(&parameter, &shape)| u[parameter] = shape);
        StartPoint { candidate: rival.candidate, base: 0, u, cost: f64::INFINITY }
    };
    let mut reshaped: Vec<StartPoint> = candidate.starts.iter().map(with_shapes).collect();
    simulate(objective, std::slice::from_ref(&rival.fit), &mut reshaped);
    reshaped.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let fitted = reshaped.into_iter().take(RESHAPES).filter_map(|start| {
        let mut fit = FitPoint::at(objective, rival.fit.active.clone(), start.u, &rival.fit.step_error).ok()?;
        own::solve(objective, rival.candidate, &mut fit, RESHAPED);
        Some(fit)
    });
    if let Some(best) = fitted.min_by(|a, b| a.cost.total_cmp(&b.cost)).filter(|best| best.cost < rival.fit.cost) {
        rival.fit = best;
        own::solve(objective, rival.candidate, &mut rival.fit, FOLLOWER);
    }
}

fn sort(rivals: &mut [Rival]) {
    rivals.sort_by(|a, b| a.fit.cost.total_cmp(&b.fit.cost));
}

/// A fit of base and candidate at the candidate's start: the base's Jacobian with new columns for the candidate alone,
/// without those that do not adapt. `None` where that cannot be simulated: the candidate is skipped.
fn begin(objective: &Objective, base: &FitPoint, start: &StartPoint) -> Option<Rival> {
    let candidate = &objective.candidates()[start.candidate];
    let mut fit = FitPoint::at(objective, with(base, candidate), start.u.clone(), &base.step_error).ok()?;
    let parameters: Vec<usize> = candidate.parameters().collect();
    let added = columns(objective, &fit.u, &parameters, &fit.residual, &fit.step_error);
    let known = base.jacobian.as_ref()?;
    let mut jacobian = DMatrix::zeros(known.nrows(), known.ncols() + added.len());
    let adapts = own::adapting(objective, start.candidate);
    for k in (0..known.ncols()).filter(|&k| adapts(base.active[k])) {
        jacobian.column_mut(k).copy_from(&known.column(k));
    }
    for (k, column) in added.iter().enumerate() {
        jacobian.column_mut(known.ncols() + k).copy_from_slice(column);
    }
    fit.jacobian = Some(jacobian);
    Some(Rival { candidate: start.candidate, fit })
}
