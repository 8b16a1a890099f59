//! The choice of controllers under a posterior over S: their fitness over the posterior, and the expected information
//! of their tests.

use super::coevolution::{Coevolution, Environment, Stream, stream};
use crate::coevolve::estimation::root;
use crate::coevolve::estimation::{Ensemble, EnsembleErrors, TestInformation};
use crate::coevolve::evaluate;
use crate::coevolve::plan::PosteriorPhase;
use crate::coevolve::transfer::ScoredController;
use crate::optimize::Residuals;
use crate::search::{UnitPoint, uniform};
use crate::world::{Behaviour, Cancelled};
use nalgebra::DMatrix;
use std::cmp::Ordering;

/// A motion counts as predictable up to this unpredictable part, in multiples of the noise.
const PREDICTABLE: f64 = 1.0;
/// Divisor of the members of ensembles that estimate a test's expected information.
const MEMBERS_DIVISOR: usize = 2;
/// One in this many candidates of the informative rule comes from the search, the others from all of C.
const FITTEST: usize = 4;

impl Coevolution {
    /// Fitness that counts in the search for controllers: in s_{i−1}, or a quantile over the posterior.
    pub(super) fn robust_fitness(&mut self, on: &Environment<'_>, units: &[UnitPoint]) -> Result<Vec<f64>, Cancelled> {
        let Some(phase) = self.plan.posterior.clone() else {
            return evaluate::fitness(on.simulator, &self.state.simulation, units, &mut self.state.cost);
        };
        // The same draws for all generations of an iteration, so that differences between draws do not matter.
        let simulations = self.posterior_draws(on, Stream::Doubts, phase.samples);
        evaluate::fitness_over(on.simulator, &simulations, units, phase.quantile, &mut self.state.cost)
    }

    /// Simulations drawn from the posterior.
    pub(super) fn posterior_draws(&self, on: &Environment<'_>, what: Stream, count: usize) -> Vec<Vec<f64>> {
        let least = self.plan.posterior.as_ref().map_or(0.0, |phase| phase.least_doubt);
        let mut rng = self.stream(what, self.state.ledger.spent());
        let draws = self.belief().at_least(least).draws(count, &mut rng);
        draws.iter().map(|unit| on.simulator.simulations().from_unit(unit)).collect()
    }

    /// Whether all of S is identified to the plan's resolution, by simulations that explain the tests.
    pub(super) fn is_identified(&self, phase: &PosteriorPhase) -> bool {
        let identified = |belief: &crate::coevolve::Posterior| {
            (0..belief.mean().len()).all(|k| belief.identifies(k, phase.resolution))
        };
        self.state.estimated.as_ref().is_some_and(|estimated| estimated.explains && identified(&estimated.belief))
    }

    /// The controllers of an iteration; the most informative comes first while S is not identified.
    pub(super) fn most_informative_first(
        &mut self,
        on: &Environment<'_>,
        fittest: Vec<ScoredController>,
        count: usize,
    ) -> Result<Vec<ScoredController>, Cancelled> {
        let Some(phase) = self.plan.posterior.clone() else {
            return Ok(fittest.into_iter().take(count).collect());
        };
        if self.is_identified(&phase) {
            return Ok(fittest.into_iter().take(count).collect());
        }
        let candidates = self.candidates(on, &fittest)?;
        let members =
            (phase.members(self.state.simulation.len()) / MEMBERS_DIVISOR).max(self.state.simulation.len() + 8);
        let gains: Vec<ExpectedGain> = candidates
            .iter()
            .map(|candidate| self.expected_gain(on, &candidate.unit, members))
            .collect::<Result<_, _>>()?;
        let best = (0..candidates.len()).max_by(|&a, &b| gains[a].order(&gains[b]).then(b.cmp(&a)));
        let first = best.map(|k| candidates[k].clone());
        let others = fittest.into_iter().filter(|other| Some(&other.unit) != first.as_ref().map(|first| &first.unit));
        Ok(first.clone().into_iter().chain(others).take(count).collect())
    }

