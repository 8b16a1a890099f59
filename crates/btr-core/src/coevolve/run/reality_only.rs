//! The baseline without a simulation: reality is the environment of the controller search.

use super::coevolution::{Coevolution, Environment, StepOutcome, Stream, best_index};
use super::state::Phase;
use crate::coevolve::history::{Generation, GenerationLabel, Side, StopReason};
use crate::coevolve::transfer::ScoredController;
use crate::search::{AnySearch, Search, UnitPoint};
use crate::world::Cancelled;

impl Coevolution {
    /// Reality as the environment of the controller search: the next population goes to the robot.
    pub(super) fn next_real_generation(
        &mut self,
        on: &mut Environment<'_>,
        mut search: AnySearch,
    ) -> Result<StepOutcome, Cancelled> {
        let units = search.ask(&mut self.stream(Stream::Controllers, 1));
        let queue = units.into_iter().map(|unit| ScoredController { unit, fitness: f64::NAN, generation: 1 }).collect();
        self.state.phase = Phase::Transfer { queue, next: 0, testing: Some(search) };
        self.step(on)
    }

    /// The robot has tested a whole population (or the budget ended within it).
    pub(super) fn finish_real_generation(
        &mut self,
        on: &mut Environment<'_>,
        queue: &[ScoredController],
        mut search: AnySearch,
    ) -> Result<StepOutcome, Cancelled> {
        let scenarios = on.simulator.scenarios();
        let mine: Vec<f64> = (self.state.ledger.entries().iter())
            .filter(|e| e.trial.iteration == self.state.iteration)
            .map(|e| e.fitness().unwrap_or(f64::NEG_INFINITY))
            .collect();
        let fitness: Vec<f64> =
            mine.chunks_exact(scenarios).map(|f| f.iter().sum::<f64>() / scenarios as f64).collect();
        let units: Vec<UnitPoint> = queue.iter().take(fitness.len()).map(|c| c.unit.clone()).collect();
        let costs: Vec<f64> = fitness.iter().map(|f| -f).collect();
        if !units.is_empty() {
            let best = best_index(&costs);
            self.state.controller = Some(units[best].clone());
            self.state.ahead = self.state.controller.clone();
            let point = on.simulator.controllers().from_unit(&units[best]);
            let label = GenerationLabel { iteration: self.state.iteration, generation: 1, side: Side::Controllers };
            self.state.history.generations.push(Generation::new(label, vec![point], &fitness));
        }
        let record = self.record(on)?;
        self.state.history.iterations.push(record);
        if self.state.iteration >= self.plan.iterations {
            self.state.phase = Phase::Stopped(StopReason::IterationsDone);
            return Ok(StepOutcome::Iteration);
        }
        if units.len() < queue.len() || self.tests_left() == 0 {
            self.state.phase = Phase::Stopped(StopReason::RealTestsSpent);
            return Ok(StepOutcome::Iteration);
        }
        search.tell(&units, &costs);
        self.state.iteration += 1;
        let units = search.ask(&mut self.stream(Stream::Controllers, 1));
        let queue = units.into_iter().map(|unit| ScoredController { unit, fitness: f64::NAN, generation: 1 }).collect();
        self.state.phase = Phase::Transfer { queue, next: 0, testing: Some(search) };
        Ok(StepOutcome::Iteration)
    }
}
