//! The same identification by other distances: which of them sees which parameter.

use crate::experiment::Experiment;
use crate::report::{ByDistance, error_percent};
use crate::run::{Run, RunError};
use btr_core::coevolve::{Coevolution, Entry, Plan, Step};
use btr_core::distance::{Distance, DistanceSpec};
use btr_core::space::Dim;
use btr_core::world::Simulator;
use indexmap::IndexMap;
use rayon::prelude::*;

/// Steps by which a parameter is moved until phi tells, in percent of its value.
const MOVES_PERCENT: [f64; 8] = [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 35.0, 50.0];
/// phi tells when it rises by more than this share of itself: less is lost in what else changes phi.
const TELLING_RISE: f64 = 0.02;

/// Repeats the search for the simulation with another distance, in a folder of its own below the run's.
///
/// # Errors
/// When the disk refuses, or a real test is gone.
pub fn with_distance(
    experiment: &mut Experiment,
    run: &Run,
    spec: &DistanceSpec,
    mut watch: impl FnMut(&Coevolution) -> bool,
) -> Result<Option<ByDistance>, RunError> {
    let plan = Plan { distance: spec.clone(), ..run.state().plan().clone() };
    let folder = run.folder().join("by_distance").join(spec.name());
    let mut other = Run::begin_or_resume(experiment, plan, &folder)?;
    loop {
        match other.step(experiment)? {
            Step::Stopped(_) => break,
            Step::Waiting(what) => return Err(RunError::LostTest(what)),
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
    let here = phi(experiment, state, distance.as_ref(), s);
    let resolution: Vec<Option<f64>> = (0..dims.len())
        .into_par_iter()
        .map(|k| {
            MOVES_PERCENT.into_iter().find(|percent| {
                let moved = |sign: f64| moved(s, k, &dims[k], 1.0 + sign * percent / 100.0);
                let phi = |sign: f64| phi(experiment, state, distance.as_ref(), &moved(sign));
                phi(1.0).min(phi(-1.0)) > here * (1.0 + TELLING_RISE)
            })
        })
        .collect();
    let iteration = state.history().iterations.last();
    ByDistance {
        distance: state.plan().distance.name().to_owned(),
        phi: [state.history().iterations.first().and_then(|i| i.phi_predicted).unwrap_or(f64::NAN), here],
        parameters: iteration.map(|i| i.parameters.clone()).unwrap_or_default(),
        error_percent: truth.map(|t| error_percent(model, s, &t)).unwrap_or_default(),
        resolution_percent: dims.iter().map(|d| d.name.clone()).zip(resolution).collect::<IndexMap<_, _>>(),
    }
}

fn moved(s: &[f64], k: usize, dim: &Dim, factor: f64) -> Vec<f64> {
    let mut moved = s.to_vec();
    moved[k] = (moved[k] * factor).clamp(dim.min, dim.max);
    moved
}

/// Mean distance over all real tests; infinite where a simulation fails.
fn phi(experiment: &Experiment, state: &Coevolution, distance: &dyn Distance, s: &[f64]) -> f64 {
    let tests: Vec<&Entry> = state.ledger().entries().iter().filter(|e| e.behaviour().is_some()).collect();
    let of = |e: &&Entry| {
        let real = e.behaviour()?;
        let simulated = experiment.model.run(s, &e.trial.controller, e.trial.scenario).ok()?;
        Some(distance.distance(real, &simulated))
    };
    tests.iter().map(|e| of(e).unwrap_or(f64::INFINITY)).sum::<f64>() / tests.len().max(1) as f64
}
