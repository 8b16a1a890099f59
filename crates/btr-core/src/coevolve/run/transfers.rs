//! Step 2: the chosen controllers are tried in reality.

use super::coevolution::{Coevolution, Environment, StepOutcome, Stream};
use super::state::Phase;
use crate::coevolve::correction::LinearCorrection;
use crate::coevolve::evaluate;
use crate::coevolve::history::StopReason;
use crate::coevolve::ledger::{Entry, NoOutcome, PredictedFitness};
use crate::coevolve::plan::Method;
use crate::coevolve::promise;
use crate::coevolve::transfer::ScoredController;
use crate::search::{AnySearch, UnitPoint};
use crate::world::{Cancelled, Trial};

/// A run stops after this many tests if none returned usable data: tests wear a robot out.
const VAIN: usize = 3;

impl Coevolution {
    pub(super) fn transfer(
        &mut self,
        on: &mut Environment<'_>,
        queue: Vec<ScoredController>,
        next: usize,
        testing: Option<AnySearch>,
    ) -> Result<StepOutcome, Cancelled> {
        let explores = testing.is_none();
        if self.state.ledger.spent() >= VAIN && self.no_usable_test(on, explores) {
            return self.stop(StopReason::NoRealData);
        }
        let trials = self.trials(on, &queue, next);
        let Some(trial) = trials.first().cloned() else { return self.transferred(on, &queue, testing) };
        let cost = self.state.cost;
        let predicted = self.predicted(on, &queue[next / on.simulator.scenarios()])?;
        let announced = on.reality.announce(&trials).map_err(NoOutcome::from);
        let result = announced.and_then(|()| self.state.ledger.carry_out(trial, predicted, on.reality));
        self.state.phase = Phase::Transfer { queue, next: next + usize::from(result.is_ok()), testing };
        if result.is_err() {
            // The prediction is made again with the test.
            self.state.cost = cost;
        }
        match result {
            Ok(()) => Ok(StepOutcome::Tested),
            Err(NoOutcome::Pending(what)) => Ok(StepOutcome::Waiting(what)),
            Err(NoOutcome::Unsafe(why)) => Ok(StepOutcome::Unsafe(why)),
            Err(NoOutcome::Storage(why)) => Ok(StepOutcome::Storage(why)),
        }
    }

    /// Whether no real test returned usable data: a comparable behaviour for step 3, or a fitness otherwise.
    fn no_usable_test(&self, on: &Environment<'_>, explores: bool) -> bool {
        let compares = explores && !matches!(self.plan.method, Method::LinearCorrection | Method::QualityDiversity);
        let is_of_use = |entry: &Entry| match entry.behaviour() {
            // A behaviour that cannot be compared with itself cannot be compared with any other.
            Some(real) if compares => on.distance.distance(real, real).is_finite(),
            Some(real) => real.fitness.is_finite(),
            None => false,
        };
        !self.state.ledger.entries().iter().any(is_of_use)
    }

    /// What a controller's fitness in reality is expected to be, with an interval where there is a posterior or a map.
    fn predicted(
        &mut self,
        on: &Environment<'_>,
        controller: &ScoredController,
    ) -> Result<PredictedFitness, Cancelled> {
        if self.plan.method == Method::QualityDiversity {
            return Ok(self.predicted_by_map(on, controller));
        }
        if self.plan.posterior.is_none() || !controller.fitness.is_finite() {
            let value = Some(controller.fitness).filter(|fitness| fitness.is_finite());
            return Ok(PredictedFitness { value, ci95: None });
        }
        let draws = self.posterior_draws(on, Stream::Promises, promise::DRAWS);
        let simulations = std::iter::once(self.state.simulation.clone()).chain(draws).collect::<Vec<_>>();
        let units = std::slice::from_ref(&controller.unit);
        let of = evaluate::fitness_in(on.simulator, &simulations, units, &mut self.state.cost)?.concat();
        let (fitness, draws) = of.split_at(1);
        let value = fitness.first().copied().filter(|fitness| fitness.is_finite());
        Ok(PredictedFitness { value, ci95: promise::interval(draws) })
    }

    /// What is left to try in this iteration: every chosen controller in every scenario, as far as the budget goes.
    pub(super) fn trials(&self, on: &Environment<'_>, queue: &[ScoredController], next: usize) -> Vec<Trial> {
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

    /// All tests of the iteration are done: reports them to the search in reality, or goes on to step 3.
    pub(super) fn transferred(
        &mut self,
        on: &mut Environment<'_>,
        queue: &[ScoredController],
        testing: Option<AnySearch>,
    ) -> Result<StepOutcome, Cancelled> {
        if let Some(search) = testing {
            return self.finish_real_generation(on, queue, search);
        }
        // A map's controllers are tried one at a time; a failure of the first is no evidence on the others.
        let goes_on = self.plan.method == Method::QualityDiversity && self.state.ledger.spent() > 0;
        if !goes_on && self.no_usable_test(on, true) {
            return self.stop(StopReason::NoRealData);
        }
        match self.plan.method {
            Method::LinearCorrection => {
                self.correct(on)?;
                self.state.phase = Phase::End;
            }
            Method::QualityDiversity => self.state.phase = Phase::End,
            _ if !on.simulator.simulations().is_empty() => {
                self.state.phase = self.begin_simulators(on, self.state.iteration)?;
            }
            _ => self.state.phase = Phase::End,
        }
        self.step(on)
    }

    /// Refits the estimate of f_r − f_s to the whole ledger. f_s is simulated anew: the fitness predicted before each
    /// test contains the estimate of that time.
    fn correct(&mut self, on: &Environment<'_>) -> Result<(), Cancelled> {
        let entries = self.state.ledger.entries().iter();
        let tested: Vec<(UnitPoint, f64)> = entries
            .filter_map(|e| Some((on.simulator.controllers().to_unit(&e.trial.controller), e.fitness()?)))
            .collect();
        let units: Vec<UnitPoint> = tested.iter().map(|(unit, _)| unit.clone()).collect();
        let simulated = evaluate::fitness(on.simulator, &self.state.simulation, &units, &mut self.state.cost)?;
        let gaps = tested.into_iter().zip(simulated).map(|((unit, real), sim)| (unit, real - sim));
        self.state.correction = LinearCorrection::fit(&gaps.collect::<Vec<_>>());
        Ok(())
    }
}
