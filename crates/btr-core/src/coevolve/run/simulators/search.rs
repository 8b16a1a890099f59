//! Step 3: the search for the simulation that explains the real tests best.

use crate::coevolve::evaluate::{self, ResidualDistance};
use crate::coevolve::history::{Generation, GenerationLabel, Side};
use crate::coevolve::ledger::{Entry, Ledger};
use crate::coevolve::plan::Initial;
use crate::coevolve::run::coevolution::{Coevolution, Environment, StepOutcome, Stream, best_index};
use crate::coevolve::run::state::{Phase, RunState};
use crate::coevolve::transfer;
use crate::optimize::{LeastSquares, Residuals};
use crate::search::{AnySearch, Search, UnitPoint};
use crate::world::Cancelled;

impl Coevolution {
    /// Step 3; the tests of iteration `latest` are those that always count.
    pub(in crate::coevolve::run) fn begin_simulators(
        &mut self,
        on: &Environment<'_>,
        latest: usize,
    ) -> Result<Phase, Cancelled> {
        if self.plan.posterior.is_none() && self.plan.simulators.is_none() {
            return Ok(Phase::End);
        }
        let now = self.distances_now(on)?;
        let RunState { ledger, iteration, .. } = &self.state;
        let fresh: Vec<f64> = indices(ledger, &ledger.of_iteration(*iteration)).map(|k| now[k]).collect();
        let tests: Vec<usize> = indices(ledger, &ledger.counting(latest, self.plan.memory, &now)).collect();
        if tests.is_empty() {
            self.state.phi = None;
            return Ok(Phase::End);
        }
        if self.plan.posterior.is_some() {
            return self.begin_estimation(on, tests);
        }
        let Some(phase) = self.plan.simulators.clone() else { return Ok(Phase::End) };
        let incumbent = evaluate::phi(&tests.iter().map(|&k| now[k]).collect::<Vec<_>>());
        self.state.phi_predicted = (!fresh.is_empty()).then(|| evaluate::phi(&fresh));
        self.state.phi_start = self.state.phi_start.or(self.state.phi_predicted);
        self.state.phi = Some(incumbent);
        if self.plan.phi_goal.is_some_and(|goal| incumbent <= goal) {
            return Ok(Phase::End);
        }
        let space = on.simulator.simulations();
        let first = self.state.iteration == 1 && self.plan.initial_simulation == Initial::Random;
        let here = space.to_unit(&self.state.simulation);
        let carried = self.state.carried.take().filter(|_| phase.carry_over);
        let search = carried.unwrap_or_else(|| phase.search.start(space.len(), (!first).then_some(here.as_slice())));
        Ok(Phase::Simulators { search, tests, tried: vec![(here, incumbent)], generation: 1 })
    }

    /// How far the present simulation is from every test of the ledger; infinite where a test failed.
    pub(in crate::coevolve::run) fn distances_now(&mut self, on: &Environment<'_>) -> Result<Vec<f64>, Cancelled> {
        let RunState { ledger, simulation, cost, .. } = &mut self.state;
        let all: Vec<&Entry> = ledger.entries().iter().collect();
        Ok(evaluate::distances(on.simulator, on.distance, std::slice::from_ref(simulation), &all, cost)?.remove(0))
    }

    pub(in crate::coevolve::run) fn simulators(
        &mut self,
        on: &mut Environment<'_>,
        mut search: AnySearch,
        tests: Vec<usize>,
        mut tried: Vec<(UnitPoint, f64)>,
        generation: usize,
    ) -> Result<StepOutcome, Cancelled> {
        let units = search.ask(&mut self.stream(Stream::Simulators, generation));
        let points: Vec<Vec<f64>> = units.iter().map(|u| on.simulator.simulations().from_unit(u)).collect();
        let entries: Vec<&Entry> = tests.iter().map(|&k| &self.state.ledger.entries()[k]).collect();
        let rows = evaluate::distances(on.simulator, on.distance, &points, &entries, &mut self.state.cost)?;
        let scores: Vec<f64> = rows.iter().map(|row| evaluate::phi(row)).collect();
        search.tell(&units, &scores);
        self.record_generation(generation, points, &scores);
        tried.extend(units.into_iter().zip(scores));
        let generations = self.plan.simulators.as_ref().map_or(0, |phase| phase.generations);
        if generation < generations && !self.found(&tried) {
            self.state.phase = Phase::Simulators { search, tests, tried, generation: generation + 1 };
            return Ok(StepOutcome::Generation);
        }
        self.state.carried = Some(search);
        let refines = generation < self.plan.simulator_generations() && !self.found(&tried);
        if refines {
            let search = LeastSquares::new(best(&tried).0.clone());
            self.state.phase = Phase::Refine { search, tests, tried, generation: generation + 1 };
        } else {
            self.settle_simulation(on, &tried);
        }
        Ok(StepOutcome::Generation)
    }

