//! The same identification by other distances: which of them sees which parameter.

use super::folder::Run;
use super::report::{ByDistance, error_percent};
use super::run_error::RunError;
use crate::experiment::Experiment;
use btr_core::coevolve::{Coevolution, Entry, Plan, StepOutcome};
use btr_core::distance::{Distance, DistanceSpec};
use btr_core::space::Dim;
use btr_core::world::Simulator;
use indexmap::IndexMap;
use rayon::prelude::*;

/// Steps by which a parameter is moved until phi tells, in percent of its value.
const MOVES_PERCENT: [f64; 5] = [1.0, 2.0, 5.0, 10.0, 25.0];
/// A step too small to mean anything: what it does to phi is the roughness of the landscape.
const NUDGE_PERCENT: f64 = 0.1;
/// phi tells when it rises by more than this share of itself: less is within the sensors' noise. (White noise on 50 000
/// samples moves the minimum of a sum of squares to where the square is higher by nine shares of 1/50 000, at three sigma.)
const TELLING_RISE: f64 = 1e-4;
/// And by more than so many times what a nudge does.
const TELLING_NUDGES: f64 = 2.0;

/// Repeats the search for the simulation with another distance, the experiment's `number`th, in a folder of its own below
/// the run's. Sound for fixed drives only: elsewhere other controllers would be tried.
///
/// # Errors
/// When the disk refuses, or a real test is gone.
pub fn with_distance(
    experiment: &mut Experiment,
    run: &Run,
    (number, spec): (usize, &DistanceSpec),
    mut watch: impl FnMut(&Coevolution) -> bool,
) -> Result<Option<ByDistance>, RunError> {
    // A goal for phi is in the unit of the plan's own distance.
    let plan = Plan { distance: spec.clone(), phi_goal: None, ..run.state().plan().clone() };
    let folder = run.folder().join("by_distance").join(format!("{number}_{}", spec.name()));
    let mut other = Run::begin_or_resume(experiment, plan, &folder)?;
    loop {
        match other.step(experiment)? {
            StepOutcome::Stopped(_) => break,
            StepOutcome::Waiting(what) => return Err(RunError::LostTest(what)),
            _ => {}
        }
        if !watch(other.state()) {
            return Ok(None);
        }
    }
    Ok(Some(found(experiment, other.state())))
}

/// What a finished identification found, and how sharply its distance sees each parameter there.
pub fn found(experiment: &Experiment, state: &Coevolution) -> ByDistance {
    let (model, s) = (&experiment.model, state.simulation());
    let truth = experiment.reality.reveal();
    let distance = state.plan().distance.build();
    let dims = model.simulations().dims();
    let phi = |s: &[f64]| phi(experiment, state, distance.as_ref(), s);
    let here = phi(s);
    let nudges: Vec<f64> = (0..2 * dims.len())
        .into_par_iter()
        .filter_map(|i| moved(s, i / 2, &dims[i / 2], sign(i) * NUDGE_PERCENT))
        .map(|nudged| phi(&nudged))
        .collect();
    let telling = telling(here, nudges);
    let resolution: Vec<Option<f64>> = (0..dims.len())
        .into_par_iter()
        .map(|k| {
            let moves = |percent: f64| [0, 1].into_iter().filter_map(move |i| moved(s, k, &dims[k], sign(i) * percent));
            resolution(telling, |percent| moves(percent).map(|s| phi(&s)).collect())
        })
        .collect();
    let iteration = state.history().iterations.last();
    ByDistance {
        distance: state.plan().distance.name().to_owned(),
        phi: [state.history().iterations.first().and_then(|i| i.phi_predicted).unwrap_or(f64::NAN), here],
        parameters: iteration.map(|i| i.parameters.clone()).unwrap_or_default(),
        phi_of_truth: truth.as_ref().and_then(|truth| {
            let names = dims.iter().map(|d| truth.parameters.get(&d.name).copied());
            names.collect::<Option<Vec<f64>>>().map(|s| phi(&s))
        }),
        error_percent: truth.map(|t| error_percent(model, s, &t)).unwrap_or_default(),
        resolution_percent: dims.iter().map(|d| d.name.clone()).zip(resolution).collect::<IndexMap<_, _>>(),
        telling,
    }
}

/// Lets every distance judge the others' estimates: one that it likes as well as its own, or better, shows what it cannot
/// tell, also where parameters make up for each other and every move of a single one is told.
pub fn confront(experiment: &Experiment, state: &Coevolution, found: &mut [ByDistance]) {
    let specs: Vec<&DistanceSpec> = std::iter::once(&state.plan().distance).chain(&experiment.distances).collect();
    let estimates: Vec<Vec<f64>> = found.iter().map(|by| by.parameters.values().copied().collect()).collect();
    for (i, (by, spec)) in found.iter_mut().zip(specs).enumerate() {
        let distance = spec.build();
        for other in estimates.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, other)| other) {
            if phi(experiment, state, distance.as_ref(), other) <= by.telling {
                let apart = estimates[i].iter().zip(other).map(|(a, b)| 100.0 * (b / a - 1.0).abs());
                by.resolution_percent.values_mut().zip(apart).for_each(|(told, apart)| *told = coarser(*told, apart));
            }
        }
    }
}

