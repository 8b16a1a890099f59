//! Evaluating populations: in parallel, in order, the same bits for any number of threads.

use super::ledger::Entry;
use crate::distance::{Distance, SumOfSquares};
use crate::parallel::side_by_side;
use crate::search::{Residuals, Unit};
use crate::world::{Behaviour, Job, Simulator, WorldError};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// What the simulations of a run have cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Cost {
    /// Simulated behaviours.
    pub evaluations: u64,
    /// Those that blew up or were refused; they score as the worst possible.
    pub failures: u64,
}

impl Cost {
    fn count<T>(&mut self, results: &[Result<T, WorldError>]) {
        self.evaluations += results.len() as u64;
        self.failures += results.iter().filter(|r| r.is_err()).count() as u64;
    }
}

/// The mean fitness of each controller over all scenarios of a simulation; −∞ where one of them failed.
pub(super) fn fitness(simulator: &dyn Simulator, s: &[f64], controllers: &[Unit], cost: &mut Cost) -> Vec<f64> {
    let scenarios = simulator.scenarios();
    let points: Vec<Vec<f64>> = controllers.iter().map(|u| simulator.controllers().from_unit(u)).collect();
    let job = |k: usize| Job { s, c: &points[k / scenarios], scenario: k % scenarios };
    let jobs: Vec<Job> = (0..points.len() * scenarios).map(job).collect();
    let results = run_all(simulator, &jobs, |_, behaviour| behaviour.fitness);
    cost.count(&results);
    results.chunks(scenarios).map(mean_fitness).collect()
}

/// Runs all jobs, those of each scenario side by side, and makes something of what comes of each (by its number), in their order.
fn run_all<T: Send>(
    simulator: &dyn Simulator,
    jobs: &[Job],
    make: impl Fn(usize, Behaviour) -> T + Sync,
) -> Vec<Result<T, WorldError>> {
    let mut order: Vec<usize> = (0..jobs.len()).collect();
    order.sort_by_key(|&k| jobs[k].scenario);
    let few = |ks: &[usize]| {
        let these: Vec<Job> = ks.iter().map(|&k| jobs[k]).collect();
        let made = simulator.run_all(&these).into_iter().zip(ks);
        made.map(|(behaviour, &k)| (k, behaviour.map(|behaviour| make(k, behaviour)))).collect::<Vec<_>>()
    };
    let at_once = side_by_side(simulator.side_by_side(), jobs.len());
    let mut results: Vec<_> = order.par_chunks(at_once).flat_map_iter(few).collect();
    results.sort_by_key(|(k, _)| *k);
    results.into_iter().map(|(_, result)| result).collect()
}

fn mean_fitness(results: &[Result<f64, WorldError>]) -> f64 {
    let sum: f64 = results.iter().map(|r| r.as_ref().map_or(f64::NEG_INFINITY, |f| *f)).sum();
    let mean = sum / results.len() as f64;
    if mean.is_nan() { f64::NEG_INFINITY } else { mean }
}

/// The distance of each simulation from each real test: one row per simulation, ∞ where it failed.
pub(super) fn distances(
    simulator: &dyn Simulator,
    distance: &dyn Distance,
    simulations: &[Vec<f64>],
    tests: &[&Entry],
    cost: &mut Cost,
) -> Vec<Vec<f64>> {
    if tests.is_empty() {
        return vec![Vec::new(); simulations.len()];
    }
    let results = beside(simulator, simulations, tests, |real, simulated| distance.distance(real, simulated));
    let results: Vec<Result<f64, WorldError>> =
        results.into_iter().map(|r| r.map(|d| d.unwrap_or(f64::INFINITY))).collect();
    cost.count(&results);
    results
        .chunks(tests.len())
        .map(|row| row.iter().map(|r| r.as_ref().map_or(f64::INFINITY, |d| worst_if_nan(*d))).collect())
        .collect()
}