    /// One turn of least squares, or a new start where the last turn got nowhere.
    pub(in crate::coevolve::run) fn refine(
        &mut self,
        on: &mut Environment<'_>,
        mut search: LeastSquares,
        tests: Vec<usize>,
        mut tried: Vec<(UnitPoint, f64)>,
        generation: usize,
    ) -> Result<StepOutcome, Cancelled> {
        if search.done() {
            search = LeastSquares::near(&best(&tried).0, &mut self.stream(Stream::Simulators, generation));
        }
        let from = tried.len();
        let probes = search.probes();
        let residuals = self.residuals(on, &tests, &probes, &mut tried)?;
        if let Some(linear) = search.linearise(&probes, &residuals) {
            let steps = search.tries(&linear);
            let residuals = self.residuals(on, &tests, &steps, &mut tried)?;
            search.settle(&linear, &steps, &residuals);
        }
        let space = on.simulator.simulations();
        let (points, scores): (Vec<_>, Vec<_>) =
            tried[from..].iter().map(|(u, phi)| (space.from_unit(u), *phi)).unzip();
        self.record_generation(generation, points, &scores);
        if generation < self.plan.simulator_generations() && !self.found(&tried) {
            self.state.phase = Phase::Refine { search, tests, tried, generation: generation + 1 };
        } else {
            self.settle_simulation(on, &tried);
        }
        Ok(StepOutcome::Generation)
    }

    /// The residuals of some points on some tests; each point joins what was tried.
    fn residuals(
        &mut self,
        on: &Environment<'_>,
        tests: &[usize],
        units: &[UnitPoint],
        tried: &mut Vec<(UnitPoint, f64)>,
    ) -> Result<Vec<Option<Residuals>>, Cancelled> {
        let Some(distance) = ResidualDistance::of(on.distance) else { return Ok(vec![None; units.len()]) };
        let points: Vec<Vec<f64>> = units.iter().map(|u| on.simulator.simulations().from_unit(u)).collect();
        let entries: Vec<&Entry> = tests.iter().map(|&k| &self.state.ledger.entries()[k]).collect();
        let (phis, residuals): (Vec<f64>, Vec<_>) =
            evaluate::residuals(on.simulator, distance, &points, &entries, &mut self.state.cost)?.into_iter().unzip();
        tried.extend(units.iter().cloned().zip(phis));
        Ok(residuals)
    }

    pub(in crate::coevolve::run) fn record_generation(
        &mut self,
        generation: usize,
        points: Vec<Vec<f64>>,
        scores: &[f64],
    ) {
        let label = GenerationLabel { iteration: self.state.iteration, generation, side: Side::Simulators };
        self.state.history.generations.push(Generation::new(label, points, scores));
    }

    /// Whether what was tried is good enough.
    fn found(&self, tried: &[(UnitPoint, f64)]) -> bool {
        self.plan.phi_goal.is_some_and(|goal| best(tried).1 <= goal)
    }

    /// Ends step 3 with the best that was tried.
    fn settle_simulation(&mut self, on: &Environment<'_>, tried: &[(UnitPoint, f64)]) {
        let (space, best) = (on.simulator.simulations(), best(tried));
        (self.state.simulation, self.state.phi) = (space.from_unit(&best.0), Some(best.1));
        let rivals = transfer::rivals(tried, self.plan.transfer.rivals);
        self.state.rivals = rivals.iter().map(|u| space.from_unit(u)).collect();
        self.state.phase = Phase::End;
    }
}

/// The best that was tried, which is never nothing.
fn best(tried: &[(UnitPoint, f64)]) -> &(UnitPoint, f64) {
    &tried[best_index(&tried.iter().map(|t| t.1).collect::<Vec<_>>())]
}

/// The positions in the ledger of some of its entries.
fn indices<'a>(ledger: &'a Ledger, entries: &'a [&Entry]) -> impl Iterator<Item = usize> + 'a {
    entries.iter().filter_map(|e| ledger.entries().iter().position(|other| std::ptr::eq(*e, other)))
}
