//! The same identification with other distances: how well each of them resolves each parameter.

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
use std::path::PathBuf;

/// Steps by which a parameter is moved until phi detects it, in percent of its value.
const STEPS_PERCENT: [f64; 5] = [1.0, 2.0, 5.0, 10.0, 25.0];
/// A negligible step: its effect on phi is the roughness of the landscape.
const NEGLIGIBLE_PERCENT: f64 = 0.1;
/// phi detects a move if it rises by more than this share of itself: less is within the sensors' noise. (White noise on
/// 50 000 samples moves the minimum of a sum of squares to where the square is higher by nine shares of 1/50 000, at
/// three sigma.)
const DETECTED_RISE: f64 = 1e-4;
/// It must also rise by more than this many times the effect of a negligible step.
const DETECTED_ROUGHNESS: f64 = 2.0;

/// Repeats the search for the simulation with another distance, the experiment's `number`th, in a subfolder of the
/// run's folder. Valid for fixed drives only: with a controller search, each distance would test other controllers.
///
/// # Errors
/// A failed write, or a real test whose log is missing.
pub fn with_distance(
    experiment: &mut Experiment,
    run: &Run,
    number: usize,
    spec: &DistanceSpec,
    mut watch: impl FnMut(&Coevolution) -> bool,
) -> Result<Option<ByDistance>, RunError> {
    // A goal for phi is in the unit of the plan's distance.
    let plan = Plan { distance: spec.clone(), phi_goal: None, ..run.state().plan().clone() };
    let folder = folder_of(run, &format!("{number}_{}", spec.name()))?;
    let mut other = Run::begin_or_resume(experiment, plan, &folder)?;
    loop {
        // If the folder is gone, so is that of the whole run, which is what has to be kept.
        match other.step(experiment).map_err(|error| run.check_folder().err().unwrap_or(error))? {
            StepOutcome::Stopped(_) => break,
            StepOutcome::Waiting(what) | StepOutcome::Unsafe(what) | StepOutcome::Storage(what) => {
                return Err(RunError::LostTest(what));
            }
            _ => {}
        }
        if !watch(other.state()) {
            return Ok(None);
        }
    }
    Ok(Some(found(experiment, other.state())))
}

/// The folder of one distance in the run's. Nothing is created if the run's is gone.
fn folder_of(run: &Run, name: &str) -> Result<PathBuf, RunError> {
    run.check_folder()?;
    let parts = run.folder().join("by_distance");
    let folder = parts.join(name);
    for path in [&parts, &folder] {
        let gone_or = |source| run.check_folder().err().unwrap_or(RunError::Io { path: path.clone(), source });
        btr_io::create_dir(path).map_err(gone_or)?;
    }
    Ok(folder)
}

/// The result of a finished identification, and the resolution of its distance in each parameter at the estimate.
pub fn found(experiment: &Experiment, state: &Coevolution) -> ByDistance {
    let (model, s) = (&experiment.model, state.simulation());
    let truth = experiment.reality.reveal();
    let distance = state.plan().distance.build();
    let dims = model.simulations().dims();
    let phi = |s: &[f64]| phi(experiment, state, distance.as_ref(), s);
    let phi_here = phi(s);
    let nudges: Vec<f64> = (0..2 * dims.len())
        .into_par_iter()
        .filter_map(|i| moved(s, i / 2, &dims[i / 2], sign(i) * NEGLIGIBLE_PERCENT))
        .map(|nudged| phi(&nudged))
        .collect();
    let telling = telling(phi_here, nudges);
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
        phi: [state.history().iterations.first().and_then(|i| i.phi_predicted).unwrap_or(f64::NAN), phi_here],
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

/// Evaluates every distance at the others' estimates. If phi there is as low as at its own estimate, or lower, the
/// distance cannot tell the two apart. This also detects parameters that compensate for each other although each single
/// move is detected.
pub fn confront(experiment: &Experiment, state: &Coevolution, found: &mut [ByDistance]) {
    let specs: Vec<&DistanceSpec> = std::iter::once(&state.plan().distance).chain(&experiment.distances).collect();
    let estimates: Vec<Vec<f64>> = found.iter().map(|by| by.parameters.values().copied().collect()).collect();
    for (i, (by, spec)) in found.iter_mut().zip(specs).enumerate() {
        let distance = spec.build();
        for other in estimates.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, other)| other) {
            if phi(experiment, state, distance.as_ref(), other) <= by.telling {
                let apart = estimates[i].iter().zip(other).map(|(a, b)| 100.0 * (b / a - 1.0).abs());
                by.resolution_percent
                    .values_mut()
                    .zip(apart)
                    .for_each(|(resolved, apart)| *resolved = coarser(*resolved, apart));
            }
        }
    }
}

