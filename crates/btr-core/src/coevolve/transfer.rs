//! Step 2: which controllers are tried in reality.

use super::evaluate::{self, Cost};
use super::ledger::Ledger;
use super::plan::{Plan, Rule};
use crate::distance::Distance;
use crate::random::Rng;
use crate::search::UnitPoint;
use crate::search::ga::neighbours;
use crate::world::{Cancelled, Simulator};
use serde::{Deserialize, Serialize};

/// Bits per parameter when the neighbourhood rule mutates a controller.
const NEIGHBOUR_BITS: u32 = 16;
/// How often mutants are drawn again where too many fail, were tried before or did not change.
const NEIGHBOUR_ROUNDS: usize = 20;

/// A controller with the score its generation gave it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct ScoredController {
    pub unit: UnitPoint,
    pub fitness: f64,
    pub generation: usize,
}

/// The controllers of an iteration that could be transferred: those whose simulation did not fail and that reality has
/// not seen, each once. The last generation comes first, in descending fitness; earlier generations follow.
pub(super) fn transferable(
    archive: &[ScoredController],
    ledger: &Ledger,
    simulator: &dyn Simulator,
) -> Vec<ScoredController> {
    let mut order: Vec<&ScoredController> = archive.iter().filter(|c| c.fitness.is_finite()).collect();
    order.sort_by(|a, b| b.generation.cmp(&a.generation).then(b.fitness.total_cmp(&a.fitness)));
    let mut chosen: Vec<ScoredController> = Vec::new();
    for candidate in order {
        let point = simulator.controllers().from_unit(&candidate.unit);
        if !ledger.has_tried(&point) && chosen.iter().all(|c| c.unit != candidate.unit) {
            chosen.push(candidate.clone());
        }
    }
    chosen
}

/// Inputs of the rules.
pub(super) struct TransferChoice<'a> {
    pub plan: &'a Plan,
    pub simulator: &'a dyn Simulator,
    pub distance: &'a dyn Distance,
    /// s_{i−1}.
    pub simulation: &'a [f64],
    /// What was tried before.
    pub ledger: &'a Ledger,
    /// Simulations that explain the past about as well as s_{i−1}.
    pub rivals: &'a [Vec<f64>],
    /// See [`transferable`].
    pub candidates: Vec<ScoredController>,
}

impl TransferChoice<'_> {
    /// The controllers to try, c_i first; at most `m`.
    pub(super) fn choose(
        mut self,
        m: usize,
        rng: &mut Rng,
        cost: &mut Cost,
    ) -> Result<Vec<ScoredController>, Cancelled> {
        match self.plan.transfer.rule {
            // The informative rule needs the posterior: see `most_informative_first`.
            Rule::Fittest | Rule::Informative => {
                self.candidates.truncate(m);
                Ok(self.candidates)
            }
            Rule::Neighbourhood => self.neighbourhood(m, rng, cost),
            Rule::Disagreement => self.disagreeing(m, cost),
        }
    }

    fn neighbourhood(self, m: usize, rng: &mut Rng, cost: &mut Cost) -> Result<Vec<ScoredController>, Cancelled> {
        let Some(best) = self.candidates.into_iter().next() else { return Ok(Vec::new()) };
        let mut chosen = vec![best.clone()];
        for _ in 0..NEIGHBOUR_ROUNDS {
            let units = neighbours(&best.unit, m - chosen.len(), self.plan.transfer.mutation, NEIGHBOUR_BITS, rng);
            let fitness = evaluate::fitness(self.simulator, self.simulation, &units, cost)?;
            let generation = best.generation;
            let mutants =
                units.into_iter().zip(fitness).map(|(unit, fitness)| ScoredController { unit, fitness, generation });
            for mutant in mutants.filter(|mutant| mutant.fitness.is_finite()) {
                let point = self.simulator.controllers().from_unit(&mutant.unit);
                let is_like = |c: &ScoredController| self.simulator.controllers().from_unit(&c.unit) == point;
                if !self.ledger.has_tried(&point) && !chosen.iter().any(is_like) {
                    chosen.push(mutant);
                }
            }
            if chosen.len() >= m {
                break;
            }
        }
        Ok(chosen)
    }

    fn disagreeing(self, m: usize, cost: &mut Cost) -> Result<Vec<ScoredController>, Cancelled> {
        let mut candidates = self.candidates;
        candidates.truncate(self.plan.transfer.candidates.max(m));
        if candidates.is_empty() {
            return Ok(candidates);
        }
        let fittest = candidates.remove(0);
        let units: Vec<UnitPoint> = candidates.iter().map(|c| c.unit.clone()).collect();
        let scores = evaluate::disagreement(self.simulator, self.distance, self.rivals, &units, cost)?;
        let mut order: Vec<usize> = (0..candidates.len()).collect();
        order.sort_by(|&a, &b| scores[b].total_cmp(&scores[a]).then(a.cmp(&b)));
        Ok(std::iter::once(fittest).chain(order.into_iter().take(m - 1).map(|k| candidates[k].clone())).collect())
    }
}

/// Up to `count` rival simulations: the best first, each at least one percent of the bounds away from those before it
/// in some parameter; closer ones fill up where there are not enough.
pub(super) fn rivals(simulations: &[(UnitPoint, f64)], count: usize) -> Vec<UnitPoint> {
    let mut order: Vec<&(UnitPoint, f64)> = simulations.iter().filter(|(_, phi)| phi.is_finite()).collect();
    order.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut chosen: Vec<&UnitPoint> = Vec::new();
    for apart in [0.01, 0.0] {
        for (unit, _) in &order {
            let far = |other: &&UnitPoint| unit.iter().zip(other.iter()).any(|(a, b)| (a - b).abs() > apart);
            if chosen.len() < count && chosen.iter().all(far) {
                chosen.push(unit);
            }
        }
    }
    chosen.into_iter().cloned().collect()
}