/// How far each simulation is from the real tests, as phi and as residuals; ∞ and `None` where it failed on any of them.
pub(super) fn residuals(
    simulator: &dyn Simulator,
    (distance, squares): (&dyn Distance, &dyn SumOfSquares),
    simulations: &[Vec<f64>],
    tests: &[&Entry],
    cost: &mut Cost,
) -> Vec<(f64, Option<Residuals>)> {
    let both = |real: &Behaviour, simulated: &Behaviour| {
        (distance.distance(real, simulated), Some(squares.residuals(real, simulated)))
    };
    let results = beside(simulator, simulations, tests, both);
    let results: Vec<Result<(f64, Option<Residuals>), WorldError>> =
        results.into_iter().map(|r| r.map(|both| both.unwrap_or((f64::INFINITY, None)))).collect();
    cost.count(&results);
    let mut results = results.into_iter().map(|r| r.unwrap_or((f64::INFINITY, None)));
    let one_simulation = |_: &Vec<f64>| {
        let (distances, blocks): (Vec<f64>, Vec<Option<Residuals>>) = results.by_ref().take(tests.len()).unzip();
        (phi(&distances), blocks.into_iter().collect::<Option<Vec<_>>>().map(|tests| tests.concat()))
    };
    simulations.iter().map(one_simulation).collect()
}

/// Compares every simulation with every real test: a row per simulation. Nothing comes of tests that gave no behaviour.
fn beside<T: Send>(
    simulator: &dyn Simulator,
    simulations: &[Vec<f64>],
    tests: &[&Entry],
    compare: impl Fn(&Behaviour, &Behaviour) -> T + Sync,
) -> Vec<Result<Option<T>, WorldError>> {
    let all = (0..simulations.len() * tests.len()).map(|k| (k, &simulations[k / tests.len()], tests[k % tests.len()]));
    let done: Vec<(usize, &Behaviour, Job)> = all
        .filter_map(|(k, s, test)| {
            let job = Job { s, c: &test.trial.controller, scenario: test.trial.scenario };
            Some((k, test.behaviour()?, job))
        })
        .collect();
    let jobs: Vec<Job> = done.iter().map(|(_, _, job)| *job).collect();
    let compared = run_all(simulator, &jobs, |k, simulated| compare(done[k].1, &simulated));
    let mut results: Vec<Result<Option<T>, WorldError>> =
        (0..simulations.len() * tests.len()).map(|_| Ok(None)).collect();
    for ((k, _, _), result) in done.iter().zip(compared) {
        results[*k] = result.map(Some);
    }
    results
}

/// phi: the mean distance over the tests (eq 4 for phi_1); NaN when there is none.
pub fn phi(distances: &[f64]) -> f64 {
    distances.iter().sum::<f64>() / distances.len() as f64
}

fn worst_if_nan(x: f64) -> f64 {
    if x.is_nan() { f64::INFINITY } else { x }
}

/// How much rival simulations disagree on each controller: the mean distance between their behaviours, over all ordered
/// pairs and scenarios. −∞ where one of them failed.
pub(super) fn disagreement(
    simulator: &dyn Simulator,
    distance: &dyn Distance,
    rivals: &[Vec<f64>],
    controllers: &[Unit],
    cost: &mut Cost,
) -> Vec<f64> {
    let (scenarios, per_controller) = (simulator.scenarios(), rivals.len() * simulator.scenarios());
    let points: Vec<Vec<f64>> = controllers.iter().map(|u| simulator.controllers().from_unit(u)).collect();
    let job = |k: usize| {
        let within = k % per_controller;
        Job { s: &rivals[within / scenarios], c: &points[k / per_controller], scenario: within % scenarios }
    };
    let jobs: Vec<Job> = (0..points.len() * per_controller).map(job).collect();
    let results = run_all(simulator, &jobs, |_, behaviour| behaviour);
    cost.count(&results);
    results.par_chunks(per_controller).map(|row| mean_pairwise(distance, row, scenarios)).collect()
}

fn mean_pairwise(distance: &dyn Distance, row: &[Result<Behaviour, WorldError>], scenarios: usize) -> f64 {
    let Ok(behaviours) = row.iter().map(Result::as_ref).collect::<Result<Vec<_>, _>>() else {
        return f64::NEG_INFINITY;
    };
    let rivals = behaviours.len() / scenarios;
    let (mut sum, mut pairs) = (0.0, 0usize);
    for (i, j) in (0..rivals).flat_map(|i| (0..rivals).filter(move |&j| j != i).map(move |j| (i, j))) {
        for k in 0..scenarios {
            sum += distance.distance(behaviours[i * scenarios + k], behaviours[j * scenarios + k]);
            pairs += 1;
        }
    }
    let mean = sum / pairs.max(1) as f64;
    if mean.is_finite() { mean } else { f64::NEG_INFINITY }
}
