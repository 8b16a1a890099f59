//! What real tests leave open of a space of simulations.
//!
//! A turn draws an ensemble from a belief, runs it on every test and linearises what they tell ([`linearise`](linearise)).
//! The belief moves and narrows by a bounded factor per turn, until a turn leaves it where it was.

pub(crate) mod abduction;
pub(crate) mod linearise;
pub(crate) mod posterior;
mod probe;
pub(crate) mod promise;

use super::evaluate::{self, Cost};
use super::ledger::Entry;
use super::plan::PosteriorPhase;
use crate::distance::Distance;
use crate::optimize::Residuals;
use crate::random;
use crate::search::UnitPoint;
use crate::space::Space;
use crate::world::Simulator;
use linearise::{Ensemble, EnsembleErrors, Prediction, TestInformation, surprise};
use nalgebra::{DMatrix, DVector};
use posterior::{Posterior, root};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The farthest the mean goes in a turn, in the belief's standard deviations (root mean square over the dimensions).
const STRIDE: f64 = 2.0;
/// By how much a belief's standard deviation shrinks in a turn at most, and grows.
const SHRINK: f64 = 2.5;
const GROW: f64 = 1.4;
/// A belief that moves by less, and changes its width by less, is settled.
const SETTLED: (f64, f64) = (0.5, 1.6);
/// Ensembles are so many times as wide as the belief: what jumps beside it (a foot that lands a time step earlier) would not be
/// seen from within, and the belief would be too sure.
pub(super) const WIDER: f64 = 1.5;
/// After so many turns that bring an unexplained test no nearer to the noise, no further one will.
const STALLED: usize = 3;
/// chi-squared per sample may exceed 1 by so many of its standard errors, and by this share for what sensors' statements
/// round.
const STANDARD_ERRORS: f64 = 5.0;
const ROUNDED: f64 = 0.01;

/// Many tests that are explained hide one that is not: none of them may have a chi above this. Less than that is left of a
/// chaotic motion now and then, whose unpredictable part is not as normal as it is taken for.
const WORST: f64 = 1.1;

/// What is estimated from what.
pub(super) struct EstimationProblem<'a> {
    pub simulator: &'a dyn Simulator,
    /// A likelihood: see [`Distance::whitens`].
    pub distance: &'a dyn Distance,
    pub tests: Vec<&'a Entry>,
    /// What is believed before any test.
    pub prior: Posterior,
}

/// How it is estimated.
pub(super) struct EstimationContext<'a> {
    pub phase: &'a PosteriorPhase,
    /// Of all ensembles.
    pub seed: u64,
}

/// A belief and how well it explains the tests.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimated {
    /// What is believed.
    pub belief: Posterior,
    /// Root of chi-squared per sample over the tests, beside what is unpredictable.
    pub chi: f64,
    /// What of each test the belief leaves unpredictable, in multiples of the noise.
    pub unpredictable: Vec<f64>,
    /// How many readings were compared; one that is unpredictable counts for less.
    pub samples: f64,
    /// Minus twice the logarithm of the likelihood, less a constant.
    pub deviance: f64,
    /// Whether `chi` is at the noise, and no test far from it.
    pub explains: bool,
}

/// An estimate in a space of its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Explanation {
    /// What the belief's dimensions are.
    pub space: Space,
    /// How it explains the tests.
    pub estimated: Estimated,
}

/// What a turn came to.
pub(super) struct TurnResult {
    pub estimated: Estimated,
    pub settled: bool,
    /// Whether the tests are like what simulations foresee of each other: less than [`Estimated::explains`] asks where they are
    /// chaotic.
    pub foreseen: bool,
}

/// An ensemble's view of a test.
pub(super) struct TestView {
    pub ensemble: Ensemble,
    pub shown: EnsembleErrors,
}

