//! Step 3 as estimation: what the real tests leave open of S, instead of one best point.
//!
//! Each turn draws an ensemble from the belief, runs it on every test that counts and linearises what they tell
//! ([`linearise`](crate::coevolve::linearise)). The belief moves and narrows by a bounded factor per turn, until a turn leaves it
//! where it was. Where it then does not explain the tests, it is sought again from other starts.

use super::{Coevolution, On, Phase, Step, Stream};
use crate::coevolve::evaluate;
use crate::coevolve::linearise::{Ensemble, Shown, Told, surprise};
use crate::coevolve::plan::PosteriorPhase;
use crate::coevolve::posterior::{Posterior, root};
use crate::search::{Residuals, Unit};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The farthest the mean goes in a turn, in the belief's standard deviations (root mean square over the dimensions).
const STRIDE: f64 = 2.0;
/// By how much a belief's standard deviation shrinks in a turn at most, and grows.
const SHRINK: f64 = 2.5;
const GROW: f64 = 1.4;
/// A belief that moves by less, and changes its width by less, is settled.
const SETTLED: (f64, f64) = (0.5, 1.3);
/// chi-squared per sample may exceed 1 by so many of its standard errors, and by this share for what sensors' statements
/// round.
const STANDARD_ERRORS: f64 = 5.0;
const ROUNDED: f64 = 0.01;

/// Where the estimation stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Estimation {
    /// The tests that count, by their place in the ledger.
    tests: Vec<usize>,
    belief: Posterior,
    turn: usize,
    /// How many starts were given up before this one.
    start: usize,
    /// The best belief of those, with its chi.
    best: Option<Estimated>,
}

/// A belief and how well it explains the tests.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Estimated {
    pub belief: Posterior,
    /// Root of chi-squared per sample over the tests, beside what is unpredictable.
    pub chi: f64,
    /// What of each test the belief leaves unpredictable, in multiples of the noise.
    pub unpredictable: Vec<f64>,
    /// Whether `chi` is at the noise.
    pub explains: bool,
}

/// What a turn came to.
struct Turned {
    next: Posterior,
    chi: f64,
    /// What the noise alone would leave, at most.
    goal: f64,
    settled: bool,
    unpredictable: Vec<f64>,
}

/// An ensemble's view of a test.
struct Seen {
    ensemble: Ensemble,
    shown: Shown,
}

impl Coevolution {
    /// Step 3 begins: all tests that count, from what is believed so far. It rests where everything is told already and the
    /// fresh tests came as foretold.
    pub(super) fn begin_estimation(&mut self, on: &On<'_>, tests: Vec<usize>) -> Phase {
        let Some(phase) = self.plan.posterior.clone() else { return Phase::End };
        let fresh: Vec<usize> = tests.iter().copied().filter(|&k| self.is_fresh(k)).collect();
        let members = phase.members(self.state.simulation.len());
        let draws = self.belief().draws(members, &mut self.stream(Stream::Ensembles, 0));
        let (seen, _) = self.seen(on, &draws, &fresh);
        let (chi2, samples) = surprises(&seen);
        self.state.phi_predicted = Some(chi2.sqrt()).filter(|phi| phi.is_finite());
        self.state.phi_start = self.state.phi_start.or(self.state.phi_predicted);
        if self.all_is_told(&phase) && chi2.sqrt() <= noise_alone(samples) {
            self.state.phi = self.state.phi_predicted;
            return Phase::End;
        }
        Phase::Estimate(Estimation { tests, belief: self.belief(), turn: 1, start: 0, best: None })
    }

    /// Whether a test of the ledger is one of this iteration's.
    fn is_fresh(&self, test: usize) -> bool {
        self.state.ledger.entries()[test].trial.iteration == self.state.iteration
    }

    /// What is believed of S.
    pub(super) fn belief(&self) -> Posterior {
        self.state.estimated.as_ref().map_or_else(|| self.prior(), |estimated| estimated.belief.clone())
    }

    /// What is believed before any test.
    pub(super) fn prior(&self) -> Posterior {
        Posterior::of_bounds(&self.state.prior)
    }

