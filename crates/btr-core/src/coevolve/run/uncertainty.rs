//! What a posterior over S does to the choice of controllers: they are judged by what it leaves open, and tried where that
//! teaches most.

use super::coevolution::{Coevolution, Environment, Stream, stream};
use crate::coevolve::estimation::root;
use crate::coevolve::estimation::{Ensemble, EnsembleErrors, TestInformation};
use crate::coevolve::evaluate;
use crate::coevolve::plan::PosteriorPhase;
use crate::coevolve::transfer::ScoredController;
use crate::optimize::Residuals;
use crate::search::{UnitPoint, uniform};
use crate::world::Behaviour;
use nalgebra::DMatrix;
use std::cmp::Ordering;

/// Up to so many multiples of the noise a motion counts as orderly.
const ORDERLY: f64 = 1.0;
/// Members of the ensembles that ask what a test would tell: half of what learning from it takes.
const GLANCE: usize = 2;
/// One in so many candidates of the informative rule comes from the search, the others from all of C.
const FITTEST: usize = 4;

impl Coevolution {
    /// Fitness that counts in the search for controllers: in s_{i−1}, or a quantile over what the posterior leaves open.
    pub(super) fn doubted_fitness(&mut self, on: &Environment<'_>, units: &[UnitPoint]) -> Vec<f64> {
        let Some(phase) = self.plan.posterior.clone() else {
            return evaluate::fitness(on.simulator, &self.state.simulation, units, &mut self.state.cost);
        };
        // The same ones for all generations of an iteration, so that controllers are compared and not draws.
        let simulations = self.doubtful(on, Stream::Doubts, phase.samples);
        evaluate::fitness_over(on.simulator, (&simulations, phase.quantile), units, &mut self.state.cost)
    }

    /// Simulations that may be right, drawn from the posterior.
    pub(super) fn doubtful(&self, on: &Environment<'_>, what: Stream, count: usize) -> Vec<Vec<f64>> {
        let least = self.plan.posterior.as_ref().map_or(0.0, |phase| phase.least_doubt);
        let mut rng = self.stream(what, self.state.ledger.spent());
        let draws = self.belief().at_least(least).draws(count, &mut rng);
        draws.iter().map(|unit| on.simulator.simulations().from_unit(unit)).collect()
    }

    /// Whether all of S is told as well as the plan asks for, by simulations that explain the tests.
    pub(super) fn all_is_told(&self, phase: &PosteriorPhase) -> bool {
        let told =
            |belief: &crate::coevolve::Posterior| (0..belief.mean().len()).all(|k| belief.tells(k, phase.resolution));
        self.state.estimated.as_ref().is_some_and(|estimated| estimated.explains && told(&estimated.belief))
    }

    /// The controllers of an iteration, the most instructive first as long as something is to be learnt.
    pub(super) fn instructive(
        &mut self,
        on: &Environment<'_>,
        fittest: Vec<ScoredController>,
        count: usize,
    ) -> Vec<ScoredController> {
        let Some(phase) = self.plan.posterior.clone() else { return fittest.into_iter().take(count).collect() };
        if self.all_is_told(&phase) {
            return fittest.into_iter().take(count).collect();
        }
        let candidates = self.candidates(on, &fittest);
        let members = (phase.members(self.state.simulation.len()) / GLANCE).max(self.state.simulation.len() + 8);
        let lessons: Vec<ExpectedGain> =
            candidates.iter().map(|candidate| self.lesson(on, &candidate.unit, members)).collect();
        let best = (0..candidates.len()).max_by(|&a, &b| lessons[a].order(&lessons[b]).then(b.cmp(&a)));
        let first = best.map(|k| candidates[k].clone());
        let others = fittest.into_iter().filter(|other| Some(&other.unit) != first.as_ref().map(|first| &first.unit));
        first.clone().into_iter().chain(others).take(count).collect()
    }