/// A resolution that does not claim to tell `apart` percent.
fn coarser(told: Option<f64>, apart: f64) -> Option<f64> {
    told.and_then(|told| MOVES_PERCENT.into_iter().find(|percent| *percent >= told && *percent > apart))
}

fn sign(i: usize) -> f64 {
    if i.is_multiple_of(2) { 1.0 } else { -1.0 }
}

/// The phi above which a move has been told: it rises by twice as much as with nine in ten nudges, and by a share of itself.
///
/// Touchdowns that come a step earlier or later make phi rough. A rise that a meaningless nudge causes as well says nothing
/// about the parameter that was moved.
fn telling(here: f64, mut nudges: Vec<f64>) -> f64 {
    nudges.sort_by(f64::total_cmp);
    let rough = nudges.get(nudges.len() * 9 / 10).copied().unwrap_or(here);
    here + (TELLING_NUDGES * (rough - here)).max(TELLING_RISE * here)
}

/// The smallest move from which on phi tells every larger one too, in both directions, in percent; `None` when it overlooks
/// even the largest. `phis` gives phi after a move up and down, as far as the bounds of S leave room for it.
fn resolution(telling: f64, phis: impl Fn(f64) -> Vec<f64>) -> Option<f64> {
    let mut told = None;
    for percent in MOVES_PERCENT.into_iter().rev() {
        let phis = phis(percent);
        if phis.iter().any(|phi| *phi <= telling) {
            break;
        }
        told = if phis.is_empty() { told } else { Some(percent) };
    }
    told
}

/// The point with one parameter moved; `None` where that leaves its bounds.
fn moved(s: &[f64], k: usize, dim: &Dim, percent: f64) -> Option<Vec<f64>> {
    let value = s[k] * (1.0 + percent / 100.0);
    let mut moved = s.to_vec();
    moved[k] = value;
    (value.to_bits() != s[k].to_bits() && (dim.min..=dim.max).contains(&value)).then_some(moved)
}

/// Mean distance over all real tests; infinite where a simulation fails.
fn phi(experiment: &Experiment, state: &Coevolution, distance: &dyn Distance, s: &[f64]) -> f64 {
    let tests: Vec<&Entry> = state.ledger().entries().iter().filter(|e| e.behaviour().is_some()).collect();
    let of = |e: &&Entry| {
        let real = e.behaviour()?;
        let simulated = experiment.model.run(s, &e.trial.controller, e.trial.scenario).ok()?;
        Some(distance.distance(real, &simulated))
    };
    tests.iter().map(|e| of(e).unwrap_or(f64::INFINITY)).sum::<f64>() / tests.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A valley with its floor at a move of `offset` percent.
    fn valley(offset: f64) -> impl Fn(f64) -> Vec<f64> {
        move |percent| vec![(percent - offset).abs(), (-percent - offset).abs()]
    }

    #[test]
    fn a_clean_valley_is_seen_at_the_first_move() {
        assert_eq!(resolution(telling(0.0, vec![0.1; 16]), valley(0.0)), Some(1.0));
    }

    #[test]
    fn what_a_nudge_does_as_well_tells_nothing() {
        assert_eq!(resolution(telling(0.0, vec![4.0; 16]), valley(0.0)), Some(10.0));
        assert_eq!(resolution(telling(0.0, vec![30.0; 16]), valley(0.0)), None);
        // One bad nudge in ten is an accident.
        let mut nudges = vec![0.1; 20];
        nudges[3] = 30.0;
        assert_eq!(resolution(telling(0.0, nudges), valley(0.0)), Some(1.0));
    }

    #[test]
    fn a_lower_floor_elsewhere_is_not_seen_past() {
        assert_eq!(resolution(telling(3.0, vec![3.0]), valley(3.0)), Some(10.0));
    }

    #[test]
    fn a_flat_line_is_unseen_and_so_is_a_parameter_without_room() {
        assert_eq!(resolution(telling(1.0, vec![1.0]), |_| vec![1.0, 1.0]), None);
        assert_eq!(resolution(telling(1.0, vec![1.0]), |_| Vec::new()), None);
    }

    #[test]
    fn another_estimate_that_is_as_good_coarsens_the_claim() {
        assert_eq!(coarser(Some(1.0), 0.3), Some(1.0));
        assert_eq!(coarser(Some(1.0), 7.0), Some(10.0));
        assert_eq!(coarser(Some(25.0), 7.0), Some(25.0));
        assert_eq!((coarser(Some(1.0), 40.0), coarser(None, 0.1)), (None, None));
    }

    #[test]
    fn one_sided_room_is_enough() {
        assert_eq!(resolution(telling(0.0, Vec::new()), |percent| vec![percent]), Some(1.0));
    }
}
