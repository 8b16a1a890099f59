//! The report of a run as one document: `history.json`, `--json` and the tables of the terminal are views of it.

use super::augment::Cause;
use super::doubts::{TestDoubt, doubts};
use crate::experiment::Experiment;
use crate::reality::Revealed;
use btr_core::coevolve::{
    Augmentation, Coevolution, Drift, Entry, Generation, Iteration, Outlook, RealityGap, StopReason,
};
use btr_core::log::{Log, Role};
use btr_core::world::{Simulator, WorldError};
use btr_physics::model::Model;
use indexmap::IndexMap;
use serde::Serialize;

/// A finished (or stopped) run.
#[derive(Clone, Debug, Serialize)]
pub struct RunReport {
    /// Always true: failures have another document.
    pub ok: bool,
    /// The experiment.
    pub name: String,
    /// Its seed.
    pub seed: u64,
    /// Weights of the fitness by term; empty if controllers are not judged.
    pub fitness: IndexMap<String, f64>,
    /// One record per iteration.
    pub iterations: Vec<Iteration>,
    /// Why the run ended; `None` while it waits for real tests.
    pub stop_reason: Option<StopReason>,
    /// Whether the evidence speaks for disengagement, with or without stopping.
    pub disengaged: bool,
    /// Cause of the disengagement according to the real tests; the last diagnosis if there were several.
    pub diagnosis: Option<Cause>,
    /// How S has grown.
    pub augmentations: Vec<Augmentation>,
    /// How the robot has changed during the run.
    pub drifts: Vec<Drift>,
    /// Number of the last real test, if nothing explains it together with the earlier ones and the reason is unknown.
    pub suspicion: Option<usize>,
    /// Real tests spent, failed ones included.
    pub real_tests: usize,
    /// Real fitness minus predicted fitness over the real tests.
    pub reality_gap: Option<RealityGap>,
    /// Simulated behaviours.
    pub simulated_evaluations: u64,
    /// Simulated behaviours that diverged.
    pub failed_evaluations: u64,
    /// The controller with the best real fitness.
    pub recommended: Option<Recommended>,
    /// The hidden twin, if reality was one.
    pub revealed: Option<TwinComparison>,
    /// Errors on recorded logs, before and after.
    pub logs: Vec<LogScore>,
    /// The same identification by other distances.
    pub by_distance: Vec<ByDistance>,
    /// The map of controllers, where the method makes one.
    pub map: Option<MapReport>,
    /// The ledger of real tests.
    pub tests: Vec<Entry>,
    /// Findings about the real tests.
    pub doubts: Vec<TestDoubt>,
    /// Every generation.
    pub generations: Vec<Generation>,
}

/// The controllers of `quality_diversity`, each the fittest of its cell, with their predictions given the real tests.
#[derive(Clone, Debug, Serialize)]
pub struct MapReport {
    /// The axes by name, with their lower and upper ends.
    pub descriptors: IndexMap<String, [f64; 2]>,
    /// Cells that have a controller.
    pub filled: usize,
    /// Cells and controllers.
    #[serde(flatten)]
    pub outlook: Outlook,
}

/// A controller that was tried and is recommended.
#[derive(Clone, Debug, Serialize)]
pub struct Recommended {
    /// The real test.
    pub test: usize,
    /// Its real fitness.
    pub fitness_real: f64,
    /// Its parameters by name.
    pub controller: IndexMap<String, f64>,
}

/// The hidden twin compared with the estimate.
#[derive(Clone, Debug, Serialize)]
pub struct TwinComparison {
    /// The truth.
    #[serde(flatten)]
    pub truth: Revealed,
    /// Error of the estimate in percent of the truth, by parameter.
    pub error_percent: IndexMap<String, f64>,
    /// The same for the simulation the run started from.
    pub error_percent_before: IndexMap<String, f64>,
    /// Root mean square of X_s − X_r over the state the twin shows (eqs 1 and 2), by unit, for the recommended
    /// controller.
    pub state_match: IndexMap<String, f64>,
}

