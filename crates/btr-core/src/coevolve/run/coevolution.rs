//! A run in progress, and what it acts on.

use super::fits::{self, StateError};
use super::state::{Phase, RunState};
use super::validate::{self, PlanError};
use crate::coevolve::correction::LinearCorrection;
use crate::coevolve::disengage;
use crate::coevolve::estimation::Posterior;
use crate::coevolve::evaluate::Cost;
use crate::coevolve::history::{History, StopReason};
use crate::coevolve::ledger::{Entry, Ledger, RecallError};
use crate::coevolve::plan::{Initial, Plan};
use crate::distance::Distance;
use crate::random::{self, Rng};
use crate::search::uniform;
use crate::text::Text;
use crate::world::{Reality, Simulator};

/// What a run acts on. Not part of its state: the caller builds it anew when a run is resumed.
pub struct Environment<'a> {
    /// S, C and how they behave.
    pub simulator: &'a dyn Simulator,
    /// phi.
    pub distance: &'a dyn Distance,
    /// Source of real tests.
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
    /// The test described here has to be carried out by hand first.
    Waiting(Text),
    /// Something may still move the robot, as described here: no test may begin.
    Unsafe(Text),
    /// The files of a test are damaged or cannot be written, as described here.
    Storage(Text),
    /// The run is over.
    Stopped(StopReason),
}

/// Labels of the random streams, one per consumer.
#[derive(Clone, Copy)]
pub(super) enum Stream {
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

/// A run in progress: a plan and the state of the run.
#[derive(Clone, Debug, PartialEq)]
pub struct Coevolution {
    pub(super) plan: Plan,
    pub(super) state: RunState,
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

    /// Resumes a run from a saved state; [`recall`](Self::recall) comes next.
    ///
    /// # Errors
    /// A state that cannot be one of this plan with this simulator.
    pub fn resumed(plan: Plan, state: RunState, simulator: &dyn Simulator) -> Result<Self, StateError> {
        fits::check(&state, &plan, simulator)?;
        Ok(Coevolution { plan, state })
    }

    /// The state to save in a checkpoint.
    pub fn state(&self) -> &RunState {
        &self.state
    }

    /// Fetches the logs of the ledger; needed once after a run was resumed from a checkpoint.
    ///
    /// # Errors
    /// A real test whose log is gone or damaged.
    pub fn recall(&mut self, reality: &mut dyn Reality) -> Result<(), RecallError> {
        self.state.ledger.recall(reality)
    }

    /// Records of generations and iterations so far.
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

    /// Number of simulations so far.
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

    /// The posterior of S; `None` for a plan without one, and before the first test.
    pub fn posterior(&self) -> Option<&Posterior> {
        self.state.estimated.as_ref().map(|estimated| &estimated.belief)
    }

    /// Whether the evidence so far amounts to disengagement.
    pub fn disengaged(&self) -> bool {
        let history = &self.state.history;
        // Unexplained tests of the robot before it changed are no evidence on the robot as it is now.
        let changed = history.drifts.last().map_or(0, |drift| drift.iteration);
        let since = history.iterations.partition_point(|it| it.i <= changed);
        disengage::disengaged(&history.iterations[since..], &self.plan.disengagement, self.plan.phi_goal)
    }

    pub(super) fn tests_left(&self) -> usize {
        self.plan.real_tests.map_or(usize::MAX, |budget| budget.saturating_sub(self.state.ledger.spent()))
    }

    pub(super) fn stream(&self, what: Stream, generation: usize) -> Rng {
        stream(self.state.seed, what, self.state.iteration as u64, generation as u64)
    }
}

pub(super) fn stream(seed: u64, what: Stream, iteration: u64, generation: u64) -> Rng {
    random::stream(seed, &[what as u64, iteration, generation])
}

/// The index of the smallest cost, the first one among equals. Populations are never empty.
pub(super) fn best_index(costs: &[f64]) -> usize {
    (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0)
}
