//! The state machine that turns the loop.

use super::correction::LinearCorrection;
use super::disengage::{self, Evidence};
use super::evaluate::{self, Cost};
use super::history::{Generation, History, Iteration, Side, StopReason};
use super::ledger::{Entry, Ledger};
use super::plan::{Initial, Method, Plan, SearchPhase};
use super::transfer::{self, Choice, Scored};
use crate::distance::Distance;
use crate::random::{self, Rng};
use crate::search::{AnySearch, Search, Unit};
use crate::stats;
use crate::world::{Reality, Simulator, Trial};
use rand::RngExt;
use serde::{Deserialize, Serialize};

/// What a run acts on. Not part of its state: the caller builds it anew when a run is resumed.
pub struct On<'a> {
    /// S, C and how they behave.
    pub simulator: &'a dyn Simulator,
    /// phi.
    pub distance: &'a dyn Distance,
    /// Where the truth comes from.
    pub reality: &'a mut dyn Reality,
}

/// What one step did.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
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

/// A plan that cannot be carried out.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlanError {
    /// Controllers to search, but no search for them.
    #[error("there are {0} controller parameters to search, but the plan has no [coevolve.controllers]")]
    NoControllerSearch(usize),
    /// Simulations to search, but no search for them.
    #[error("there are {0} simulation parameters to search, but the plan has no [coevolve.simulators]")]
    NoSimulatorSearch(usize),
    /// A method that searches controllers, on a fixed drive.
    #[error("this method searches controllers, but the experiment's drive has no parameters")]
    NothingToControl,
    /// No iteration at all.
    #[error("`iterations` must be at least 1")]
    NoIterations,
}

/// A parameter this close to a bound, as a share of its range, lies on it: no search gets there exactly.
const AT_BOUND: f64 = 1e-3;

/// Labels of the random streams, one per consumer.
#[derive(Clone, Copy)]
enum Stream {
    InitialSimulation = 1,
    Controllers = 2,
    Simulators = 3,
    Neighbours = 4,
    FirstRivals = 5,
}

/// Where in an iteration the run is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Phase {
    /// About to begin the iteration.
    Begin,
    /// Step 1.
    Controllers { search: AnySearch, archive: Vec<Scored>, generation: usize },
    /// Step 2. `testing` is there when reality itself is the environment of the controller search.
    Transfer { queue: Vec<Scored>, next: usize, testing: Option<AnySearch> },
    /// Step 3. `tried` begins with s_{i−1}.
    Simulators { search: AnySearch, tests: Vec<usize>, tried: Vec<(Unit, f64)>, generation: usize },
    /// About to close the iteration.
    End,
    /// Over.
    Stopped(StopReason),
}

/// A run in progress: a plan, and how far it has come.
#[derive(Clone, Debug, PartialEq)]
pub struct Coevolution {
    plan: Plan,
    state: State,
}

