//! The transitions of the state machine.

use super::coevolution::{Coevolution, Environment, StepOutcome};
use super::state::Phase;
use crate::coevolve::history::StopReason;
use crate::coevolve::ledger::Entry;
use crate::coevolve::plan::Method;
use crate::coevolve::transfer::ScoredController;

impl Coevolution {
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

    pub(super) fn stop(&mut self, reason: StopReason) -> StepOutcome {
        self.state.phase = Phase::Stopped(reason.clone());
        StepOutcome::Stopped(reason)
    }
}
