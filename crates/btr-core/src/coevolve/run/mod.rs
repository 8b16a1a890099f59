//! The state machine that turns the loop.

mod controllers;
mod detect_drift;
mod enlarge;
mod estimate;
mod map;
mod reality_only;
mod record;
mod simulators;
mod transfers;
mod uncertainty;
mod validate;

use super::correction::LinearCorrection;
use super::disengage;
use super::estimation::Estimated;
use super::estimation::posterior::Posterior;
use super::evaluate::Cost;
use super::history::{History, StopReason};
use super::ledger::{Entry, Ledger};
use super::plan::{Initial, Method, Plan};
use super::transfer::ScoredController;
use crate::distance::Distance;
use crate::optimize::LeastSquares;
use crate::random::{self, Rng};
use crate::search::{AnySearch, MapElites, UnitPoint};
use crate::world::{Reality, Simulator};
use estimate::Estimation;
use rand::RngExt;
use serde::{Deserialize, Serialize};
pub use validate::PlanError;

/// What a run acts on. Not part of its state: the caller builds it anew when a run is resumed.
pub struct Environment<'a> {
    /// S, C and how they behave.
    pub simulator: &'a dyn Simulator,
    /// phi.
    pub distance: &'a dyn Distance,
    /// Where the truth comes from.
    pub reality: &'a mut dyn Reality,
}

/// What one step did.
#[derive(Clone, Debug, PartialEq)]
pub enum StepOutcome {
    /// Evaluated a generation; it is the last of the history.
    Generation,
    /// Carried out a real test; it is the last of the ledger.
    Tested,
    /// Closed an iteration; it is the last of the history.
    Iteration,
    /// Nothing to do before somebody has carried out the test described here.
    Waiting(String),
    /// The run is over.
    Stopped(StopReason),
}

/// Labels of the random streams, one per consumer.
#[derive(Clone, Copy)]
enum Stream {
    InitialSimulation = 1,
    Controllers = 2,
    Simulators = 3,
    Neighbours = 4,
    FirstRivals = 5,
    Ensembles = 6,
    Doubts = 7,
    Promises = 8,
    Candidates = 9,
}

/// Where in an iteration the run is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Phase {
    /// About to begin the iteration.
    Begin,
    /// Step 1 of the first iteration, where the method makes a map of controllers.
    Map { generation: usize },
    /// Step 1.
    Controllers { search: AnySearch, archive: Vec<ScoredController>, generation: usize },
    /// Step 2. `testing` is there when reality itself is the environment of the controller search.
    Transfer { queue: Vec<ScoredController>, next: usize, testing: Option<AnySearch> },
    /// Step 3. `tried` begins with s_{i−1}.
    Simulators { search: AnySearch, tests: Vec<usize>, tried: Vec<(UnitPoint, f64)>, generation: usize },
    /// Step 3, continued by least squares from the best that was tried.
    Refine { search: LeastSquares, tests: Vec<usize>, tried: Vec<(UnitPoint, f64)>, generation: usize },
    /// Step 3 as estimation.
    Estimate(Estimation),
    /// S has grown: step 3 on the tests there are, before any new one is asked for; or what explains them is known.
    Enlarged(Option<Estimated>),
    /// About to close the iteration.
    End,
    /// Over.
    Stopped(StopReason),
}

/// A run in progress: a plan, and how far it has come.
#[derive(Clone, Debug, PartialEq)]
pub struct Coevolution {
    plan: Plan,
    state: RunState,
}

/// How far a run has come: all that has to be written down to go on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunState {
    seed: u64,
    /// s_0.
    start: Vec<f64>,
    iteration: usize,
    phase: Phase,
    /// s_{i−1}, then s_i.
    simulation: Vec<f64>,
    /// c_{i−1}, then c_i, on the unit cube.
    controller: Option<UnitPoint>,
    /// Where the next search for controllers begins.
    ahead: Option<UnitPoint>,
    /// The simulator search as the last iteration left it.
    carried: Option<AnySearch>,
    /// s_0 on the unit cube: about what S is believed before any test.
    prior: UnitPoint,
    /// What the real tests say of S, where the plan asks for a posterior.
    estimated: Option<Estimated>,
    /// Whether that explains several tests, or has foretold one that came after it.
    confirmed: bool,
    /// Number of the first real test of the robot as it is now.
    since: usize,
    /// Number of the first real test that nothing explains beside those before it: an older one is repeated, to tell whether the
    /// robot has changed or S lacks something.
    suspicion: Option<usize>,
    rivals: Vec<Vec<f64>>,
    /// The controllers of the method that makes a map of them.
    map: Option<MapElites>,
    correction: LinearCorrection,
    ledger: Ledger,
    history: History,
    cost: Cost,
    /// phi of the starting simulation on the first transfers: the yardstick of disengagement.
    phi_start: Option<f64>,
    /// phi of s_{i−1} on this iteration's transfers.
    phi_predicted: Option<f64>,
    /// phi of s_i on the tests that count.
    phi: Option<f64>,
}

