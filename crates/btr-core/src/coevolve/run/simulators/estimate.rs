//! Step 3 as estimation: a posterior over S instead of one best point. Where an estimate does not explain the tests, it
//! is repeated from other starts; where earlier tests had confirmed the belief, [`detect_drift`](super::detect_drift)
//! decides whether the robot has changed.

use crate::coevolve::estimation::Posterior;
use crate::coevolve::estimation::{Estimated, EstimationProblem, PriorPredictive, TurnResult, WIDENING};
use crate::coevolve::ledger::Entry;
use crate::coevolve::plan::PosteriorPhase;
use crate::coevolve::run::coevolution::{Coevolution, Environment, StepOutcome, Stream};
use crate::coevolve::run::state::{Estimation, Phase};
use crate::world::Cancelled;
use nalgebra::DVector;

impl Coevolution {
    /// Begins step 3 on all tests that count, from the present belief. Nothing is estimated where all of S is
    /// identified already and the fresh tests are as predicted.
    pub(in crate::coevolve::run) fn begin_estimation(
        &mut self,
        on: &Environment<'_>,
        mut tests: Vec<usize>,
    ) -> Result<Phase, Cancelled> {
        let Some(phase) = self.plan.posterior.clone() else { return Ok(Phase::End) };
        let is_fresh = |&k: &usize| self.state.ledger.entries()[k].trial.iteration == self.state.iteration;
        let fresh: Vec<usize> = tests.iter().copied().filter(is_fresh).collect();
        let members = phase.members(self.state.simulation.len());
        let draws = self.belief().draws(members, &mut self.stream(Stream::Ensembles, 0));
        let mut cost = self.state.cost;
        let (views, _) = self.problem(on, &fresh).run_ensemble(&draws, &mut cost)?;
        self.state.cost = cost;
        let PriorPredictive { chi, at_noise: as_predicted, .. } = PriorPredictive::of(&views);
        self.state.phi_predicted = Some(chi).filter(|phi| phi.is_finite());
        self.state.phi_start = self.state.phi_start.or(self.state.phi_predicted);
        self.resolve(as_predicted);
        tests.retain(|&k| k >= self.state.since);
        let identified = self.is_identified(&phase);
        if as_predicted && identified {
            self.state.phi = self.state.phi_predicted;
            self.state.confirmed = true;
            return Ok(Phase::End);
        }
        let explained = self.state.estimated.as_ref().is_some_and(|estimated| estimated.explains);
        let surprised = self.state.confirmed && explained && !as_predicted;
        Ok(Phase::Estimate(Estimation { tests, belief: self.belief(), turn: 1, start: 0, best: None, surprised }))
    }

    /// The estimation problem of some tests of the ledger.
    fn problem<'a>(&'a self, on: &'a Environment<'_>, tests: &[usize]) -> EstimationProblem<'a> {
        let tests: Vec<&Entry> = tests.iter().map(|&k| &self.state.ledger.entries()[k]).collect();
        EstimationProblem { simulator: on.simulator, distance: on.distance, tests, prior: self.prior() }
    }

    /// The present belief about S.
    pub(in crate::coevolve::run) fn belief(&self) -> Posterior {
        self.state.estimated.as_ref().map_or_else(|| self.prior(), |estimated| estimated.belief.clone())
    }

    /// The belief before any test.
    fn prior(&self) -> Posterior {
        Posterior::of_bounds(&self.state.prior)
    }

    /// One turn.
    pub(in crate::coevolve::run) fn estimate(
        &mut self,
        on: &Environment<'_>,
        estimation: Estimation,
    ) -> Result<StepOutcome, Cancelled> {
        let Some(phase) = self.plan.posterior.clone() else { return self.finish_estimation(on, None) };
        let number = estimation.start * phase.turns + estimation.turn;
        let members = phase.members(self.state.simulation.len());
        let draws = estimation.belief.wider(WIDENING).draws(members, &mut self.stream(Stream::Ensembles, number));
        let mut cost = self.state.cost;
        let problem = self.problem(on, &estimation.tests);
        let (views, scores) = problem.run_ensemble(&draws, &mut cost)?;
        let turned = problem.turn(&estimation.belief, &views);
        self.state.cost = cost;
        let points = draws.iter().map(|unit| on.simulator.simulations().from_unit(unit)).collect();
        self.record_generation(number, points, &scores);
        let Some(TurnResult { estimated, settled, .. }) = turned else {
            return self.finish_estimation(on, estimation.best);
        };
        if !settled && estimation.turn < phase.turns {
            let (belief, turn) = (estimated.belief, estimation.turn + 1);
            self.state.phase = Phase::Estimate(Estimation { belief, turn, ..estimation });
            return Ok(StepOutcome::Generation);
        }
        self.finish_start(on, estimation, estimated, &phase)
    }

    /// Ends a start: continues with the best of all starts, or with another start.
    fn finish_start(
        &mut self,
        on: &Environment<'_>,
        estimation: Estimation,
        estimated: Estimated,
        phase: &PosteriorPhase,
    ) -> Result<StepOutcome, Cancelled> {
        let better = |other: &Estimated| (estimated.explains, -estimated.chi) >= (other.explains, -other.chi);
        let best =
            if estimation.best.as_ref().is_none_or(better) { estimated } else { estimation.best.unwrap_or(estimated) };
        let identified = self.is_identified(phase);
        // A test never widens the belief: one that is mostly unpredictable is explained, and carries no information.
        let teaches_nothing = identified && best.belief.volume() > self.belief().volume();
        let given_up = identified || estimation.start >= phase.restarts;
        if estimation.surprised && (if best.explains { teaches_nothing } else { given_up }) {
            if !best.explains {
                self.suspect();
            }
            self.state.phi = Some(best.chi);
            return self.finish_estimation(on, None);
        }
        if best.explains || estimation.start >= phase.restarts {
            let explains = best.explains;
            let step = self.finish_estimation(on, Some(best));
            self.state.confirmed |= estimation.tests.len() > 1 && explains;
            return step;
        }
        let start = estimation.start + 1;
        // Another start is another ensemble about another point.
        let prior = self.prior();
        let about = prior.draws(1, &mut self.stream(Stream::Ensembles, start * phase.turns)).remove(0);
        let belief = Posterior::new(DVector::from_vec(about), prior.covariance().clone());
        self.state.phase = Phase::Estimate(Estimation { belief, turn: 1, start, best: Some(best), ..estimation });
        Ok(StepOutcome::Generation)
    }

    /// Ends step 3 with this estimate.
    pub(in crate::coevolve::run) fn finish_estimation(
        &mut self,
        on: &Environment<'_>,
        best: Option<Estimated>,
    ) -> Result<StepOutcome, Cancelled> {
        if let Some(best) = best {
            let space = on.simulator.simulations();
            self.state.simulation = space.from_unit(best.belief.mean().as_slice());
            self.state.phi = Some(best.chi);
            self.state.estimated = Some(best);
        }
        self.state.phase = Phase::End;
        Ok(StepOutcome::Generation)
    }
}
