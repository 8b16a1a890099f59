//! Abduction: which extension of S explains what the robot did. The paper's principle P3 with the means of step 3: the
//! same tests, the same noise, the same posterior, in spaces that have a few dimensions more.
//!
//! Screening runs each extension once per probe where the present estimate stands, and computes how far a multiple of
//! its change and a step in S together would lower chi-squared. Fitting then estimates the most promising ones with all
//! of S free.

use super::posterior::{Estimated, Posterior};
use super::predictive::PriorPredictive;
use super::probe::ProbedTest;
use super::problem::{EstimateError, EstimationContext, EstimationProblem};
use crate::coevolve::evaluate::{self, Cost, ResidualDistance};
use crate::coevolve::ledger::Entry;
use crate::coevolve::plan::PosteriorPhase;
use crate::distance::Distance;
use crate::optimize::Residuals;
use crate::random;
use crate::space::Dim;
use crate::world::{Cancelled, Simulator};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Least and greatest multiple of a probe for which its linearisation is trusted.
const MULTIPLES: (f64, f64) = (0.15, 4.0);
/// Width of the belief about S around its nominal values, as a share of its bounds': a missing effect may have biased
/// S.
const BIAS_SHARE: f64 = 0.35;
/// Initial standard deviation of an extension's own parameters: a share of their start's distance from the prior mean,
/// and the least value, on the unit cube.
const BEGIN: (f64, f64) = (0.5, 0.01);

/// A search for extensions of S that explain tests which S does not.
pub struct Abduction<'a> {
    /// A likelihood: see [`Distance::whitens`].
    pub distance: &'a dyn Distance,
    /// Training tests: growing parts from their beginnings on, the last one whole. A fall is unpredictable before the
    /// parameters are known; what causes it shows before.
    pub learn: Vec<Vec<&'a Entry>>,
    /// Held-out tests.
    pub held_out: Vec<&'a Entry>,
    /// Settings of the estimates.
    pub phase: PosteriorPhase,
    /// Seed of all ensembles.
    pub seed: u64,
}

/// A larger S, whose first dimensions are those of the present one.
pub struct Extension<'a> {
    /// Its simulations.
    pub simulator: &'a dyn Simulator,
    /// Values of its further dimensions, in their units, at which it is tried.
    pub probes: Vec<Vec<f64>>,
}

impl Extension<'_> {
    /// A multiple of a probe, on the unit cube: parameters with a nominal value (off) are scaled about it; others keep
    /// the probe's value.
    fn at(&self, known: usize, probe: &[f64], multiple: f64) -> Vec<f64> {
        let place = |(dim, value): (&Dim, &f64)| match dim.nominal {
            Some(off) => dim.to_unit(off + multiple * (value - off)),
            None => dim.to_unit(*value),
        };
        self.simulator.simulations().dims()[known..].iter().zip(probe).map(place).collect()
    }
}

/// An extension that would lower chi-squared.
#[derive(Clone, Debug, PartialEq)]
pub struct Suspect {
    /// Its place among the extensions.
    pub extension: usize,
    /// Where on the unit cube its further dimensions are expected.
    pub start: Vec<f64>,
    /// The share of chi-squared that would remain.
    pub left: f64,
}

/// A fitted extension, and how well it explains the tests.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedExtension {
    /// Estimate on the beginnings of the training tests.
    pub early: Estimated,
    /// Estimate on all of the training tests.
    pub estimated: Estimated,
    /// chi on the held-out tests, with the posterior's spread counted as noise; `None` without any.
    pub held_out: Option<f64>,
    /// Whether that is at the noise as well.
    pub confirmed: bool,
}

