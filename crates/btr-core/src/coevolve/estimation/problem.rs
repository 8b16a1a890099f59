//! Turns of an estimate: draw an ensemble, run it on every test, linearise, and move the belief.

use super::ensemble::Ensemble;
use super::errors::EnsembleErrors;
use super::linearise::{Prediction, TestInformation};
use super::posterior::{Estimated, Posterior, root};
use super::predictive::{TestView, as_predicted, explained};
use crate::coevolve::evaluate::{self, Cost, ResidualDistance};
use crate::coevolve::ledger::Entry;
use crate::coevolve::plan::PosteriorPhase;
use crate::distance::Distance;
use crate::optimize::Residuals;
use crate::random;
use crate::search::UnitPoint;
use crate::world::{Cancelled, Simulator};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// The farthest the mean goes in a turn, in the belief's standard deviations (root mean square over the dimensions).
const STRIDE: f64 = 2.0;
/// Largest factors by which a belief's standard deviation shrinks and grows in a turn.
const SHRINK: f64 = 2.5;
const GROW: f64 = 1.4;
/// A belief whose mean moves by less standard deviations, and whose width changes by less than this factor, is settled.
const SETTLED: (f64, f64) = (0.5, 1.6);
/// Width of ensembles in multiples of the belief's width. Jumps just beside the belief (a foot that lands a time step
/// earlier) would not show within it, and the belief would be too certain.
pub(in crate::coevolve) const WIDENING: f64 = 1.5;
/// An estimate stops after so many turns that bring unexplained tests no nearer to the noise.
const STALLED: usize = 3;

/// The model, the tests and the prior of an estimate.
pub(in crate::coevolve) struct EstimationProblem<'a> {
    pub simulator: &'a dyn Simulator,
    /// A likelihood: see [`Distance::whitens`].
    pub distance: &'a dyn Distance,
    pub tests: Vec<&'a Entry>,
    pub prior: Posterior,
}

/// Settings of an estimate.
pub(in crate::coevolve) struct EstimationContext<'a> {
    pub phase: &'a PosteriorPhase,
    /// Seed of all ensembles.
    pub seed: u64,
}

/// Why there is no estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EstimateError {
    /// Too few simulations of the ensemble succeeded.
    #[error("too few simulations succeeded for an estimate")]
    TooFew,
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl EstimateError {
    /// `None` where too few simulations succeeded.
    ///
    /// # Errors
    /// Cancelled work.
    pub fn unless_cancelled<T>(estimate: Result<T, Self>) -> Result<Option<T>, Cancelled> {
        match estimate {
            Ok(estimate) => Ok(Some(estimate)),
            Err(EstimateError::TooFew) => Ok(None),
            Err(EstimateError::Cancelled(cancelled)) => Err(cancelled),
        }
    }
}

/// Result of one turn.
pub(in crate::coevolve) struct TurnResult {
    pub estimated: Estimated,
    pub settled: bool,
    /// Whether the tests are as simulations predict of each other. Where they are chaotic, this asks for less than
    /// [`Estimated::explains`].
    pub as_predicted: bool,
}

