//! Predictions for the controllers of a map, by the real tests so far.

use super::descriptor::DescriptorAxis;
use super::gaussian_process::{GaussianProcess, KernelSettings};
use super::phase::MapPhase;
use crate::coevolve::ledger::Entry;
use crate::search::map_elites::Elite;
use crate::search::{MapElites, UnitPoint};
use crate::signal::stats;
use crate::signal::student::student_95;
use crate::world::Simulator;
use serde::Serialize;

/// A controller of the map with its prediction.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Promise {
    /// The controller in the units of C.
    pub controller: Vec<f64>,
    /// Of what kind it is, in the units of the map's axes; what lies outside their bounds is on the edge.
    pub descriptor: Vec<f64>,
    /// Its fitness in the simulation the map was made in.
    pub simulated: f64,
    /// The fitness it promises in reality, by all real tests so far.
    pub promised: f64,
    /// 95 % prediction interval of a real test's fitness.
    pub promised_ci95: Option<[f64; 2]>,
    /// Its real fitness, the mean over its scenarios; `None` where it was not tried, or a test of it failed.
    pub real: Option<f64>,
    #[serde(skip)]
    pub(in crate::coevolve) unit: UnitPoint,
    #[serde(skip)]
    deviation: f64,
    #[serde(skip)]
    tried: bool,
}

/// A map and its predictions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outlook {
    /// How many cells it has.
    pub cells: u64,
    /// The controllers of those that are filled, in the order of the cells.
    pub elites: Vec<Promise>,
}

/// Result of a controller's real tests: no test, a failure, or its fitness.
enum TestResult {
    Never,
    Failed,
    Real(f64),
}

impl Outlook {
    /// By these real tests. One that failed counts as no better than the worst of the map.
    pub(in crate::coevolve) fn of(
        map: &MapElites,
        phase: &MapPhase,
        simulator: &dyn Simulator,
        tests: &[&Entry],
    ) -> Self {
        let axes = phase.axes(simulator);
        let known: Vec<(&Elite, Vec<f64>, TestResult)> = map
            .elites()
            .map(|(_, elite)| {
                let controller = simulator.controllers().from_unit(&elite.unit);
                let tried = tried(&controller, tests);
                (elite, controller, tried)
            })
            .collect();
        let simulated: Vec<f64> = known.iter().map(|(elite, ..)| -elite.cost).collect();
        let least = simulated.iter().copied().fold(f64::INFINITY, f64::min);
        let differences: Vec<(&[f64], f64)> = known
            .iter()
            .filter_map(|(elite, _, tried)| match tried {
                TestResult::Never => None,
                TestResult::Failed => Some((elite.descriptor.as_slice(), least + elite.cost)),
                TestResult::Real(real) => Some((elite.descriptor.as_slice(), real + elite.cost)),
            })
            .collect();
        // Before any test, reality may differ from the map by as much as the map's controllers do from each other.
        let kernel = KernelSettings { length_scale: phase.length_scale, noise: phase.noise };
        let process = GaussianProcess::new(kernel, stats::std(&simulated), &differences);
        let elites =
            known.into_iter().map(|(elite, controller, tried)| promise(&process, &axes, elite, controller, &tried));
        Outlook { cells: map.grid().count(), elites: elites.collect() }
    }

    /// The controller to try next, of those that were not tried yet: the largest prediction plus `explore` standard
    /// deviations. The first one among equals.
    pub(in crate::coevolve) fn next(&self, explore: f64) -> Option<&Promise> {
        let worth = |promise: &Promise| promise.promised + explore * promise.deviation;
        let untried = self.elites.iter().filter(|promise| !promise.tried);
        untried.reduce(|best, other| if worth(other) > worth(best) { other } else { best })
    }

    /// Whether nothing is left to try, or the best real fitness is at least the share `enough` of the largest
    /// prediction.
    pub(in crate::coevolve) fn satisfied(&self, enough: f64) -> bool {
        let most = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::NEG_INFINITY, f64::max);
        let real = most(&mut self.elites.iter().filter_map(|promise| promise.real));
        let promised = most(&mut self.elites.iter().map(|promise| promise.promised));
        self.elites.iter().all(|promise| promise.tried) || real >= promised - (1.0 - enough) * promised.abs()
    }

    /// The prediction for a point of the unit cube, if it is in the map.
    pub(in crate::coevolve) fn promise(&self, unit: &[f64]) -> Option<&Promise> {
        self.elites.iter().find(|promise| promise.unit == unit)
    }
}

fn tried(controller: &[f64], tests: &[&Entry]) -> TestResult {
    let mine = tests.iter().filter(|entry| entry.trial.controller == controller);
    let fitness: Option<Vec<f64>> = mine.map(|entry| entry.fitness().filter(|f| f.is_finite())).collect();
    match fitness.as_deref() {
        None => TestResult::Failed,
        Some([]) => TestResult::Never,
        Some(fitness) => TestResult::Real(stats::mean(fitness)),
    }
}

fn promise(
    process: &GaussianProcess,
    axes: &[DescriptorAxis],
    elite: &Elite,
    controller: Vec<f64>,
    tried: &TestResult,
) -> Promise {
    let (difference, deviation) = process.at(&elite.descriptor);
    let promised = difference - elite.cost;
    let half = student_95(process.numbers()).map(|t| t * process.of_a_test(deviation));
    Promise {
        controller,
        descriptor: axes.iter().zip(&elite.descriptor).map(|(axis, u)| axis.value(*u)).collect(),
        simulated: -elite.cost,
        promised,
        promised_ci95: half.map(|half| [promised - half, promised + half]),
        real: if let TestResult::Real(real) = tried { Some(*real) } else { None },
        unit: elite.unit.clone(),
        deviation,
        tried: !matches!(tried, TestResult::Never),
    }
}