    /// One turn.
    pub(super) fn estimate(&mut self, on: &On<'_>, estimation: Estimation) -> Step {
        let Some(phase) = self.plan.posterior.clone() else { return self.settled(on, None) };
        let number = estimation.start * phase.turns + estimation.turn;
        let members = phase.members(self.state.simulation.len());
        let draws = estimation.belief.draws(members, &mut self.stream(Stream::Ensembles, number));
        let (seen, scores) = self.seen(on, &draws, &estimation.tests);
        let points = draws.iter().map(|unit| on.simulator.simulations().from_unit(unit)).collect();
        self.write_down(number, points, &scores);
        let Some(turned) = self.turn(&estimation.belief, &seen) else { return self.settled(on, estimation.best) };
        if !turned.settled && estimation.turn < phase.turns {
            let (belief, turn) = (turned.next, estimation.turn + 1);
            self.state.phase = Phase::Estimate(Estimation { belief, turn, ..estimation });
            return Step::Generation;
        }
        let explains = turned.chi <= turned.goal;
        let Turned { next: belief, chi, unpredictable, .. } = turned;
        let estimated = Estimated { belief, chi, unpredictable, explains };
        self.ended(on, estimation, estimated, &phase)
    }

    /// A start has come to its end: on with the best of all, or with another start.
    fn ended(&mut self, on: &On<'_>, of: Estimation, estimated: Estimated, phase: &PosteriorPhase) -> Step {
        let better = |other: &Estimated| (estimated.explains, -estimated.chi) >= (other.explains, -other.chi);
        let best = if of.best.as_ref().is_none_or(better) { estimated } else { of.best.unwrap_or(estimated) };
        if best.explains || of.start >= phase.restarts {
            return self.settled(on, Some(best));
        }
        let start = of.start + 1;
        // Another start is another ensemble about another point.
        let prior = self.prior();
        let mut rng = self.stream(Stream::Ensembles, start * phase.turns);
        let about = prior.draws(1, &mut rng).remove(0);
        let belief = Posterior::new(DVector::from_vec(about), prior.covariance().clone());
        self.state.phase = Phase::Estimate(Estimation { belief, turn: 1, start, best: Some(best), ..of });
        Step::Generation
    }

    /// Step 3 ends with this belief.
    fn settled(&mut self, on: &On<'_>, best: Option<Estimated>) -> Step {
        if let Some(best) = best {
            let space = on.simulator.simulations();
            self.state.simulation = space.from_unit(best.belief.mean().as_slice());
            self.state.phi = Some(best.chi);
            self.state.estimated = Some(best);
        }
        self.state.phase = Phase::End;
        Step::Generation
    }

    /// Runs an ensemble on the tests: what each test shows, and each member's phi.
    fn seen(&mut self, on: &On<'_>, draws: &[Unit], tests: &[usize]) -> (Vec<Option<Seen>>, Vec<f64>) {
        let points: Vec<Vec<f64>> = draws.iter().map(|unit| on.simulator.simulations().from_unit(unit)).collect();
        let mut phis = vec![0.0; draws.len()];
        let mut seen = Vec::with_capacity(tests.len());
        for &test in tests {
            let Some(squares) = on.distance.as_squares() else { break };
            let entry = &self.state.ledger.entries()[test];
            let results =
                evaluate::residuals(on.simulator, (on.distance, squares), &points, &[entry], &mut self.state.cost);
            phis.iter_mut().zip(&results).for_each(|(sum, (phi, _))| *sum += phi / tests.len() as f64);
            seen.push(view(draws, results.into_iter().map(|(_, residuals)| residuals).collect()));
        }
        (seen, phis)
    }