/// The resolution, coarsened so that it exceeds a difference of `apart` percent.
fn coarser(resolved: Option<f64>, apart: f64) -> Option<f64> {
    resolved.and_then(|resolved| STEPS_PERCENT.into_iter().find(|percent| *percent >= resolved && *percent > apart))
}

fn sign(i: usize) -> f64 {
    if i.is_multiple_of(2) { 1.0 } else { -1.0 }
}

/// The phi above which a move counts as detected: a rise of twice the 90th percentile over negligible steps, and of a
/// share of phi.
///
/// Touchdowns that come a step earlier or later make phi rough. A rise that a negligible step also causes says nothing
/// about the parameter that was moved.
fn telling(phi_here: f64, mut nudges: Vec<f64>) -> f64 {
    nudges.sort_by(f64::total_cmp);
    let rough = nudges.get(nudges.len() * 9 / 10).copied().unwrap_or(phi_here);
    phi_here + (DETECTED_ROUGHNESS * (rough - phi_here)).max(DETECTED_RISE * phi_here)
}

/// The smallest move, in percent, such that phi detects it and every larger one in both directions; `None` if even the
/// largest is not detected. `phis` gives phi after a move up and down, as far as the bounds of S allow.
fn resolution(telling: f64, phis: impl Fn(f64) -> Vec<f64>) -> Option<f64> {
    let mut resolved = None;
    for percent in STEPS_PERCENT.into_iter().rev() {
        let phis = phis(percent);
        if phis.iter().any(|phi| *phi <= telling) {
            break;
        }
        resolved = if phis.is_empty() { resolved } else { Some(percent) };
    }
    resolved
}

/// The point with one parameter moved; `None` if that leaves its bounds.
fn moved(s: &[f64], k: usize, dim: &Dim, percent: f64) -> Option<Vec<f64>> {
    let value = s[k] * (1.0 + percent / 100.0);
    let mut moved = s.to_vec();
    moved[k] = value;
    (value.to_bits() != s[k].to_bits() && (dim.min..=dim.max).contains(&value)).then_some(moved)
}

/// Mean distance over all real tests; infinite if a simulation fails.
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

    /// A valley with its minimum at a move of `offset` percent.
    fn valley(offset: f64) -> impl Fn(f64) -> Vec<f64> {
        move |percent| vec![(percent - offset).abs(), (-percent - offset).abs()]
    }

    #[test]
    fn a_clean_valley_is_resolved_by_the_smallest_move() {
        assert_eq!(resolution(telling(0.0, vec![0.1; 16]), valley(0.0)), Some(1.0));
    }

    #[test]
    fn a_rise_that_a_negligible_step_also_causes_does_not_count() {
        assert_eq!(resolution(telling(0.0, vec![4.0; 16]), valley(0.0)), Some(10.0));
        assert_eq!(resolution(telling(0.0, vec![30.0; 16]), valley(0.0)), None);
        // A single outlier among the negligible steps is ignored.
        let mut nudges = vec![0.1; 20];
        nudges[3] = 30.0;
        assert_eq!(resolution(telling(0.0, nudges), valley(0.0)), Some(1.0));
    }

    #[test]
    fn a_minimum_at_another_value_coarsens_the_resolution() {
        assert_eq!(resolution(telling(3.0, vec![3.0]), valley(3.0)), Some(10.0));
    }

    #[test]
    fn a_flat_line_and_a_parameter_without_room_have_no_resolution() {
        assert_eq!(resolution(telling(1.0, vec![1.0]), |_| vec![1.0, 1.0]), None);
        assert_eq!(resolution(telling(1.0, vec![1.0]), |_| Vec::new()), None);
    }

    #[test]
    fn another_estimate_that_is_as_good_coarsens_the_resolution() {
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
