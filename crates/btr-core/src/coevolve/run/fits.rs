//! Whether a state is one of this run. A checkpoint with the right checksum may still hold anything; what passes here,
//! the steps can use without looking.

use super::state::{Estimation, Phase, RunState};
use crate::coevolve::estimation::Estimated;
use crate::coevolve::history::{Generation, Side};
use crate::coevolve::ledger::Entry;
use crate::coevolve::plan::{Plan, PosteriorPhase, SearchPhase};
use crate::coevolve::transfer::ScoredController;
use crate::search::{AnySearch, UnitPoint, is_on_cube};
use crate::world::Simulator;

/// A state that cannot be one of this run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0} in it do not fit the experiment")]
pub struct StateError(&'static str);

/// Whether the state is one of the plan's, in the simulator's spaces.
pub(super) fn check(state: &RunState, plan: &Plan, simulator: &dyn Simulator) -> Result<(), StateError> {
    let run = Expected { plan, simulator, state };
    let parts = [
        ("simulations", run.has_its_simulations()),
        ("controllers", run.has_its_controllers()),
        ("real tests", run.has_its_tests()),
        ("records", run.has_its_history()),
        ("numbers of the current step", run.has_its_phase()),
    ];
    parts.into_iter().try_for_each(|(part, fits)| if fits { Ok(()) } else { Err(StateError(part)) })
}

/// A state, and what it has to fit.
struct Expected<'a> {
    plan: &'a Plan,
    simulator: &'a dyn Simulator,
    state: &'a RunState,
}