impl EstimationProblem<'_> {
    /// Turn after turn, from a belief to where it rests, or to where the turns end or no longer help. `None` where nothing could
    /// be simulated.
    pub(super) fn settle(&self, from: &Posterior, by: &EstimationContext<'_>, cost: &mut Cost) -> Option<Estimated> {
        let first = self.next(from, 1, by, cost)?;
        self.go_on(first, by, cost).map(|turned| turned.estimated)
    }

    /// [`settle`](Self::settle), from a belief that explains parts of these tests. Where all of them are as it foresees, nothing
    /// is less known for them: a chaotic rest, which would only widen what is believed, is left alone.
    pub(super) fn narrow(&self, from: &Posterior, by: &EstimationContext<'_>, cost: &mut Cost) -> Option<Estimated> {
        let first = self.next(from, 1, by, cost)?;
        if !first.foreseen {
            return self.go_on(first, by, cost).map(|turned| turned.estimated);
        }
        let kept = Estimated { belief: from.clone(), explains: true, ..first.estimated.clone() };
        let narrower = |other: &TurnResult| other.foreseen && other.estimated.belief.volume() <= from.volume();
        if !narrower(&first) {
            return Some(kept);
        }
        let last = self.go_on(first, by, cost)?;
        Some(if narrower(&last) { Estimated { explains: true, ..last.estimated } } else { kept })
    }

    /// Further turns after a first one.
    fn go_on(&self, first: TurnResult, by: &EstimationContext<'_>, cost: &mut Cost) -> Option<TurnResult> {
        let (mut last, mut chis) = (first, Vec::new());
        for turn in 2..=by.phase.turns as u64 {
            chis.push(last.estimated.chi);
            let (early, late) = chis.split_at(chis.len().saturating_sub(STALLED));
            let least = |chis: &[f64]| chis.iter().copied().fold(f64::INFINITY, f64::min);
            let stalls = !last.estimated.explains && least(late) >= least(early);
            if last.settled || stalls {
                break;
            }
            last = self.next(&last.estimated.belief, turn, by, cost)?;
        }
        Some(last)
    }

    /// One turn, with an ensemble of its own.
    fn next(&self, belief: &Posterior, turn: u64, by: &EstimationContext<'_>, cost: &mut Cost) -> Option<TurnResult> {
        let members = by.phase.members(belief.mean().len());
        let draws = belief.wider(WIDER).draws(members, &mut random::stream(by.seed, &[turn]));
        self.turn(belief, &self.seen(&draws, cost).0)
    }

    /// Runs an ensemble on the tests: what each test shows, and each member's phi.
    pub(super) fn seen(&self, draws: &[UnitPoint], cost: &mut Cost) -> (Vec<Option<TestView>>, Vec<f64>) {
        let points: Vec<Vec<f64>> = draws.iter().map(|unit| self.simulator.simulations().from_unit(unit)).collect();
        let mut phis = vec![0.0; draws.len()];
        let Some(squares) = self.distance.as_squares() else { return (Vec::new(), phis) };
        let look = |entry: &&Entry| {
            let results = evaluate::residuals(self.simulator, (self.distance, squares), &points, &[*entry], cost);
            phis.iter_mut().zip(&results).for_each(|(sum, (phi, _))| *sum += phi / self.tests.len() as f64);
            view(draws, results.into_iter().map(|(_, residuals)| residuals).collect())
        };
        let seen = self.tests.iter().map(look).collect();
        (seen, phis)
    }

    /// Where the tests move a belief; `None` where none of them could be simulated.
    pub(super) fn turn(&self, belief: &Posterior, seen: &[Option<TestView>]) -> Option<TurnResult> {
        let known = self.prior.covariance().clone().try_inverse()?;
        let there: Vec<&TestView> = seen.iter().flatten().collect();
        let told: Vec<TestInformation> = there.par_iter().map(|seen| seen.ensemble.told(&seen.shown)).collect();
        let best = |tempered: f64| {
            let mut information = known.clone();
            let mut pull = &known * self.prior.mean();
            for (told, seen) in told.iter().zip(&there) {
                information += &told.information / tempered;
                pull += (&told.information * &seen.ensemble.mean - &told.gradient) / tempered;
            }
            let covariance = information.cholesky()?.inverse();
            Some((&covariance * pull, covariance))
        };
        let samples: f64 = there.iter().map(|seen| seen.shown.samples()).sum();
        let at = best(1.0)?.0;
        let of_tests: Vec<Prediction> = there.iter().map(|seen| seen.ensemble.foretold(&seen.shown, &at)).collect();
        let chi2 = of_tests.iter().map(|test| test.chi2).sum::<f64>() / samples;
        if !chi2.is_finite() {
            return None;
        }
        // What is not explained widens what is believed; so does what simulations could not foretell of each other, as far as it
        // is more than they count it for.
        let (mean, covariance) = best(chi2.max(1.0))?;
        let astray: DMatrix<f64> = told.iter().map(|told| &told.astray).sum();
        let covariance = &covariance + &covariance * astray * &covariance / chi2.max(1.0);
        let of_test = |seen: &Option<TestView>| seen.as_ref().map_or(f64::NAN, |seen| seen.shown.unpredictable());
        let unpredictable = seen.iter().map(of_test).collect();
        let (belief, settled) = moved(belief, &mean, &covariance);
        let (chi, deviance) = (chi2.sqrt(), of_tests.iter().map(|test| test.deviance).sum());
        let explains = explained(&of_tests);
        let foreseen = foreseen(&of_tests);
        Some(TurnResult {
            estimated: Estimated { belief, chi, unpredictable, samples, deviance, explains },
            settled,
            foreseen,
        })
    }
}