/// How well a model reproduces one recorded log.
#[derive(Clone, Debug, Serialize)]
pub struct LogScore {
    /// The log.
    pub log: String,
    /// Whether the log was held out from the search.
    pub held_out: bool,
    /// The joint channel.
    pub channel: String,
    /// Its unit.
    pub unit: String,
    /// With the starting simulation.
    pub before: ChannelScore,
    /// With the simulation found.
    pub after: ChannelScore,
}

/// Errors of a simulated channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ChannelScore {
    /// Mean absolute error.
    pub mean_abs: f64,
    /// Root mean square error.
    pub rmse: f64,
    /// 100·(1 − ‖error‖/‖measured − its mean‖).
    pub fit_percent: f64,
}

/// What another distance found on the same real tests.
#[derive(Clone, Debug, Serialize)]
pub struct ByDistance {
    /// The distance.
    pub distance: String,
    /// phi at the start and at the end, in the distance's own unit.
    pub phi: [f64; 2],
    /// The estimate, in the units of S.
    pub parameters: IndexMap<String, f64>,
    /// Error in percent of the truth, where the truth is known.
    pub error_percent: IndexMap<String, f64>,
    /// Resolution of each parameter in percent of its value: the smallest move that phi detects, of the parameter alone
    /// or towards another distance's estimate. `None` if phi does not detect a move by a quarter; the estimate is then
    /// meaningless.
    pub resolution_percent: IndexMap<String, Option<f64>>,
    /// The phi above which a simulation is distinguishable from this one.
    pub telling: f64,
    /// phi of the true parameters, if known: above `telling`, the distance prefers a wrong simulation.
    pub phi_of_truth: Option<f64>,
}

/// Assembles the report of a run.
///
/// # Errors
/// A simulation for the report that diverges.
pub fn report(
    experiment: &Experiment,
    state: &Coevolution,
    stop_reason: Option<StopReason>,
    diagnosis: Option<Cause>,
    by_distance: Vec<ByDistance>,
) -> Result<RunReport, WorldError> {
    Ok(RunReport {
        ok: true,
        name: experiment.name.clone(),
        seed: experiment.seed,
        fitness: experiment.model.fitness.weights(),
        iterations: state.history().iterations.clone(),
        stop_reason,
        disengaged: state.disengaged(),
        diagnosis,
        augmentations: state.history().augmentations.clone(),
        drifts: state.history().drifts.clone(),
        suspicion: state.suspicion().map(|entry| entry.trial.number),
        reality_gap: RealityGap::of(state.ledger()),
        real_tests: state.ledger().spent(),
        simulated_evaluations: state.cost().evaluations,
        failed_evaluations: state.cost().failures,
        recommended: recommended(experiment, state),
        revealed: experiment.reality.reveal().map(|truth| comparison(experiment, state, truth)).transpose()?,
        logs: log_scores(experiment, state)?,
        by_distance,
        map: map(experiment, state),
        tests: state.ledger().entries().to_vec(),
        doubts: doubts(experiment, state.ledger().entries()),
        generations: state.history().generations.clone(),
    })
}

fn map(experiment: &Experiment, state: &Coevolution) -> Option<MapReport> {
    let outlook = state.outlook(experiment.model.as_ref())?;
    let descriptors = state.plan().map.as_ref()?.descriptors.clone();
    Some(MapReport { descriptors, filled: outlook.elites.len(), outlook })
}

fn recommended(experiment: &Experiment, state: &Coevolution) -> Option<Recommended> {
    let best = state.best_tested()?;
    let names = experiment.model.controllers().dims().iter().map(|d| d.name.clone());
    Some(Recommended {
        test: best.trial.number,
        fitness_real: best.fitness()?,
        controller: names.zip(best.trial.controller.iter().copied()).collect(),
    })
}