impl Coevolution {
    /// A run that has not begun.
    ///
    /// # Errors
    /// A plan that does not fit what is to be searched.
    pub fn new(plan: Plan, seed: u64, simulator: &dyn Simulator) -> Result<Self, PlanError> {
        validate::check(&plan, simulator)?;
        let space = simulator.simulations();
        let simulation = match plan.initial_simulation {
            Initial::Nominal => space.nominal(),
            Initial::Random => {
                space.from_unit(&uniform(space.len(), &mut stream(seed, Stream::InitialSimulation, 0, 0)))
            }
        };
        let nominal = simulator.controllers().dims().iter().all(|d| d.nominal.is_some());
        let controller = nominal.then(|| simulator.controllers().to_unit(&simulator.controllers().nominal()));
        let state = RunState {
            seed,
            start: simulation.clone(),
            prior: space.to_unit(&simulation),
            estimated: None,
            confirmed: false,
            since: 0,
            suspicion: None,
            iteration: 1,
            phase: Phase::Begin,
            simulation,
            ahead: controller.clone(),
            controller,
            carried: None,
            rivals: Vec::new(),
            map: None,
            correction: LinearCorrection::default(),
            ledger: Ledger::default(),
            history: History::default(),
            cost: Cost::default(),
            phi_start: None,
            phi_predicted: None,
            phi: None,
        };
        Ok(Coevolution { plan, state })
    }

    /// Takes up a run where its state was written down; [`recall`](Self::recall) comes next.
    pub fn resumed(plan: Plan, state: RunState) -> Self {
        Coevolution { plan, state }
    }

    /// What has to be written down to go on later.
    pub fn state(&self) -> &RunState {
        &self.state
    }

    /// Does the next unit of work.
    pub fn step(&mut self, on: &mut Environment<'_>) -> StepOutcome {
        match std::mem::replace(&mut self.state.phase, Phase::Begin) {
            Phase::Begin => self.begin(on),
            Phase::Map { generation } => self.fill_map(on, generation),
            Phase::Controllers { search, archive, generation } => self.controllers(on, search, archive, generation),
            Phase::Transfer { queue, next, testing } => self.transfer(on, queue, next, testing),
            Phase::Simulators { search, tests, tried, generation } => {
                self.simulators(on, search, tests, tried, generation)
            }
            Phase::Refine { search, tests, tried, generation } => self.refine(on, search, tests, tried, generation),
            Phase::Estimate(estimation) => self.estimate(on, estimation),
            Phase::Enlarged(known) => self.enlarged(on, known),
            Phase::End => self.end(on),
            Phase::Stopped(reason) => self.stop(reason),
        }
    }

    /// Fetches the logs of the ledger again; needed once after a run came out of a checkpoint.
    ///
    /// # Errors
    /// A real test whose log is gone.
    pub fn recall(&mut self, reality: &mut dyn Reality) -> Result<(), String> {
        self.state.ledger.recall(reality)
    }

    /// Everything that happened so far.
    pub fn history(&self) -> &History {
        &self.state.history
    }

    /// Every real test so far.
    pub fn ledger(&self) -> &Ledger {
        &self.state.ledger
    }

    /// The best simulation so far, in the units of S.
    pub fn simulation(&self) -> &[f64] {
        &self.state.simulation
    }

    /// The simulation the run began with, in the units of S.
    pub fn start(&self) -> &[f64] {
        &self.state.start
    }

    /// The iteration being worked on, from 1.
    pub fn iteration(&self) -> usize {
        self.state.iteration
    }

    /// What the simulations have cost so far.
    pub fn cost(&self) -> Cost {
        self.state.cost
    }