    /// Candidates of the informative rule: the fittest, and those of others drawn from C that are no worse than half of
    /// these.
    fn candidates(
        &mut self,
        on: &Environment<'_>,
        fittest: &[ScoredController],
    ) -> Result<Vec<ScoredController>, Cancelled> {
        let count = self.plan.transfer.candidates.max(1);
        let best: Vec<ScoredController> = fittest.iter().take(count.div_ceil(FITTEST)).cloned().collect();
        let mut rng = self.stream(Stream::Candidates, 0);
        let dims = on.simulator.controllers().len();
        let units: Vec<UnitPoint> = (best.len()..count).map(|_| uniform(dims, &mut rng)).collect();
        let fitness = self.robust_fitness(on, &units)?;
        let mut sorted = fitness.clone();
        sorted.sort_by(f64::total_cmp);
        let median = sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NEG_INFINITY);
        let drawn = units.into_iter().zip(fitness).filter(|(_, fitness)| *fitness >= median && fitness.is_finite());
        let drawn = drawn.map(|(unit, fitness)| ScoredController { unit, fitness, generation: 0 });
        Ok(best.into_iter().chain(drawn).collect())
    }

    /// Expected information about S from a test of this controller.
    fn expected_gain(
        &mut self,
        on: &Environment<'_>,
        unit: &UnitPoint,
        members: usize,
    ) -> Result<ExpectedGain, Cancelled> {
        let belief = self.belief();
        let mut rng = stream(self.state.seed, Stream::Candidates, self.state.iteration as u64, 1);
        let draws = belief.draws(members, &mut rng);
        let points: Vec<Vec<f64>> = draws.iter().map(|unit| on.simulator.simulations().from_unit(unit)).collect();
        let mut total = DMatrix::zeros(draws[0].len(), draws[0].len());
        let mut unpredictable = 0.0f64;
        for scenario in 0..on.simulator.scenarios() {
            let behaviours = evaluate::behaviours(on.simulator, &points, unit, scenario, &mut self.state.cost)?;
            match information(on, &draws, &behaviours) {
                Some((information, left)) => (total, unpredictable) = (total + information, unpredictable.max(left)),
                None => unpredictable = f64::INFINITY,
            }
        }
        let frame = root(belief.covariance());
        let share = DMatrix::identity(total.nrows(), total.ncols()) + frame.transpose() * total * &frame;
        let gain_nats = share.cholesky().map_or(0.0, |factor| factor.l().diagonal().iter().map(|x| x.ln()).sum());
        Ok(ExpectedGain { gain_nats, unpredictable })
    }
}

/// Expected information of a test.
struct ExpectedGain {
    /// Information about S.
    gain_nats: f64,
    /// The unpredictable part of its readings, in multiples of the noise.
    unpredictable: f64,
}

impl ExpectedGain {
    /// More information is better. The regression is unreliable for motions that are mostly unpredictable: such tests
    /// come last, the most predictable of them first.
    fn order(&self, other: &Self) -> Ordering {
        let excess = |gain: &ExpectedGain| (gain.unpredictable - PREDICTABLE).max(0.0);
        excess(other).total_cmp(&excess(self)).then(self.gain_nats.total_cmp(&other.gain_nats))
    }
}

/// Information from a test and its unpredictable part, if the first behaviour of an ensemble were the robot's.
fn information(
    on: &Environment<'_>,
    draws: &[UnitPoint],
    behaviours: &[Option<Behaviour>],
) -> Option<(DMatrix<f64>, f64)> {
    let squares = on.distance.as_squares()?;
    let present = || draws.iter().zip(behaviours).filter_map(|(unit, behaviour)| Some((unit, behaviour.as_ref()?)));
    let (_, robot) = present().next()?;
    let errors: Vec<Residuals> = present().map(|(_, behaviour)| squares.residuals(robot, behaviour)).collect();
    let members: Vec<UnitPoint> = present().map(|(unit, _)| unit.clone()).collect();
    let ensemble = Ensemble::of(&members)?;
    let errors_on_test = EnsembleErrors::of(&ensemble, &errors)?;
    Some((TestInformation::of(&ensemble, &errors_on_test).information, errors_on_test.unpredictable()))
}
