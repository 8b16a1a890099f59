//! Transfer by quality diversity: a map of controllers in s_0, then one real test per iteration.

use super::coevolution::{Coevolution, Environment, StepOutcome, Stream, best_index};
use super::state::Phase;
use crate::coevolve::history::{Generation, GenerationLabel, Side};
use crate::coevolve::ledger::{Entry, PredictedFitness};
use crate::coevolve::map::{self, Outlook};
use crate::coevolve::plan::Method;
use crate::coevolve::transfer::ScoredController;
use crate::world::{Cancelled, Simulator};

impl Coevolution {
    /// The map, where the method makes one, and its predictions by all real tests so far. `simulator` is the one that
    /// the run acts on.
    pub fn outlook(&self, simulator: &dyn Simulator) -> Option<Outlook> {
        self.outlook_after(simulator, self.state.iteration)
    }

    /// The same by the tests up to an iteration.
    fn outlook_after(&self, simulator: &dyn Simulator, iteration: usize) -> Option<Outlook> {
        let (map, phase) = (self.state.map.as_ref()?, self.plan.map.as_ref()?);
        let entries = self.state.ledger.entries().iter();
        let tests: Vec<&Entry> = entries.filter(|entry| entry.trial.iteration <= iteration).collect();
        Some(Outlook::of(map, phase, simulator, &tests))
    }

    /// Begins the map, or chooses from it what is tried next.
    pub(super) fn begin_map(&mut self, on: &mut Environment<'_>) -> Result<StepOutcome, Cancelled> {
        if self.state.map.is_none() {
            self.state.map = self.plan.map.as_ref().and_then(|phase| phase.start(on.simulator.controllers().len()));
            self.state.phase = Phase::Map { generation: 1 };
            return self.step(on);
        }
        let explore = self.plan.map.as_ref().map_or(0.0, |phase| phase.explore);
        let outlook = self.outlook(on.simulator);
        let next = outlook.as_ref().and_then(|outlook| outlook.next(explore));
        let chosen =
            next.map(|next| ScoredController { unit: next.unit.clone(), fitness: next.promised, generation: 0 });
        self.state.controller = chosen.as_ref().map(|chosen| chosen.unit.clone()).or(self.state.controller.take());
        self.state.phase = Phase::Transfer { queue: chosen.into_iter().collect(), next: 0, testing: None };
        self.step(on)
    }

    /// A generation of the map.
    pub(super) fn fill_map(&mut self, on: &mut Environment<'_>, generation: usize) -> Result<StepOutcome, Cancelled> {
        let (Some(mut map), Some(phase)) = (self.state.map.take(), self.plan.map.as_ref()) else {
            self.state.phase = Phase::End;
            return self.step(on);
        };
        let (axes, generations) = (phase.axes(on.simulator), phase.generations);
        let units = map.ask(&mut self.stream(Stream::Controllers, generation));
        let (scores, places) = map::judged(on.simulator, &self.state.simulation, &axes, &units, &mut self.state.cost)?;
        let costs: Vec<f64> = scores.iter().map(|f| -f).collect();
        map.tell(&units, &costs, &places);
        self.state.map = Some(map);
        let best = on.simulator.controllers().from_unit(&units[best_index(&costs)]);
        let label = GenerationLabel { iteration: self.state.iteration, generation, side: Side::Controllers };
        self.state.history.generations.push(Generation::new(label, vec![best], &scores));
        self.state.phase =
            if generation < generations { Phase::Map { generation: generation + 1 } } else { Phase::Begin };
        Ok(StepOutcome::Generation)
    }

    /// The fitness predicted for a controller of the map before this iteration's tests.
    pub(super) fn predicted_by_map(&self, on: &Environment<'_>, controller: &ScoredController) -> PredictedFitness {
        let outlook = self.outlook_after(on.simulator, self.state.iteration - 1);
        let promise = outlook.as_ref().and_then(|outlook| outlook.promise(&controller.unit));
        PredictedFitness {
            value: promise.map(|promise| promise.promised),
            ci95: promise.and_then(|promise| promise.promised_ci95),
        }
    }

    /// Whether the map predicts nothing better than the best controller tried.
    pub(super) fn nothing_better(&self, on: &Environment<'_>) -> bool {
        let enough = self.plan.map.as_ref().map(|phase| phase.enough);
        let outlook = self.outlook(on.simulator).filter(|_| self.plan.method == Method::QualityDiversity);
        outlook.zip(enough).is_some_and(|(outlook, enough)| outlook.satisfied(enough))
    }
}