impl Expected<'_> {
    fn has_its_simulations(&self) -> bool {
        let RunState { start, simulation, rivals, prior, estimated, carried, .. } = self.state;
        let (space, phase) = (self.simulator.simulations(), self.plan.simulators.as_ref());
        let is_search = |search| phase.is_some_and(|phase| AnySearch::continues(search, &phase.search, space.len()));
        [start, simulation].into_iter().chain(rivals).all(|point| space.check(point).is_ok())
            && self.is_simulation(prior)
            && estimated.as_ref().is_none_or(|estimated| self.is_estimate(estimated))
            && carried.as_ref().is_none_or(is_search)
    }

    fn has_its_controllers(&self) -> bool {
        let RunState { controller, ahead, map, .. } = self.state;
        let fresh = self.plan.map.as_ref().and_then(|phase| phase.start(self.simulator.controllers().len()));
        [controller, ahead].into_iter().flatten().all(|unit| self.is_controller(unit))
            && map.as_ref().is_none_or(|map| fresh.is_some_and(|fresh| map.continues(&fresh)))
    }

    fn has_its_tests(&self) -> bool {
        let RunState { ledger, iteration, since, suspicion, .. } = self.state;
        let fits = |(number, Entry { trial, .. }): (usize, &Entry)| {
            trial.number == number
                && (1..=*iteration).contains(&trial.iteration)
                && trial.scenario < self.simulator.scenarios()
                && self.simulator.controllers().check(&trial.controller).is_ok()
        };
        ledger.entries().iter().enumerate().all(fits)
            && *since <= ledger.spent()
            && suspicion.is_none_or(|first| first < ledger.spent())
    }

    fn has_its_history(&self) -> bool {
        let RunState { history, iteration, .. } = self.state;
        let (c, s) = (self.simulator.controllers().len(), self.simulator.simulations().len());
        let is_generation = |generation: &Generation| {
            let dims = if generation.side == Side::Simulators { s } else { c };
            generation.points.iter().all(|point| point.len() == dims)
        };
        (1..usize::MAX).contains(iteration)
            && history.iterations.iter().all(|record| record.i <= *iteration && record.parameters.len() == s)
            && history.generations.iter().all(is_generation)
            // S may have grown since.
            && history.drifts.iter().all(|drift| (0..=s).any(|dims| drift.former.is_of(dims)))
    }

    fn has_its_phase(&self) -> bool {
        let plan = self.plan;
        let (controllers, simulators) = (plan.controllers.as_ref(), plan.simulators.as_ref());
        match &self.state.phase {
            Phase::Begin | Phase::End | Phase::Stopped(_) | Phase::Enlarged(None) => true,
            Phase::Enlarged(Some(known)) => self.is_estimate(known),
            Phase::Map { generation } => {
                plan.map.as_ref().is_some_and(|phase| (1..=phase.generations).contains(generation))
            }
            Phase::Controllers { search, archive, generation } => {
                controllers.is_some_and(|phase| (1..=phase.generations).contains(generation))
                    && self.is_controller_search(search)
                    && self.are_controllers(archive)
            }
            Phase::Transfer { queue, next, testing } => {
                let in_reality = |search| self.is_controller_search(search) && self.tested() == *next;
                *next <= queue.len() * self.simulator.scenarios()
                    && self.are_controllers(queue)
                    && testing.as_ref().is_none_or(in_reality)
            }
            Phase::Simulators { search, tests, tried, generation } => {
                let dims = self.simulator.simulations().len();
                let is_search = |phase: &SearchPhase| {
                    (1..=phase.generations).contains(generation) && search.continues(&phase.search, dims)
                };
                simulators.is_some_and(is_search) && self.are_tests(tests) && self.were_tried(tried)
            }
            Phase::Refine { search, tests, tried, generation } => {
                (1..=plan.simulator_generations()).contains(generation)
                    && search.is_of(self.simulator.simulations().len())
                    && self.are_tests(tests)
                    && self.were_tried(tried)
            }
            Phase::Estimate(estimation) => self.is_estimation(estimation),
        }
    }

    fn is_estimation(&self, estimation: &Estimation) -> bool {
        let Estimation { tests, belief, turn, start, best, .. } = estimation;
        let is_due = |phase: &PosteriorPhase| (1..=phase.turns).contains(turn) && *start <= phase.restarts;
        self.plan.posterior.as_ref().is_some_and(is_due)
            && self.are_tests(tests)
            && belief.is_of(self.simulator.simulations().len())
            && best.as_ref().is_none_or(|best| self.is_estimate(best))
    }

    fn is_controller_search(&self, search: &AnySearch) -> bool {
        let dims = self.simulator.controllers().len();
        self.plan.controllers.as_ref().is_some_and(|phase| search.continues(&phase.search, dims))
    }

    fn is_controller(&self, unit: &[f64]) -> bool {
        is_on_cube(self.simulator.controllers().len(), unit)
    }

    fn is_simulation(&self, unit: &[f64]) -> bool {
        is_on_cube(self.simulator.simulations().len(), unit)
    }

    fn is_estimate(&self, estimated: &Estimated) -> bool {
        estimated.belief.is_of(self.simulator.simulations().len())
    }

    fn are_controllers(&self, controllers: &[ScoredController]) -> bool {
        controllers.iter().all(|controller| self.is_controller(&controller.unit))
    }

    /// Whether these are places of tests in the ledger that have a log.
    fn are_tests(&self, tests: &[usize]) -> bool {
        let entries = self.state.ledger.entries();
        tests.iter().all(|&test| entries.get(test).is_some_and(|entry| entry.fitness().is_some()))
    }

    /// Number of real tests of this iteration.
    fn tested(&self) -> usize {
        self.state.ledger.entries().iter().filter(|entry| entry.trial.iteration == self.state.iteration).count()
    }

    fn were_tried(&self, tried: &[(UnitPoint, f64)]) -> bool {
        !tried.is_empty() && tried.iter().all(|(unit, _)| self.is_simulation(unit))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::coevolve::fixture::{Toy, ToyRobot, estimating, whitened};
    use crate::coevolve::plan::Rule;
    use crate::coevolve::run::coevolution::{Coevolution, Environment, StepOutcome};
    use crate::search::SearchSpec;
    use crate::search::ga::GaSettings;

    /// A plan with both searches.
    fn searching() -> Plan {
        let search = SearchSpec::Ga(GaSettings { population: 6, ..GaSettings::default() });
        let phase = SearchPhase { generations: 2, search, carry_over: true, refine: 2 };
        let mut plan = Plan { posterior: None, simulators: Some(phase.clone()), ..estimating(2) };
        plan.transfer.rule = Rule::Fittest;
        Plan { controllers: Some(phase), ..plan }
    }

    /// The states of a run.
    fn states(plan: &Plan, toy: &Toy) -> Vec<RunState> {
        let (distance, mut robot) = (whitened(), ToyRobot::new(toy, &[1.7, 1.13], 3));
        let mut run = Coevolution::new(plan.clone(), 3, toy).unwrap();
        let mut states = vec![run.state().clone()];
        let mut on = Environment { simulator: toy, distance: &distance, reality: &mut robot };
        while !matches!(run.step(&mut on).unwrap(), StepOutcome::Stopped(_)) {
            states.push(run.state().clone());
        }
        states
    }

    #[test]
    fn every_state_of_a_run_fits_and_none_of_another_space() {
        let toy = Toy::driven(0.0, &[]);
        for plan in [searching(), estimating(2)] {
            for state in states(&plan, &toy) {
                assert_eq!(check(&state, &plan, &toy), Ok(()), "{:?}", state.phase);
                assert!(check(&state, &plan, &Toy::new(false, &[])).is_err(), "{:?}", state.phase);
            }
        }
    }

    #[test]
    fn what_a_step_would_stumble_over_does_not_fit() {
        let (toy, plan) = (Toy::driven(0.0, &[]), searching());
        let all = states(&plan, &toy);
        let refused = |damage: &dyn Fn(&mut RunState) -> bool, part: &'static str| {
            let mut tried = 0;
            for mut state in all.iter().cloned() {
                if damage(&mut state) {
                    tried += 1;
                    assert_eq!(check(&state, &plan, &toy), Err(StateError(part)));
                }
            }
            assert!(tried > 0, "{part}");
        };
        let last = |state: &mut RunState| state.rivals.last_mut().map(|rival| rival[0] = f64::NAN).is_some();
        refused(&|state| state.prior.pop().is_some(), "simulations");
        refused(&last, "simulations");
        refused(&|state| state.ahead.as_mut().map(|unit| unit[0] = 1.5).is_some(), "controllers");
        refused(&|state| state.suspicion.replace(state.ledger.spent()).is_none(), "real tests");
        refused(&|state| std::mem::take(&mut state.iteration) > 0 && state.ledger.spent() == 0, "records");
        let other = searching().simulators.map(|phase| phase.search.start(3, None)).unwrap();
        let phase = |state: &mut RunState| {
            match &mut state.phase {
                Phase::Controllers { generation, .. } => *generation = 3,
                Phase::Transfer { next, .. } => *next = 99,
                Phase::Simulators { tests, generation: 1, .. } => tests[0] = 99,
                Phase::Simulators { search, .. } => *search = other.clone(),
                Phase::Refine { tried, .. } => tried.clear(),
                _ => return false,
            }
            true
        };
        refused(&phase, "numbers of the current step");
    }
}
