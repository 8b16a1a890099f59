//! Evaluating populations: in parallel, in order, the same bits for any number of threads.
//!
//! A simulation that diverges scores as the worst possible. One that was cancelled ends the evaluation instead: a
//! search must not take it for a bad candidate.

use super::ledger::Entry;
use crate::distance::{Distance, SumOfSquares};
use crate::optimize::Residuals;
use crate::parallel::side_by_side;
use crate::search::UnitPoint;
use crate::world::{
    Behaviour, Cancelled, Compared, Job, Output, OutputRequest, Reference, Simulator, Trial, WorldError,
};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Number of simulations of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Cost {
    /// Simulated behaviours.
    pub evaluations: u64,
    /// Those that diverged or were refused; they score as the worst possible.
    pub failures: u64,
}

impl Cost {
    pub(super) fn add(&mut self, other: Cost) {
        self.evaluations += other.evaluations;
        self.failures += other.failures;
    }

    pub(super) fn count<T>(&mut self, results: &[Result<T, WorldError>]) {
        self.evaluations += results.len() as u64;
        self.failures += results.iter().filter(|r| r.is_err()).count() as u64;
    }
}

/// The mean fitness of each controller over all scenarios of a simulation; −∞ where one of them failed.
pub(super) fn fitness(
    simulator: &dyn Simulator,
    s: &[f64],
    controllers: &[UnitPoint],
    cost: &mut Cost,
) -> Result<Vec<f64>, Cancelled> {
    Ok(fitness_in(simulator, std::slice::from_ref(&s.to_vec()), controllers, cost)?.concat())
}

/// The same in each of some simulations: a row per controller.
pub(super) fn fitness_in(
    simulator: &dyn Simulator,
    simulations: &[Vec<f64>],
    controllers: &[UnitPoint],
    cost: &mut Cost,
) -> Result<Vec<Vec<f64>>, Cancelled> {
    let (scenarios, per_controller) = (simulator.scenarios(), simulations.len() * simulator.scenarios());
    let points: Vec<Vec<f64>> = controllers.iter().map(|u| simulator.controllers().from_unit(u)).collect();
    let job = |k: usize| {
        let within = k % per_controller;
        Job { s: &simulations[within / scenarios], c: &points[k / per_controller], scenario: within % scenarios }
    };
    let jobs: Vec<Job> = (0..points.len() * per_controller).map(job).collect();
    let outputs = evaluate_all(simulator, &jobs, &vec![OutputRequest::Fitness; jobs.len()])?;
    let of = |output| if let Output::Fitness(fitness) = output { fitness } else { f64::NAN };
    let results: Vec<Result<f64, WorldError>> = outputs.into_iter().map(|output| output.map(of)).collect();
    cost.count(&results);
    let row = |row: &[Result<f64, WorldError>]| row.chunks(scenarios).map(mean_fitness).collect();
    Ok(results.chunks(per_controller).map(row).collect())
}

/// A quantile of each controller's fitness over some simulations; −∞ where simulations that failed reach up to it.
pub(super) fn fitness_over(
    simulator: &dyn Simulator,
    simulations: &[Vec<f64>],
    controllers: &[UnitPoint],
    quantile: f64,
    cost: &mut Cost,
) -> Result<Vec<f64>, Cancelled> {
    let rows = fitness_in(simulator, simulations, controllers, cost)?;
    Ok(rows.into_iter().map(|row| quantile_of(row, quantile)).collect())
}

/// Between the two values next to it where it lies between them.
fn quantile_of(mut values: Vec<f64>, quantile: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let place = quantile * (values.len() - 1) as f64;
    let (below, above) = (values[place.floor() as usize], values[place.ceil() as usize]);
    if below.is_finite() { below + (place - place.floor()) * (above - below) } else { f64::NEG_INFINITY }
}

/// Behaviours of one controller in one scenario under an ensemble of simulations; `None` where one failed.
pub(super) fn behaviours(
    simulator: &dyn Simulator,
    simulations: &[Vec<f64>],
    controller: &UnitPoint,
    scenario: usize,
    cost: &mut Cost,
) -> Result<Vec<Option<Behaviour>>, Cancelled> {
    let c = simulator.controllers().from_unit(controller);
    let jobs: Vec<Job> = simulations.iter().map(|s| Job { s, c: &c, scenario }).collect();
    let outputs = evaluate_all(simulator, &jobs, &vec![OutputRequest::Behaviour; jobs.len()])?;
    cost.count(&outputs);
    let behaviour = |output| if let Ok(Output::Behaviour(behaviour)) = output { Some(behaviour) } else { None };
    Ok(outputs.into_iter().map(behaviour).collect())
}

/// Runs all jobs, those of each scenario side by side, and returns the requested output of each, in their order.
pub(super) fn evaluate_all(
    simulator: &dyn Simulator,
    jobs: &[Job],
    requests: &[OutputRequest],
) -> Result<Vec<Result<Output, WorldError>>, Cancelled> {
    let mut order: Vec<usize> = (0..jobs.len()).collect();
    order.sort_by_key(|&k| jobs[k].scenario);
    let few = |ks: &[usize]| {
        let these: (Vec<Job>, Vec<OutputRequest>) = ks.iter().map(|&k| (jobs[k], requests[k])).unzip();
        simulator.evaluate_all(&these.0, &these.1).into_iter().zip(ks.to_vec())
    };
    let at_once = side_by_side(simulator.side_by_side(), jobs.len());
    let mut results: Vec<_> = order.par_chunks(at_once).with_max_len(1).flat_map_iter(few).collect();
    results.sort_by_key(|(_, k)| *k);
    let kept = |(output, _)| match output {
        Err(WorldError::Cancelled(cancelled)) => Err(cancelled),
        output => Ok(output),
    };
    results.into_iter().map(kept).collect()
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
) -> Result<Vec<Vec<f64>>, Cancelled> {
    if tests.is_empty() {
        return Ok(vec![Vec::new(); simulations.len()]);
    }
    let compare = |real: &Behaviour, simulated: &Behaviour| Compared {
        distance: distance.distance(real, simulated),
        residuals: None,
    };
    let results = compare_all(simulator, simulations, tests, Comparison::Distance, &compare)?;
    cost.count(&results);
    let one =
        |compared: &Result<Compared, WorldError>| compared.as_ref().map_or(f64::INFINITY, |c| worst_if_nan(c.distance));
    Ok(results.chunks(tests.len()).map(|row| row.iter().map(one).collect()).collect())
}