/// chi-squared of some tests, over how many readings, and by how much it may exceed what noise leaves.
fn sums(tests: &[Prediction]) -> (f64, f64, f64) {
    let add =
        |(chi2, samples, excess), test: &Prediction| (chi2 + test.chi2, samples + test.samples, excess + test.excess);
    tests.iter().fold((0.0, 0.0, 0.0), add)
}

/// The chi-squared that noise alone leaves of so many readings, at most.
fn noise_alone(samples: f64) -> f64 {
    samples * (1.0 + ROUNDED + STANDARD_ERRORS * (2.0 / samples).sqrt())
}

/// Whether noise alone leaves as much, beside what is unpredictable.
fn explained(tests: &[Prediction]) -> bool {
    let (chi2, samples, _) = sums(tests);
    chi2 <= noise_alone(samples) && tests.iter().all(|test| test.chi2 <= WORST.powi(2) * test.samples)
}

/// Whether each test, and all of them, are like what simulations foresee of each other.
fn foreseen(tests: &[Prediction]) -> bool {
    let as_foreseen = |(chi2, samples, excess): (f64, f64, f64)| chi2 <= noise_alone(samples) + excess;
    !tests.is_empty() && (0..tests.len()).all(|k| as_foreseen(sums(&tests[k..=k]))) && as_foreseen(sums(tests))
}

/// Some tests before anything is learnt from them, all that an ensemble leaves open taken for noise.
pub(super) struct PriorPredictive {
    /// Root of chi-squared per sample.
    pub chi: f64,
    /// Whether that is what noise leaves.
    pub at_noise: bool,
    /// Whether it is what simulations foresee of each other.
    pub foreseen: bool,
}

impl PriorPredictive {
    /// Of an ensemble's view of the tests.
    pub(super) fn of(seen: &[Option<TestView>]) -> Self {
        let tests: Vec<Prediction> = seen.iter().flatten().map(|seen| surprise(&seen.shown)).collect();
        let (chi2, samples, _) = sums(&tests);
        PriorPredictive {
            chi: (chi2 / samples).sqrt(),
            at_noise: chi2 <= noise_alone(samples),
            foreseen: foreseen(&tests),
        }
    }
}

/// Those members of an ensemble that could be simulated on a test, and what it shows.
fn view(draws: &[UnitPoint], residuals: Vec<Option<Residuals>>) -> Option<TestView> {
    let (members, errors): (Vec<UnitPoint>, Vec<Residuals>) =
        draws.iter().cloned().zip(residuals).filter_map(|(unit, errors)| Some((unit, errors?))).unzip();
    let ensemble = Ensemble::of(&members)?;
    Some(TestView { shown: EnsembleErrors::of(&ensemble, &errors)?, ensemble })
}

/// A belief on its way to another one, as far as one turn goes; and whether it is there.
fn moved(from: &Posterior, mean: &DVector<f64>, covariance: &DMatrix<f64>) -> (Posterior, bool) {
    let frame = root(from.covariance());
    let Some(back) = frame.clone().try_inverse() else { return (from.clone(), true) };
    let step = &back * (mean - from.mean());
    let length = step.norm() / (mean.len() as f64).sqrt();
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

#[cfg(test)]
mod tests;