impl Abduction<'_> {
    /// A belief about the prior mean, narrower than the bounds: a missing effect has not biased it.
    pub fn unbiased(&self, prior: &Posterior) -> Posterior {
        Posterior::new(prior.mean().clone(), prior.covariance() * BIAS_SHARE.powi(2))
    }

    fn problem<'a>(
        &'a self,
        simulator: &'a dyn Simulator,
        prior: &Posterior,
        tests: &[&'a Entry],
    ) -> EstimationProblem<'a> {
        EstimationProblem { simulator, distance: self.distance, tests: tests.to_vec(), prior: prior.clone() }
    }

    /// Estimates S, from a belief to begin with; `prior` is what is known of it without any test.
    ///
    /// # Errors
    /// Too few simulations that succeed, or cancelled work.
    pub fn fit(
        &self,
        simulator: &dyn Simulator,
        prior: &Posterior,
        from: &Posterior,
        cost: &mut Cost,
    ) -> Result<FittedExtension, EstimateError> {
        let (early, estimated) = self.settle(simulator, prior, from, cost)?;
        let members = self.phase.members(from.mean().len());
        let draws = estimated.belief.draws(members, &mut random::stream(self.seed, &[0]));
        let (views, _) = self.problem(simulator, prior, &self.held_out).run_ensemble(&draws, cost)?;
        let held_out = PriorPredictive::of(&views);
        let judged = !self.held_out.is_empty();
        Ok(FittedExtension {
            early,
            estimated,
            held_out: judged.then_some(held_out.chi),
            confirmed: !judged || held_out.as_predicted,
        })
    }

    /// Estimates from the tests' beginnings to the whole tests, each from the one before: returns the first and the
    /// last. Where a beginning is not explained, the whole tests are estimated at once, and are not explained either.
    fn settle(
        &self,
        simulator: &dyn Simulator,
        prior: &Posterior,
        from: &Posterior,
        cost: &mut Cost,
    ) -> Result<(Estimated, Estimated), EstimateError> {
        let context = EstimationContext { phase: &self.phase, seed: self.seed };
        let (first, longer) = self.learn.split_first().ok_or(EstimateError::TooFew)?;
        let early = self.problem(simulator, prior, first).settle(from, &context, cost)?;
        let mut estimated = early.clone();
        for tests in longer {
            if !estimated.explains {
                let whole =
                    self.problem(simulator, prior, longer.last().unwrap_or(first)).settle(from, &context, cost)?;
                return Ok((early, Estimated { explains: false, ..whole }));
            }
            estimated = self.problem(simulator, prior, tests).narrow(&estimated.belief, &context, cost)?;
        }
        Ok((early, estimated))
    }

    /// A few turns of an estimate on the beginnings of the training tests.
    ///
    /// # Errors
    /// As for [`fit`](Self::fit).
    pub fn glance(
        &self,
        simulator: &dyn Simulator,
        prior: &Posterior,
        from: &Posterior,
        turns: usize,
        cost: &mut Cost,
    ) -> Result<Estimated, EstimateError> {
        let phase = PosteriorPhase { turns, ..self.phase.clone() };
        let context = EstimationContext { phase: &phase, seed: self.seed };
        let first = self.learn.first().ok_or(EstimateError::TooFew)?;
        self.problem(simulator, prior, first).settle(from, &context, cost)
    }

    /// The extensions that would lower chi-squared of the tests' beginnings, the most promising first, for an S near
    /// `belief`.
    ///
    /// # Errors
    /// Cancelled work.
    pub fn screen(
        &self,
        simulator: &dyn Simulator,
        prior: &Posterior,
        belief: &Posterior,
        extensions: &[Extension<'_>],
        cost: &mut Cost,
    ) -> Result<Vec<Suspect>, Cancelled> {
        let here = simulator.simulations().from_unit(belief.mean().as_slice());
        let mut sums: Vec<Vec<ProbeEquations>> =
            extensions.iter().map(|e| vec![ProbeEquations::default(); e.probes.len()]).collect();
        let mut information = prior.covariance().clone().try_inverse().unwrap_or_else(|| DMatrix::zeros(0, 0));
        let mut gradient = &information * (belief.mean() - prior.mean());
        let mut chi2 = 0.0;
        for entry in self.learn.first().into_iter().flatten() {
            let Some(probed) = self.probed(simulator, belief, entry, cost)? else { continue };
            chi2 += probed.chi2();
            information += probed.information();
            gradient += probed.gradient();
            let along = |(extension, sums): (&Extension, &mut Vec<ProbeEquations>)| {
                let mut cost = Cost::default();
                let residuals = self.residuals(extension, &here, entry, &mut cost)?;
                sums.iter_mut().zip(residuals).for_each(|(sum, r)| sum.add(r.and_then(|r| probed.along(&r))));
                Ok(cost)
            };
            let costs: Vec<Cost> = extensions.par_iter().zip(&mut sums).map(along).collect::<Result<_, Cancelled>>()?;
            costs.into_iter().for_each(|spent| cost.add(spent));
        }
        let Some(factor) = information.cholesky() else { return Ok(Vec::new()) };
        let promise = |(k, sums): (usize, &Vec<ProbeEquations>)| {
            let best =
                |(probe, sum): (&Vec<f64>, &ProbeEquations)| Some((probe.clone(), sum.best(&factor, &gradient)?));
            let bests = extensions[k].probes.iter().zip(sums).filter_map(best);
            let (probe, (multiple, fall)) = bests.max_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
            Some(Suspect {
                extension: k,
                start: extensions[k].at(here.len(), &probe, multiple),
                left: 1.0 - fall / chi2,
            })
        };
        let mut suspects: Vec<Suspect> = sums.iter().enumerate().filter_map(promise).collect();
        suspects.sort_by(|a, b| a.left.total_cmp(&b.left));
        Ok(suspects)
    }

    fn probed(
        &self,
        simulator: &dyn Simulator,
        belief: &Posterior,
        entry: &Entry,
        cost: &mut Cost,
    ) -> Result<Option<ProbedTest>, Cancelled> {
        let members = self.phase.members(belief.mean().len());
        let draws = belief.draws(members, &mut random::stream(self.seed, &[0]));
        let points: Vec<Vec<f64>> = draws.iter().map(|unit| simulator.simulations().from_unit(unit)).collect();
        let Some(distance) = ResidualDistance::of(self.distance) else { return Ok(None) };
        let results = evaluate::residuals(simulator, distance, &points, &[entry], cost)?;
        let errors: Option<Vec<Residuals>> = results.into_iter().map(|(_, residuals)| residuals).collect();
        Ok(errors.and_then(|errors| ProbedTest::of(&draws, &errors, belief.mean())))
    }

    fn residuals(
        &self,
        of: &Extension,
        here: &[f64],
        entry: &Entry,
        cost: &mut Cost,
    ) -> Result<Vec<Option<Residuals>>, Cancelled> {
        let Some(distance) = ResidualDistance::of(self.distance) else { return Ok(vec![None; of.probes.len()]) };
        let points: Vec<Vec<f64>> = of.probes.iter().map(|probe| [here, probe].concat()).collect();
        let results = evaluate::residuals(of.simulator, distance, &points, &[entry], cost)?;
        Ok(results.into_iter().map(|(_, residuals)| residuals).collect())
    }

    /// The initial belief about a larger S: the belief of the screening, and the suspect's own parameters about their
    /// expected values.
    pub fn beginning(&self, belief: &Posterior, suspect: &Suspect, prior: &Posterior) -> Posterior {
        let mean: Vec<f64> = belief.mean().iter().copied().chain(suspect.start.iter().copied()).collect();
        let mut covariance = prior.covariance().clone();
        let known = belief.mean().len();
        for (k, start) in suspect.start.iter().enumerate() {
            let off = prior.mean()[known + k];
            covariance[(known + k, known + k)] = (BEGIN.0 * (start - off).abs()).max(BEGIN.1).powi(2);
        }
        // The missing effect may have biased S itself.
        covariance.view_mut((0, 0), (known, known)).scale_mut(BIAS_SHARE.powi(2));
        Posterior::new(DVector::from_vec(mean), covariance)
    }
}