    /// Controllers to learn from: the fittest, and those of others drawn from C that are no worse than half of these.
    fn candidates(&mut self, on: &Environment<'_>, fittest: &[ScoredController]) -> Vec<ScoredController> {
        let count = self.plan.transfer.candidates.max(1);
        let best: Vec<ScoredController> = fittest.iter().take(count.div_ceil(FITTEST)).cloned().collect();
        let mut rng = self.stream(Stream::Candidates, 0);
        let dims = on.simulator.controllers().len();
        let units: Vec<UnitPoint> = (best.len()..count).map(|_| uniform(dims, &mut rng)).collect();
        let fitness = self.doubted_fitness(on, &units);
        let mut sorted = fitness.clone();
        sorted.sort_by(f64::total_cmp);
        let median = sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NEG_INFINITY);
        let drawn = units.into_iter().zip(fitness).filter(|(_, fitness)| *fitness >= median && fitness.is_finite());
        best.into_iter().chain(drawn.map(|(unit, fitness)| ScoredController { unit, fitness, generation: 0 })).collect()
    }

    /// What a test of this controller is expected to tell about S.
    fn lesson(&mut self, on: &Environment<'_>, unit: &UnitPoint, members: usize) -> ExpectedGain {
        let belief = self.belief();
        let mut rng = stream(self.state.seed, Stream::Candidates, self.state.iteration as u64, 1);
        let draws = belief.draws(members, &mut rng);
        let points: Vec<Vec<f64>> = draws.iter().map(|unit| on.simulator.simulations().from_unit(unit)).collect();
        let mut told = DMatrix::zeros(draws[0].len(), draws[0].len());
        let mut unpredictable = 0.0f64;
        for scenario in 0..on.simulator.scenarios() {
            let behaviours = evaluate::behaviours(on.simulator, &points, (unit, scenario), &mut self.state.cost);
            match information(on, &draws, &behaviours) {
                Some((information, left)) => (told, unpredictable) = (told + information, unpredictable.max(left)),
                None => unpredictable = f64::INFINITY,
            }
        }
        let frame = root(belief.covariance());
        let share = DMatrix::identity(told.nrows(), told.ncols()) + frame.transpose() * told * &frame;
        let gain_nats = share.cholesky().map_or(0.0, |factor| factor.l().diagonal().iter().map(|x| x.ln()).sum());
        ExpectedGain { gain_nats, unpredictable }
    }
}

/// What a test is expected to tell.
struct ExpectedGain {
    /// Information about S.
    gain_nats: f64,
    /// What of its readings nobody can foretell, in multiples of the noise.
    unpredictable: f64,
}

impl ExpectedGain {
    /// The more it tells the better. A regression over a motion that is mostly unpredictable promises what it cannot keep:
    /// such tests come last, the most orderly of them first.
    fn order(&self, other: &Self) -> Ordering {
        let excess = |lesson: &ExpectedGain| (lesson.unpredictable - ORDERLY).max(0.0);
        excess(other).total_cmp(&excess(self)).then(self.gain_nats.total_cmp(&other.gain_nats))
    }
}

/// What behaviours of an ensemble would tell, and what of them is unpredictable, if one of them were the robot's.
fn information(
    on: &Environment<'_>,
    draws: &[UnitPoint],
    behaviours: &[Option<Behaviour>],
) -> Option<(DMatrix<f64>, f64)> {
    let squares = on.distance.as_squares()?;
    let there = || draws.iter().zip(behaviours).filter_map(|(unit, behaviour)| Some((unit, behaviour.as_ref()?)));
    let (_, robot) = there().next()?;
    let errors: Vec<Residuals> = there().map(|(_, behaviour)| squares.residuals(robot, behaviour)).collect();
    let members: Vec<UnitPoint> = there().map(|(unit, _)| unit.clone()).collect();
    let ensemble = Ensemble::of(&members)?;
    let shown = EnsembleErrors::of(&ensemble, &errors)?;
    Some((TestInformation::of(&ensemble, &shown).information, shown.unpredictable()))
}