/// How far a run has come: all that has to be written down to go on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    seed: u64,
    /// s_0.
    start: Vec<f64>,
    iteration: usize,
    phase: Phase,
    /// s_{i−1}, then s_i.
    simulation: Vec<f64>,
    /// c_{i−1}, then c_i, on the unit cube.
    controller: Option<Unit>,
    rivals: Vec<Vec<f64>>,
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
        check(&plan, simulator)?;
        let space = simulator.simulations();
        let simulation = match plan.initial_simulation {
            Initial::Nominal => space.nominal(),
            Initial::Random => {
                space.from_unit(&uniform(space.len(), &mut stream(seed, Stream::InitialSimulation, 0, 0)))
            }
        };
        let nominal = simulator.controllers().dims().iter().all(|d| d.nominal.is_some());
        let controller = nominal.then(|| simulator.controllers().to_unit(&simulator.controllers().nominal()));
        let state = State {
            seed,
            start: simulation.clone(),
            iteration: 1,
            phase: Phase::Begin,
            simulation,
            controller,
            rivals: Vec::new(),
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
    pub fn resumed(plan: Plan, state: State) -> Self {
        Coevolution { plan, state }
    }

    /// What has to be written down to go on later.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Does the next unit of work.
    pub fn step(&mut self, on: &mut On<'_>) -> Step {
        match std::mem::replace(&mut self.state.phase, Phase::Begin) {
            Phase::Begin => self.begin(on),
            Phase::Controllers { search, archive, generation } => self.controllers(on, search, archive, generation),
            Phase::Transfer { queue, next, testing } => self.transfer(on, queue, next, testing),
            Phase::Simulators { search, tests, tried, generation } => {
                self.simulators(on, search, tests, tried, generation)
            }
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
        let tested = self.state.ledger.entries().iter().filter(|e| e.fitness().is_some_and(f64::is_finite));
        tested.max_by(|a, b| a.fitness().unwrap_or(f64::NAN).total_cmp(&b.fitness().unwrap_or(f64::NAN)))
    }

    fn begin(&mut self, on: &mut On<'_>) -> Step {
        if self.tests_left() == 0 {
            return self.stop(StopReason::RealTestsSpent);
        }
        let fixed_drive = Scored { unit: Vec::new(), fitness: f64::NAN, generation: 0 };
        match &self.plan.controllers {
            Some(phase) if !on.simulator.controllers().is_empty() => {
                let search = phase.search.start(on.simulator.controllers().len(), self.state.controller.as_deref());
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

    fn controllers(
        &mut self,
        on: &mut On<'_>,
        mut search: AnySearch,
        mut archive: Vec<Scored>,
        generation: usize,
    ) -> Step {
        let units = search.ask(&mut self.stream(Stream::Controllers, generation));
        let scores = self.score_controllers(on, &units);
        search.tell(&units, &scores.iter().map(|f| -f).collect::<Vec<_>>());
        let best = best_index(&scores.iter().map(|f| -f).collect::<Vec<_>>());
        let point = on.simulator.controllers().from_unit(&units[best]);
        self.state.history.generations.push(Generation::new(
            (self.state.iteration, generation, Side::Controllers),
            vec![point],
            &scores,
        ));
        archive.extend(units.into_iter().zip(scores).map(|(unit, fitness)| Scored { unit, fitness, generation }));
        self.state.phase = match &self.plan.controllers {
            Some(phase) if generation < phase.generations => {
                Phase::Controllers { search, archive, generation: generation + 1 }
            }
            _ => self.choose(on, &archive),
        };
        Step::Generation
    }

    /// Fitness in s_{i−1}, corrected or replaced as the method wants.
    fn score_controllers(&mut self, on: &On<'_>, units: &[Unit]) -> Vec<f64> {
        if self.explores() {
            let rivals = self.rivals(on);
            return evaluate::disagreement(on.simulator, on.distance, &rivals, units, &mut self.state.cost);
        }
        let fitness = evaluate::fitness(on.simulator, &self.state.simulation, units, &mut self.state.cost);
        fitness.iter().zip(units).map(|(f, unit)| f + self.state.correction.at(unit)).collect()
    }

    /// Estimation-exploration looks for disagreement in all iterations but the last.
    fn explores(&self) -> bool {
        self.plan.method == Method::EstimationExploration && self.state.iteration < self.plan.iterations
    }

    fn choose(&mut self, on: &On<'_>, archive: &[Scored]) -> Phase {
        let m = self
            .plan
            .transfers(on.simulator.controllers().len())
            .min(self.tests_left().div_ceil(on.simulator.scenarios()));
        let candidates = transfer::transferable(archive, &self.state.ledger, on.simulator);
        let rivals = self.rivals(on);
        let choice = Choice {
            plan: &self.plan,
            simulator: on.simulator,
            distance: on.distance,
            simulation: &self.state.simulation,
            ledger: &self.state.ledger,
            rivals: &rivals,
            candidates,
        };
        let mut rng = self.stream(Stream::Neighbours, 0);
        let mut queue = choice.choose(m, &mut rng, &mut self.state.cost);
        if self.explores() {
            let units: Vec<Unit> = queue.iter().map(|c| c.unit.clone()).collect();
            let fitness = evaluate::fitness(on.simulator, &self.state.simulation, &units, &mut self.state.cost);
            queue.iter_mut().zip(fitness).for_each(|(c, f)| c.fitness = f);
        }
        if let Some(first) = queue.first() {
            self.state.controller = Some(first.unit.clone());
        }
        Phase::Transfer { queue, next: 0, testing: None }
    }

    /// Simulations that explain the past about equally well; before there is a past, random ones.
    fn rivals(&self, on: &On<'_>) -> Vec<Vec<f64>> {
        if !self.state.rivals.is_empty() {
            return self.state.rivals.clone();
        }
        let space = on.simulator.simulations();
        (0..self.plan.transfer.rivals as u64)
            .map(|k| space.from_unit(&uniform(space.len(), &mut stream(self.state.seed, Stream::FirstRivals, k, 0))))
            .collect()
    }

    fn transfer(&mut self, on: &mut On<'_>, queue: Vec<Scored>, next: usize, testing: Option<AnySearch>) -> Step {
        let trials = self.trials(on, &queue, next);
        let Some(trial) = trials.first().cloned() else { return self.transferred(on, &queue, testing) };
        let promised = queue[next / on.simulator.scenarios()].fitness;
        let result = on.reality.announce(&trials).and_then(|()| {
            let promised = promised.is_finite().then_some(promised);
            self.state.ledger.carry_out(trial, promised, on.reality)
        });
        self.state.phase = Phase::Transfer { queue, next: next + usize::from(result.is_ok()), testing };
        match result {
            Ok(()) => Step::Tested,
            Err(what) => Step::Waiting(what),
        }
    }

    /// What is left to try in this iteration: every chosen controller in every scenario, as far as the budget goes.
    fn trials(&self, on: &On<'_>, queue: &[Scored], next: usize) -> Vec<Trial> {
        let scenarios = on.simulator.scenarios();
        let left = (next..queue.len() * scenarios).take(self.tests_left());
        left.map(|k| Trial {
            number: self.state.ledger.spent() + k - next,
            iteration: self.state.iteration,
            controller: on.simulator.controllers().from_unit(&queue[k / scenarios].unit),
            scenario: k % scenarios,
        })
        .collect()
    }

    /// All tests of the iteration are done: tell the search that waited for them, or go on to step 3.
    fn transferred(&mut self, on: &mut On<'_>, queue: &[Scored], testing: Option<AnySearch>) -> Step {
        if let Some(search) = testing {
            return self.told(on, queue, search);
        }
        if self.state.ledger.entries().iter().all(|e| e.fitness().is_none()) {
            return self.stop(StopReason::NoRealData);
        }
        match (&self.plan.simulators, self.plan.method) {
            (_, Method::LinearCorrection) => {
                self.correct(on);
                self.state.phase = Phase::End;
            }
            (Some(phase), _) if !on.simulator.simulations().is_empty() => {
                self.state.phase = self.begin_simulators(on, &phase.clone());
            }
            _ => self.state.phase = Phase::End,
        }
        self.step(on)
    }

    /// Refits the estimate of f_r − f_s to the whole ledger. f_s is simulated anew: what was promised when a test was asked
    /// for has the estimate of that time in it.
    fn correct(&mut self, on: &On<'_>) {
        let entries = self.state.ledger.entries().iter();
        let tested: Vec<(Unit, f64)> = entries
            .filter_map(|e| Some((on.simulator.controllers().to_unit(&e.trial.controller), e.fitness()?)))
            .collect();
        let units: Vec<Unit> = tested.iter().map(|(unit, _)| unit.clone()).collect();
        let simulated = evaluate::fitness(on.simulator, &self.state.simulation, &units, &mut self.state.cost);
        let gaps = tested.into_iter().zip(simulated).map(|((unit, real), sim)| (unit, real - sim));
        self.state.correction = LinearCorrection::fit(&gaps.collect::<Vec<_>>());
    }

    fn begin_simulators(&mut self, on: &On<'_>, phase: &SearchPhase) -> Phase {
        let now = self.distances_now(on);
        let State { ledger, iteration, .. } = &self.state;
        let fresh: Vec<f64> = indices(ledger, &ledger.of_iteration(*iteration)).map(|k| now[k]).collect();
        let tests: Vec<usize> = indices(ledger, &ledger.counting(*iteration, self.plan.memory, &now)).collect();
        let incumbent = evaluate::phi(&tests.iter().map(|&k| now[k]).collect::<Vec<_>>());
        self.state.phi_predicted = (!fresh.is_empty()).then(|| evaluate::phi(&fresh));
        self.state.phi_start = self.state.phi_start.or(self.state.phi_predicted);
        self.state.phi = Some(incumbent);
        if self.plan.phi_goal.is_some_and(|goal| incumbent <= goal) {
            return Phase::End;
        }
        let space = on.simulator.simulations();
        let first = self.state.iteration == 1 && self.plan.initial_simulation == Initial::Random;
        let here = space.to_unit(&self.state.simulation);
        let search = phase.search.start(space.len(), (!first).then_some(here.as_slice()));
        Phase::Simulators { search, tests, tried: vec![(here, incumbent)], generation: 1 }
    }

    /// How far the present simulation is from every test of the ledger; infinite where a test failed.
    fn distances_now(&mut self, on: &On<'_>) -> Vec<f64> {
        let State { ledger, simulation, cost, .. } = &mut self.state;
        let all: Vec<&Entry> = ledger.entries().iter().collect();
        evaluate::distances(on.simulator, on.distance, std::slice::from_ref(simulation), &all, cost).remove(0)
    }

    fn simulators(
        &mut self,
        on: &mut On<'_>,
        mut search: AnySearch,
        tests: Vec<usize>,
        mut tried: Vec<(Unit, f64)>,
        generation: usize,
    ) -> Step {
        let units = search.ask(&mut self.stream(Stream::Simulators, generation));
        let points: Vec<Vec<f64>> = units.iter().map(|u| on.simulator.simulations().from_unit(u)).collect();
        let entries: Vec<&Entry> = tests.iter().map(|&k| &self.state.ledger.entries()[k]).collect();
        let rows = evaluate::distances(on.simulator, on.distance, &points, &entries, &mut self.state.cost);
        let scores: Vec<f64> = rows.iter().map(|row| evaluate::phi(row)).collect();
        search.tell(&units, &scores);
        self.state.history.generations.push(Generation::new(
            (self.state.iteration, generation, Side::Simulators),
            points,
            &scores,
        ));
        tried.extend(units.into_iter().zip(scores));
        let best = &tried[best_index(&tried.iter().map(|t| t.1).collect::<Vec<_>>())];
        let found = self.plan.phi_goal.is_some_and(|goal| best.1 <= goal);
        let generations = self.plan.simulators.as_ref().map_or(0, |phase| phase.generations);
        if generation < generations && !found {
            self.state.phase = Phase::Simulators { search, tests, tried, generation: generation + 1 };
        } else {
            let space = on.simulator.simulations();
            (self.state.simulation, self.state.phi) = (space.from_unit(&best.0), Some(best.1));
            let rivals = transfer::rivals(&tried, self.plan.transfer.rivals);
            self.state.rivals = rivals.iter().map(|u| space.from_unit(u)).collect();
            self.state.phase = Phase::End;
        }
        Step::Generation
    }

    fn end(&mut self, on: &mut On<'_>) -> Step {
        let record = self.record(on);
        self.state.history.iterations.push(record);
        let goal = self.plan.fitness_goal;
        let best = self.best_tested().and_then(Entry::fitness);
        self.state.phase = if goal.zip(best).is_some_and(|(goal, best)| best >= goal) {
            Phase::Stopped(StopReason::GoalReached)
        } else if self.state.iteration >= self.plan.iterations {
            Phase::Stopped(StopReason::IterationsDone)
        } else if self.plan.disengagement.stop && self.disengaged() {
            Phase::Stopped(StopReason::Disengaged)
        } else {
            self.state.iteration += 1;
            Phase::Begin
        };
        Step::Iteration
    }

    /// Whether the evidence so far amounts to disengagement.
    pub fn disengaged(&self) -> bool {
        disengage::disengaged(&self.state.history.iterations, &self.plan.disengagement)
    }

    fn record(&mut self, on: &On<'_>) -> Iteration {
        let evidence = self.evidence(on);
        let mine = self.state.ledger.of_iteration(self.state.iteration);
        let first = mine.iter().min_by_key(|e| e.trial.number);
        let space = on.simulator.simulations();
        let controller = self.state.controller.as_ref().map(|u| on.simulator.controllers().from_unit(u));
        Iteration {
            i: self.state.iteration,
            fitness_sim: first.and_then(|e| e.promised),
            fitness_real: first.and_then(|e| e.fitness()),
            best_real: self.best_tested().and_then(Entry::fitness),
            phi_predicted: self.state.phi_predicted.take(),
            phi: self.state.phi,
            parameters: space
                .dims()
                .iter()
                .map(|d| d.name.clone())
                .zip(self.state.simulation.iter().copied())
                .collect(),
            controller: controller.unwrap_or_default(),
            real_tests: self.state.ledger.spent(),
            simulated_evaluations: self.state.cost.evaluations,
            evidence,
        }
    }

    fn evidence(&mut self, on: &On<'_>) -> Evidence {
        let share =
            |phi: Option<f64>| phi.zip(self.state.phi_start).map(|(phi, start)| phi / start.max(f64::MIN_POSITIVE));
        let (phi_share, predicted_share) = (share(self.state.phi), share(self.state.phi_predicted));
        let pairs: Vec<(Unit, f64, f64)> = self
            .state
            .ledger
            .of_iteration(self.state.iteration)
            .iter()
            .filter_map(|e| Some((on.simulator.controllers().to_unit(&e.trial.controller), e.promised?, e.fitness()?)))
            .collect();
        let promised: Vec<f64> = pairs.iter().map(|p| p.1).collect();
        let real: Vec<f64> = pairs.iter().map(|p| p.2).collect();
        let units: Vec<Unit> = pairs.into_iter().map(|p| p.0).collect();
        let renewed = evaluate::fitness(on.simulator, &self.state.simulation, &units, &mut self.state.cost);
        Evidence {
            phi_share,
            predicted_share,
            rank_agreement: stats::kendall_tau_b(&promised, &real),
            pressure_on_simulations: self.pressure_on_simulations(),
            pressure_on_controllers: stats::kendall_tau_b(&promised, &renewed).map(|tau| (1.0 - tau) / 2.0),
            at_bound: self.at_bound(on),
        }
    }

    fn pressure_on_simulations(&self) -> Option<f64> {
        let mine = |g: &&Generation| g.iteration == self.state.iteration && g.side == Side::Simulators;
        let first = self.state.history.generations.iter().find(mine)?;
        Some((first.mean - first.best) / first.mean.max(f64::MIN_POSITIVE)).filter(|p| p.is_finite())
    }

    fn at_bound(&self, on: &On<'_>) -> Vec<String> {
        let dims = on.simulator.simulations().dims().iter().zip(&self.state.simulation);
        dims.filter(|(d, x)| !(AT_BOUND..=1.0 - AT_BOUND).contains(&d.to_unit(**x)))
            .map(|(d, _)| d.name.clone())
            .collect()
    }

    /// Reality as the environment of the controller search: the next population goes to the robot.
    fn next_real_generation(&mut self, on: &mut On<'_>, mut search: AnySearch) -> Step {
        let units = search.ask(&mut self.stream(Stream::Controllers, 1));
        let queue = units.into_iter().map(|unit| Scored { unit, fitness: f64::NAN, generation: 1 }).collect();
        self.state.phase = Phase::Transfer { queue, next: 0, testing: Some(search) };
        self.step(on)
    }

    /// The robot has judged a whole population (or the budget ended within it).
    fn told(&mut self, on: &mut On<'_>, queue: &[Scored], mut search: AnySearch) -> Step {
        let scenarios = on.simulator.scenarios();
        let mine: Vec<f64> = (self.state.ledger.entries().iter())
            .filter(|e| e.trial.iteration == self.state.iteration)
            .map(|e| e.fitness().unwrap_or(f64::NEG_INFINITY))
            .collect();
        let fitness: Vec<f64> =
            mine.chunks_exact(scenarios).map(|f| f.iter().sum::<f64>() / scenarios as f64).collect();
        let units: Vec<Unit> = queue.iter().take(fitness.len()).map(|c| c.unit.clone()).collect();
        let costs: Vec<f64> = fitness.iter().map(|f| -f).collect();
        if !units.is_empty() {
            let best = best_index(&costs);
            self.state.controller = Some(units[best].clone());
            let point = on.simulator.controllers().from_unit(&units[best]);
            let label = (self.state.iteration, 1, Side::Controllers);
            self.state.history.generations.push(Generation::new(label, vec![point], &fitness));
        }
        let record = self.record(on);
        self.state.history.iterations.push(record);
        if self.state.iteration >= self.plan.iterations {
            self.state.phase = Phase::Stopped(StopReason::IterationsDone);
            return Step::Iteration;
        }
        if units.len() < queue.len() || self.tests_left() == 0 {
            self.state.phase = Phase::Stopped(StopReason::RealTestsSpent);
            return Step::Iteration;
        }
        search.tell(&units, &costs);
        self.state.iteration += 1;
        let units = search.ask(&mut self.stream(Stream::Controllers, 1));
        let queue = units.into_iter().map(|unit| Scored { unit, fitness: f64::NAN, generation: 1 }).collect();
        self.state.phase = Phase::Transfer { queue, next: 0, testing: Some(search) };
        Step::Iteration
    }

    fn stop(&mut self, reason: StopReason) -> Step {
        self.state.phase = Phase::Stopped(reason.clone());
        Step::Stopped(reason)
    }

    fn tests_left(&self) -> usize {
        self.plan.real_tests.map_or(usize::MAX, |budget| budget.saturating_sub(self.state.ledger.spent()))
    }

    fn stream(&self, what: Stream, generation: usize) -> Rng {
        stream(self.state.seed, what, self.state.iteration as u64, generation as u64)
    }
}

fn check(plan: &Plan, simulator: &dyn Simulator) -> Result<(), PlanError> {
    let (c, s) = (simulator.controllers().len(), simulator.simulations().len());
    let needs_simulators = matches!(plan.method, Method::BackToReality | Method::EstimationExploration);
    match () {
        () if plan.iterations == 0 => Err(PlanError::NoIterations),
        () if c > 0 && plan.controllers.is_none() => Err(PlanError::NoControllerSearch(c)),
        () if s > 0 && needs_simulators && plan.simulators.is_none() => Err(PlanError::NoSimulatorSearch(s)),
        () if c == 0 && plan.method != Method::BackToReality => Err(PlanError::NothingToControl),
        () => Ok(()),
    }
}

fn stream(seed: u64, what: Stream, iteration: u64, generation: u64) -> Rng {
    random::stream(seed, &[what as u64, iteration, generation])
}

fn uniform(dims: usize, rng: &mut Rng) -> Unit {
    (0..dims).map(|_| rng.random::<f64>()).collect()
}

/// The index of the smallest cost, the first one among equals. Populations are never empty.
fn best_index(costs: &[f64]) -> usize {
    (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0)
}

/// The positions in the ledger of some of its entries.
fn indices<'a>(ledger: &'a Ledger, entries: &'a [&Entry]) -> impl Iterator<Item = usize> + 'a {
    entries.iter().filter_map(|e| ledger.entries().iter().position(|other| std::ptr::eq(*e, other)))
}