impl EstimationProblem<'_> {
    /// Turns from a belief until it settles, the turns run out or they no longer help.
    pub(super) fn settle(
        &self,
        from: &Posterior,
        context: &EstimationContext<'_>,
        cost: &mut Cost,
    ) -> Result<Estimated, EstimateError> {
        let first = self.next(from, 1, context, cost)?;
        self.go_on(first, context, cost).map(|turn| turn.estimated)
    }

    /// Like [`settle`](Self::settle), from a belief that explains parts of these tests. Where all tests are as it
    /// predicts, the belief does not widen: chaotic remainders of tests, which would only widen it, are ignored.
    pub(super) fn narrow(
        &self,
        from: &Posterior,
        context: &EstimationContext<'_>,
        cost: &mut Cost,
    ) -> Result<Estimated, EstimateError> {
        let first = self.next(from, 1, context, cost)?;
        if !first.as_predicted {
            return self.go_on(first, context, cost).map(|turn| turn.estimated);
        }
        let kept = Estimated { belief: from.clone(), explains: true, ..first.estimated.clone() };
        let narrower = |turn: &TurnResult| turn.as_predicted && turn.estimated.belief.volume() <= from.volume();
        if !narrower(&first) {
            return Ok(kept);
        }
        let last = self.go_on(first, context, cost)?;
        Ok(if narrower(&last) { Estimated { explains: true, ..last.estimated } } else { kept })
    }

    /// Further turns after a first one.
    fn go_on(
        &self,
        first: TurnResult,
        context: &EstimationContext<'_>,
        cost: &mut Cost,
    ) -> Result<TurnResult, EstimateError> {
        let (mut last, mut chis) = (first, Vec::new());
        for turn in 2..=context.phase.turns as u64 {
            chis.push(last.estimated.chi);
            let (early, late) = chis.split_at(chis.len().saturating_sub(STALLED));
            let least = |chis: &[f64]| chis.iter().copied().fold(f64::INFINITY, f64::min);
            let stalls = !last.estimated.explains && least(late) >= least(early);
            if last.settled || stalls {
                break;
            }
            last = self.next(&last.estimated.belief, turn, context, cost)?;
        }
        Ok(last)
    }

    /// One turn, with an ensemble of its own.
    pub(super) fn next(
        &self,
        belief: &Posterior,
        turn: u64,
        context: &EstimationContext<'_>,
        cost: &mut Cost,
    ) -> Result<TurnResult, EstimateError> {
        let members = context.phase.members(belief.mean().len());
        let draws = belief.wider(WIDENING).draws(members, &mut random::stream(context.seed, &[turn]));
        self.turn(belief, &self.run_ensemble(&draws, cost)?.0).ok_or(EstimateError::TooFew)
    }

    /// Runs an ensemble on the tests: its view of each test (`None` where too few members could be simulated), and each
    /// member's phi.
    pub(in crate::coevolve) fn run_ensemble(
        &self,
        draws: &[UnitPoint],
        cost: &mut Cost,
    ) -> Result<(Vec<Option<TestView>>, Vec<f64>), Cancelled> {
        let points: Vec<Vec<f64>> = draws.iter().map(|unit| self.simulator.simulations().from_unit(unit)).collect();
        let mut phis = vec![0.0; draws.len()];
        let Some(distance) = ResidualDistance::of(self.distance) else { return Ok((Vec::new(), phis)) };
        let run = |entry: &&Entry| {
            let results = evaluate::residuals(self.simulator, distance, &points, &[*entry], cost)?;
            phis.iter_mut().zip(&results).for_each(|(sum, (phi, _))| *sum += phi / self.tests.len() as f64);
            Ok(view(draws, results.into_iter().map(|(_, residuals)| residuals).collect()))
        };
        let views = self.tests.iter().map(run).collect::<Result<_, Cancelled>>()?;
        Ok((views, phis))
    }

    /// Moves a belief by the information of the tests; `None` where none of them could be simulated.
    pub(in crate::coevolve) fn turn(&self, belief: &Posterior, views: &[Option<TestView>]) -> Option<TurnResult> {
        let prior = self.prior.covariance().clone().try_inverse()?;
        let present: Vec<&TestView> = views.iter().flatten().collect();
        let tests: Vec<TestInformation> =
            present.par_iter().map(|view| TestInformation::of(&view.ensemble, &view.errors)).collect();
        let solve = |temperature: f64| {
            let mut information = prior.clone();
            let mut pull = &prior * self.prior.mean();
            for (test, view) in tests.iter().zip(&present) {
                information += &test.information / temperature;
                pull += (&test.information * &view.ensemble.mean - &test.gradient) / temperature;
            }
            let covariance = information.cholesky()?.inverse();
            Some((&covariance * pull, covariance))
        };
        let samples: f64 = present.iter().map(|view| view.errors.samples()).sum();
        let best = solve(1.0)?.0;
        let predictions: Vec<Prediction> =
            present.iter().map(|view| Prediction::at(&view.ensemble, &view.errors, &best)).collect();
        let chi2 = predictions.iter().map(|test| test.chi2).sum::<f64>() / samples;
        if !chi2.is_finite() {
            return None;
        }
        // Unexplained errors widen the belief; so do errors of the regression beyond those that its information counts.
        let (mean, covariance) = solve(chi2.max(1.0))?;
        let excess: DMatrix<f64> = tests.iter().map(|test| &test.excess).sum();
        let covariance = &covariance + &covariance * excess * &covariance / chi2.max(1.0);
        let of_test = |view: &Option<TestView>| view.as_ref().map_or(f64::NAN, |view| view.errors.unpredictable());
        let unpredictable = views.iter().map(of_test).collect();
        let (belief, settled) = moved(belief, &mean, &covariance);
        let (chi, deviance) = (chi2.sqrt(), predictions.iter().map(|test| test.deviance).sum());
        let explains = explained(&predictions);
        Some(TurnResult {
            estimated: Estimated { belief, chi, unpredictable, samples, deviance, explains },
            settled,
            as_predicted: as_predicted(&predictions),
        })
    }
}

/// The members of an ensemble that could be simulated on a test, with their errors.
fn view(draws: &[UnitPoint], residuals: Vec<Option<Residuals>>) -> Option<TestView> {
    let (members, errors): (Vec<UnitPoint>, Vec<Residuals>) =
        draws.iter().cloned().zip(residuals).filter_map(|(unit, errors)| Some((unit, errors?))).unzip();
    let ensemble = Ensemble::of(&members)?;
    Some(TestView { errors: EnsembleErrors::of(&ensemble, &errors)?, ensemble })
}

/// A belief moved towards another one, as far as one turn goes; and whether it has settled there.
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