fn comparison(experiment: &Experiment, state: &Coevolution, truth: Revealed) -> Result<TwinComparison, WorldError> {
    Ok(TwinComparison {
        error_percent: error_percent(&experiment.model, state.simulation(), &truth),
        error_percent_before: error_percent(&experiment.model, state.start(), &truth),
        state_match: state_match(experiment, state)?,
        truth,
    })
}

/// 100·(estimate − truth)/truth for every parameter of S.
pub fn error_percent(model: &Model, s: &[f64], truth: &Revealed) -> IndexMap<String, f64> {
    let dims = model.simulations().dims().iter().zip(s);
    dims.filter_map(|(d, x)| Some((d.name.clone(), 100.0 * (x / truth.parameters.get(&d.name)? - 1.0)))).collect()
}

/// Eqs 1 and 2 for the recommended controller: simulated against real state, rms by unit.
fn state_match(experiment: &Experiment, state: &Coevolution) -> Result<IndexMap<String, f64>, WorldError> {
    let Some((trial, real)) = state.best_tested().and_then(|e| Some((&e.trial, e.behaviour()?))) else {
        return Ok(IndexMap::new());
    };
    let simulated = experiment
        .model
        .simulate(experiment.model.request(state.simulation(), trial.scenario).controller(&trial.controller))?;
    let mut squares: IndexMap<String, (f64, usize)> = IndexMap::new();
    for (name, channel) in real.log.channels().filter(|(name, c)| c.role == Role::Truth || name.starts_with("q_")) {
        let Some(other) = simulated.channel(name) else { continue };
        let sum = squares.entry(channel.unit.clone()).or_default();
        let pairs = channel.values.iter().zip(&other.values).filter(|(a, b)| (*a - *b).is_finite());
        pairs.for_each(|(a, b)| *sum = (sum.0 + (a - b) * (a - b), sum.1 + 1));
    }
    Ok(squares.into_iter().map(|(unit, (sum, n))| (unit, (sum / n.max(1) as f64).sqrt())).collect())
}

fn log_scores(experiment: &Experiment, state: &Coevolution) -> Result<Vec<LogScore>, WorldError> {
    let model = &experiment.model;
    let mut scores = Vec::new();
    for (k, (scenario, real)) in model.scenarios.iter().zip(&experiment.recorded).enumerate() {
        let simulate = |s: &[f64]| {
            model.simulate(model.request(s, k).controller(&[]))?.resample(real.clock_s()).map_err(WorldError::from)
        };
        let (before, after) = (simulate(state.start())?, simulate(state.simulation())?);
        let measured = real.channels().filter(|(name, c)| c.role == Role::Measured && name.starts_with("q_"));
        for (name, channel) in measured {
            let score = |log: &Log| log.channel(name).map(|c| ChannelScore::new(&channel.values, &c.values));
            if let (Some(before), Some(after)) = (score(&before), score(&after)) {
                scores.push(LogScore {
                    log: scenario.name.clone(),
                    held_out: k >= model.learn,
                    channel: name.to_owned(),
                    unit: channel.unit.clone(),
                    before,
                    after,
                });
            }
        }
    }
    Ok(scores)
}

impl ChannelScore {
    /// Errors of `simulated` against `real`, over the samples both have.
    pub fn new(real: &[f64], simulated: &[f64]) -> Self {
        let pairs = || real.iter().zip(simulated).filter(|(a, b)| a.is_finite() && b.is_finite());
        let n = pairs().count() as f64;
        let mean = pairs().map(|(a, _)| a).sum::<f64>() / n;
        let sum = |f: &dyn Fn(f64, f64) -> f64| pairs().map(|(a, b)| f(*a, *b)).sum::<f64>();
        let (error, spread) = (sum(&|a, b| (a - b) * (a - b)), sum(&|a, _| (a - mean) * (a - mean)));
        ChannelScore {
            mean_abs: sum(&|a, b| (a - b).abs()) / n,
            rmse: (error / n).sqrt(),
            fit_percent: 100.0 * (1.0 - (error / spread).sqrt()),
        }
    }
}