    /// The plan the run follows.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The linear estimate of the fitness discrepancy, where the method makes one.
    pub fn correction(&self) -> &LinearCorrection {
        &self.state.correction
    }

    /// The test with the best real fitness: what the run recommends to use.
    pub fn best_tested(&self) -> Option<&Entry> {
        let tested = self.lately().iter().filter(|e| e.fitness().is_some_and(f64::is_finite));
        tested.max_by(|a, b| a.fitness().unwrap_or(f64::NAN).total_cmp(&b.fitness().unwrap_or(f64::NAN)))
    }

    fn begin(&mut self, on: &mut Environment<'_>) -> StepOutcome {
        if self.tests_left() == 0 {
            return self.stop(StopReason::RealTestsSpent);
        }
        if let Some(repeated) = self.to_repeat(on) {
            self.state.phase = Phase::Transfer { queue: vec![repeated], next: 0, testing: None };
            return self.step(on);
        }
        if self.plan.method == Method::QualityDiversity {
            return self.begin_map(on);
        }
        let fixed_drive = ScoredController { unit: Vec::new(), fitness: f64::NAN, generation: 0 };
        match &self.plan.controllers {
            Some(phase) if !on.simulator.controllers().is_empty() => {
                let search = phase.search.start(on.simulator.controllers().len(), self.state.ahead.as_deref());
                if self.plan.method == Method::RealityOnly {
                    return self.next_real_generation(on, search);
                }
                self.state.phase = Phase::Controllers { search, archive: Vec::new(), generation: 1 };
            }
            _ => {
                let queue = if self.state.iteration == 1 { vec![fixed_drive] } else { Vec::new() };
                self.state.phase = Phase::Transfer { queue, next: 0, testing: None };
            }
        }
        self.step(on)
    }

    fn end(&mut self, on: &mut Environment<'_>) -> StepOutcome {
        let record = self.record(on);
        self.state.history.iterations.push(record);
        let goal = self.plan.fitness_goal;
        let best = self.best_tested().and_then(Entry::fitness);
        self.state.phase = if goal.zip(best).is_some_and(|(goal, best)| best >= goal) {
            Phase::Stopped(StopReason::GoalReached)
        } else if self.nothing_better(on) {
            Phase::Stopped(StopReason::NothingBetter)
        } else if self.state.iteration >= self.plan.iterations {
            Phase::Stopped(StopReason::IterationsDone)
        } else if self.plan.disengagement.stop && self.disengaged() {
            Phase::Stopped(StopReason::Disengaged)
        } else {
            self.state.iteration += 1;
            Phase::Begin
        };
        StepOutcome::Iteration
    }

    /// What the real tests say of S, where the plan asks for a posterior and there has been a test.
    pub fn posterior(&self) -> Option<&Posterior> {
        self.state.estimated.as_ref().map(|estimated| &estimated.belief)
    }

    /// Whether the evidence so far amounts to disengagement.
    pub fn disengaged(&self) -> bool {
        let history = &self.state.history;
        // What was not explained of a robot that has changed since tells nothing of the one that it is now.
        let changed = history.drifts.last().map_or(0, |drift| drift.iteration);
        let since = history.iterations.partition_point(|it| it.i <= changed);
        disengage::disengaged(&history.iterations[since..], &self.plan.disengagement, self.plan.phi_goal)
    }

    fn stop(&mut self, reason: StopReason) -> StepOutcome {
        self.state.phase = Phase::Stopped(reason.clone());
        StepOutcome::Stopped(reason)
    }

    fn tests_left(&self) -> usize {
        self.plan.real_tests.map_or(usize::MAX, |budget| budget.saturating_sub(self.state.ledger.spent()))
    }

    fn stream(&self, what: Stream, generation: usize) -> Rng {
        stream(self.state.seed, what, self.state.iteration as u64, generation as u64)
    }
}

fn stream(seed: u64, what: Stream, iteration: u64, generation: u64) -> Rng {
    random::stream(seed, &[what as u64, iteration, generation])
}

fn uniform(dims: usize, rng: &mut Rng) -> UnitPoint {
    (0..dims).map(|_| rng.random::<f64>()).collect()
}

/// The index of the smallest cost, the first one among equals. Populations are never empty.
fn best_index(costs: &[f64]) -> usize {
    (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0)
}