/// A distance that is a sum of squares, in both of its forms.
#[derive(Clone, Copy)]
pub(super) struct ResidualDistance<'a> {
    distance: &'a dyn Distance,
    squares: &'a dyn SumOfSquares,
}

impl<'a> ResidualDistance<'a> {
    /// `None` for a distance that is not a sum of squares.
    pub(super) fn of(distance: &'a dyn Distance) -> Option<Self> {
        distance.as_squares().map(|squares| ResidualDistance { distance, squares })
    }
}

/// Output of a comparison with a real test.
#[derive(Clone, Copy, PartialEq)]
enum Comparison {
    /// The distance alone.
    Distance,
    /// The distance and the residuals.
    Residuals,
}

/// How far each simulation is from the real tests, as phi and as residuals; ∞ and `None` where it failed on any of
/// them.
pub(super) fn residuals(
    simulator: &dyn Simulator,
    distance: ResidualDistance<'_>,
    simulations: &[Vec<f64>],
    tests: &[&Entry],
    cost: &mut Cost,
) -> Result<Vec<(f64, Option<Residuals>)>, Cancelled> {
    let compare = |real: &Behaviour, simulated: &Behaviour| Compared {
        distance: distance.distance.distance(real, simulated),
        residuals: Some(distance.squares.residuals(real, simulated)),
    };
    let results = compare_all(simulator, simulations, tests, Comparison::Residuals, &compare)?;
    cost.count(&results);
    let mut results = results.into_iter().map(|compared| compared.unwrap_or_else(|_| no_behaviour()));
    let one_simulation = |_: &Vec<f64>| {
        let of_tests = results.by_ref().take(tests.len()).map(|compared| (compared.distance, compared.residuals));
        let (distances, blocks): (Vec<f64>, Vec<Option<Residuals>>) = of_tests.unzip();
        (phi(&distances), blocks.into_iter().collect::<Option<Vec<_>>>().map(|tests| tests.concat()))
    };
    Ok(simulations.iter().map(one_simulation).collect())
}

/// An infinite distance: nothing to compare with.
fn no_behaviour() -> Compared {
    Compared { distance: f64::INFINITY, residuals: None }
}

/// Compares every simulation with every real test: a row per simulation. Tests without a behaviour are infinitely far.
fn compare_all(
    simulator: &dyn Simulator,
    simulations: &[Vec<f64>],
    tests: &[&Entry],
    comparison: Comparison,
    compare: &(dyn Fn(&Behaviour, &Behaviour) -> Compared + Sync),
) -> Result<Vec<Result<Compared, WorldError>>, Cancelled> {
    let (mut which, mut requested) = (Vec::new(), Vec::new());
    for (k, (s, entry)) in simulations.iter().flat_map(|s| tests.iter().map(move |entry| (s, entry))).enumerate() {
        let Some(real) = entry.behaviour() else { continue };
        let Trial { number: test, controller, scenario, .. } = &entry.trial;
        which.push(k);
        let against = Reference { test: *test, real, squares: comparison == Comparison::Residuals, compare };
        requested.push((Job { s, c: controller, scenario: *scenario }, OutputRequest::Distance(against)));
    }
    let (jobs, requests): (Vec<Job>, Vec<OutputRequest>) = requested.into_iter().unzip();
    let mut results: Vec<_> = (0..simulations.len() * tests.len()).map(|_| Ok(no_behaviour())).collect();
    for (k, output) in which.into_iter().zip(evaluate_all(simulator, &jobs, &requests)?) {
        results[k] =
            output.map(|output| if let Output::Distance(compared) = output { compared } else { no_behaviour() });
    }
    Ok(results)
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
    controllers: &[UnitPoint],
    cost: &mut Cost,
) -> Result<Vec<f64>, Cancelled> {
    let (scenarios, per_controller) = (simulator.scenarios(), rivals.len() * simulator.scenarios());
    let points: Vec<Vec<f64>> = controllers.iter().map(|u| simulator.controllers().from_unit(u)).collect();
    let job = |k: usize| {
        let within = k % per_controller;
        Job { s: &rivals[within / scenarios], c: &points[k / per_controller], scenario: within % scenarios }
    };
    let jobs: Vec<Job> = (0..points.len() * per_controller).map(job).collect();
    let outputs = evaluate_all(simulator, &jobs, &vec![OutputRequest::Behaviour; jobs.len()])?;
    let failed = || WorldError::Setup { what: "no behaviour came back".to_owned() };
    let of = |output| if let Output::Behaviour(behaviour) = output { Ok(behaviour) } else { Err(failed()) };
    let results: Vec<Result<Behaviour, WorldError>> = outputs.into_iter().map(|output| output.and_then(of)).collect();
    cost.count(&results);
    Ok(results.par_chunks(per_controller).map(|row| mean_pairwise(distance, row, scenarios)).collect())
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