/// Normal equations along one probe: products of its change of the errors with itself, the errors and the slopes of S.
#[derive(Clone, Default)]
struct ProbeEquations {
    failed: bool,
    own: f64,
    pull: f64,
    across: Option<DVector<f64>>,
}

impl ProbeEquations {
    fn add(&mut self, along: Option<(f64, f64, DVector<f64>)>) {
        let Some((own, pull, across)) = along else {
            self.failed = true;
            return;
        };
        self.own += own;
        self.pull += pull;
        self.across = Some(self.across.take().map_or(across.clone(), |sum| sum + across));
    }

    /// The multiple of the probe that lowers chi-squared most with S refitted, and by how much.
    fn best(&self, factor: &nalgebra::Cholesky<f64, nalgebra::Dyn>, gradient: &DVector<f64>) -> Option<(f64, f64)> {
        let across = self.across.as_ref().filter(|_| !self.failed)?;
        let solved = factor.solve(across);
        let curvature = self.own - across.dot(&solved);
        let slope = self.pull - gradient.dot(&solved);
        if curvature <= 0.0 {
            return None;
        }
        let multiple = (-slope / curvature).clamp(MULTIPLES.0, MULTIPLES.1);
        let fall = -(2.0 * slope * multiple + curvature * multiple * multiple);
        (fall > 0.0).then_some((multiple, fall))
    }
}