    /// Where the tests move a belief; `None` where none of them could be simulated.
    fn turn(&self, belief: &Posterior, seen: &[Option<Seen>]) -> Option<Turned> {
        let prior = self.prior();
        let known = prior.covariance().clone().try_inverse()?;
        let there: Vec<&Seen> = seen.iter().flatten().collect();
        let told: Vec<Told> = there.par_iter().map(|seen| seen.ensemble.told(&seen.shown)).collect();
        let best = |tempered: f64| {
            let mut information = known.clone();
            let mut pull = &known * prior.mean();
            for (told, seen) in told.iter().zip(&there) {
                information += &told.information / tempered;
                pull += (&told.information * &seen.ensemble.mean - &told.gradient) / tempered;
            }
            let covariance = information.cholesky()?.inverse();
            Some((&covariance * pull, covariance))
        };
        let chi2 = |at: &DVector<f64>| {
            let samples: f64 = there.iter().map(|seen| seen.shown.samples()).sum();
            let squares = |seen: &&Seen| seen.ensemble.foretold(&seen.shown, at) * seen.shown.samples();
            (there.iter().map(squares).sum::<f64>() / samples, samples)
        };
        let (untempered, _) = best(1.0)?;
        let (chi2_at_best, samples) = chi2(&untempered);
        if !chi2_at_best.is_finite() {
            return None;
        }
        // What is not explained widens what is believed.
        let (mean, covariance) = best(chi2_at_best.max(1.0))?;
        let goal = noise_alone(samples);
        let unpredictable =
            seen.iter().map(|seen| seen.as_ref().map_or(f64::NAN, |seen| seen.shown.unpredictable())).collect();
        let (next, settled) = moved(belief, &mean, &covariance);
        Some(Turned { next, chi: chi2_at_best.sqrt(), goal, settled, unpredictable })
    }
}

/// The chi that noise alone leaves of so many readings, at most.
fn noise_alone(samples: f64) -> f64 {
    (1.0 + ROUNDED + STANDARD_ERRORS * (2.0 / samples).sqrt()).sqrt()
}

/// Chi-squared per sample of some tests before anything is learnt from them, and their samples.
fn surprises(seen: &[Option<Seen>]) -> (f64, f64) {
    let samples: f64 = seen.iter().flatten().map(|seen| seen.shown.samples()).sum();
    let squares: f64 = seen.iter().flatten().map(|seen| surprise(&seen.shown) * seen.shown.samples()).sum();
    (squares / samples, samples)
}

/// Those members of an ensemble that could be simulated on a test, and what it shows.
fn view(draws: &[Unit], residuals: Vec<Option<Residuals>>) -> Option<Seen> {
    let (members, errors): (Vec<Unit>, Vec<Residuals>) =
        draws.iter().cloned().zip(residuals).filter_map(|(unit, errors)| Some((unit, errors?))).unzip();
    let ensemble = Ensemble::of(&members)?;
    Some(Seen { shown: Shown::of(&ensemble, &errors)?, ensemble })
}

/// A belief on its way to another one, as far as one turn goes; and whether it is there.
fn moved(from: &Posterior, mean: &DVector<f64>, covariance: &DMatrix<f64>) -> (Posterior, bool) {
    let dims = mean.len();
    let frame = root(from.covariance());
    let Some(back) = frame.clone().try_inverse() else { return (from.clone(), true) };
    let step = &back * (mean - from.mean());
    let length = step.norm() / (dims as f64).sqrt();
    let shape = (&back * covariance * back.transpose()).symmetric_eigen();
    let (least, most) = (shape.eigenvalues.min().max(0.0).sqrt(), shape.eigenvalues.max().max(0.0).sqrt());
    let widths = shape.eigenvalues.map(|square| square.max(0.0).sqrt().clamp(1.0 / SHRINK, GROW).powi(2));
    let wide = &shape.eigenvectors * DMatrix::from_diagonal(&widths) * shape.eigenvectors.transpose();
    let share = (STRIDE / length.max(f64::MIN_POSITIVE)).min(1.0);
    let reached = (from.mean() + &frame * step * share).map(|x| x.clamp(0.0, 1.0));
    let covariance = &frame * wide * frame.transpose();
    let settled = length < SETTLED.0 && least > 1.0 / SHRINK && most < SETTLED.1;
    (Posterior::new(reached, (&covariance + covariance.transpose()) / 2.0), settled)
}
