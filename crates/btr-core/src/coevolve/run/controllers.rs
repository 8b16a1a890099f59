//! Step 1: the search for controllers in s_{i−1}, and the choice of those that are transferred.

use super::coevolution::{Coevolution, Environment, StepOutcome, Stream, best_index, stream};
use super::state::Phase;
use crate::coevolve::evaluate;
use crate::coevolve::history::{Generation, GenerationLabel, Side};
use crate::coevolve::plan::{Method, Rule};
use crate::coevolve::transfer::{self, ScoredController, TransferChoice};
use crate::search::uniform;
use crate::search::{AnySearch, Search, UnitPoint};
use crate::world::Cancelled;

impl Coevolution {
    pub(super) fn controllers(
        &mut self,
        on: &mut Environment<'_>,
        mut search: AnySearch,
        mut archive: Vec<ScoredController>,
        generation: usize,
    ) -> Result<StepOutcome, Cancelled> {
        let units = search.ask(&mut self.stream(Stream::Controllers, generation));
        let scores = self.score_controllers(on, &units)?;
        search.tell(&units, &scores.iter().map(|f| -f).collect::<Vec<_>>());
        let best = best_index(&scores.iter().map(|f| -f).collect::<Vec<_>>());
        let point = on.simulator.controllers().from_unit(&units[best]);
        self.state.history.generations.push(Generation::new(
            GenerationLabel { iteration: self.state.iteration, generation, side: Side::Controllers },
            vec![point],
            &scores,
        ));
        archive.extend(units.into_iter().zip(scores).map(|(unit, fitness)| ScoredController {
            unit,
            fitness,
            generation,
        }));
        self.state.phase = match &self.plan.controllers {
            Some(phase) if generation < phase.generations => {
                Phase::Controllers { search, archive, generation: generation + 1 }
            }
            _ => self.choose(on, &archive)?,
        };
        Ok(StepOutcome::Generation)
    }

    /// Fitness in s_{i−1}, corrected or replaced as the method requires.
    pub(super) fn score_controllers(
        &mut self,
        on: &Environment<'_>,
        units: &[UnitPoint],
    ) -> Result<Vec<f64>, Cancelled> {
        if self.explores() {
            let rivals = self.rivals(on);
            return evaluate::disagreement(on.simulator, on.distance, &rivals, units, &mut self.state.cost);
        }
        let fitness = self.robust_fitness(on, units)?;
        Ok(fitness.iter().zip(units).map(|(f, unit)| f + self.state.correction.at(unit)).collect())
    }

    /// Estimation-exploration maximises disagreement in all iterations but the last.
    pub(super) fn explores(&self) -> bool {
        self.plan.method == Method::EstimationExploration && self.state.iteration < self.plan.iterations
    }

    pub(super) fn choose(&mut self, on: &Environment<'_>, archive: &[ScoredController]) -> Result<Phase, Cancelled> {
        let m = self
            .plan
            .transfers(on.simulator.controllers().len())
            .min(self.tests_left().div_ceil(on.simulator.scenarios()));
        let mut candidates = transfer::transferable(archive, &self.state.ledger, on.simulator);
        let informative = self.plan.transfer.rule == Rule::Informative;
        if informative {
            // All were evaluated in the same simulations, so the last generation has no precedence.
            candidates.sort_by(|a, b| b.fitness.total_cmp(&a.fitness));
        }
        let fittest = candidates.first().map(|c| c.unit.clone());
        let mut queue = self.chosen(on, candidates, m)?;
        if self.explores() {
            let units: Vec<UnitPoint> = queue.iter().map(|c| c.unit.clone()).collect();
            let fitness = evaluate::fitness(on.simulator, &self.state.simulation, &units, &mut self.state.cost)?;
            queue.iter_mut().zip(fitness).for_each(|(c, f)| c.fitness = f);
        }
        if let Some(first) = queue.first() {
            self.state.controller = Some(first.unit.clone());
            // The next search starts from the fittest controller, not from an informative one.
            self.state.ahead = fittest.filter(|_| informative).or_else(|| self.state.controller.clone());
        }
        Ok(Phase::Transfer { queue, next: 0, testing: None })
    }

    /// The candidates chosen by the plan's rule.
    fn chosen(
        &mut self,
        on: &Environment<'_>,
        candidates: Vec<ScoredController>,
        m: usize,
    ) -> Result<Vec<ScoredController>, Cancelled> {
        if self.plan.transfer.rule == Rule::Informative {
            return self.most_informative_first(on, candidates, m);
        }
        let rivals = self.rivals(on);
        let choice = TransferChoice {
            plan: &self.plan,
            simulator: on.simulator,
            distance: on.distance,
            simulation: &self.state.simulation,
            ledger: &self.state.ledger,
            rivals: &rivals,
            candidates,
        };
        let mut rng = self.stream(Stream::Neighbours, 0);
        choice.choose(m, &mut rng, &mut self.state.cost)
    }

    /// Simulations that explain the tests about equally well; random ones before any test.
    pub(super) fn rivals(&self, on: &Environment<'_>) -> Vec<Vec<f64>> {
        if self.plan.posterior.is_some() {
            return self.posterior_draws(on, Stream::FirstRivals, self.plan.transfer.rivals);
        }
        if !self.state.rivals.is_empty() {
            return self.state.rivals.clone();
        }
        let space = on.simulator.simulations();
        (0..self.plan.transfer.rivals as u64)
            .map(|k| space.from_unit(&uniform(space.len(), &mut stream(self.state.seed, Stream::FirstRivals, k, 0))))
            .collect()
    }
}
