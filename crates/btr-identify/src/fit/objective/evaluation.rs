//! Residuals of an objective: simulated, or added up from what is known, at many points and logs at once.

use super::superposition::Problem;
use super::{LogSet, Objective};
use crate::fit::residual_vector::ResidualVector;
use crate::fit::rollouts::{Answer, each};
use crate::fit::time_step::extrapolation;
use crate::residual_model::{ResidualRequest, TimeStep};
use btr_core::world::{Cancelled, WorldError};
use rayon::prelude::*;
use std::sync::atomic::Ordering;

/// Bound of the integrator's estimated error at a sample, in multiples of the noise.
const WORST_STEP_ERROR: f64 = 5.0;

impl Objective<'_> {
    /// Residuals at several points, in parallel; for each point, the residuals of all its logs or the reason of the
    /// first failing rollout.
    pub fn residuals(&self, points: &[Vec<f64>], logs: LogSet) -> Vec<Result<ResidualVector, WorldError>> {
        self.residuals_of(points, self.logs(logs))
    }

    /// The same for some logs.
    pub fn residuals_of(&self, points: &[Vec<f64>], which: &[usize]) -> Vec<Result<ResidualVector, WorldError>> {
        self.in_steps(points, which, self.step())
    }

    fn in_steps(
        &self,
        points: &[Vec<f64>],
        which: &[usize],
        step: TimeStep,
    ) -> Vec<Result<ResidualVector, WorldError>> {
        if self.is_stopped() {
            return points.iter().map(|_| Err(Cancelled.into())).collect();
        }
        let of_log = |&log: &usize| points.iter().map(move |u| (u.as_slice(), log));
        let requests: Vec<(&[f64], usize)> = which.iter().flat_map(of_log).collect();
        let parts = if self.description.joint_laws.is_empty() || step != self.step() {
            self.simulated(&requests, step, &|log, residual| self.known(log, residual))
        } else {
            self.added_up(&requests)
        };
        let mut residuals: Vec<Result<ResidualVector, WorldError>> = points.iter().map(|_| Ok(Vec::new())).collect();
        for (k, part) in parts.into_iter().enumerate() {
            let of_point = &mut residuals[k % points.len()];
            match (of_point.as_mut(), part) {
                (Ok(residual), Ok(part)) if residual.is_empty() => *residual = part,
                (Ok(residual), Ok(part)) => residual.extend(part),
                (Ok(_), Err(error)) => *of_point = Err(error),
                (Err(_), _) => {}
            }
        }
        residuals
    }

    /// Simulates points in logs, and applies `convert` to each log and residual.
    fn simulated<T: Send>(
        &self,
        points: &[(&[f64], usize)],
        step: TimeStep,
        convert: &(dyn Fn(usize, Result<Vec<f64>, WorldError>) -> T + Sync),
    ) -> Vec<T> {
        self.rollouts.fetch_add(points.len(), Ordering::Relaxed);
        self.each(points, &|requests| self.model.residuals(requests, step), convert)
    }

    /// Applies `simulate` to requests in batches, and `convert` to each log and residual.
    fn each<T: Send>(
        &self,
        points: &[(&[f64], usize)],
        simulate: &Answer,
        convert: &(dyn Fn(usize, Result<Vec<f64>, WorldError>) -> T + Sync),
    ) -> Vec<T> {
        let requests: Vec<ResidualRequest> = points.iter().map(|(u, log)| ResidualRequest::of(u, *log)).collect();
        each(self.description.batch_size, &requests, simulate, convert)
    }

    /// Residuals at points in logs, where most are sums of what is known.
    fn added_up(&self, points: &[(&[f64], usize)]) -> Vec<Result<ResidualVector, WorldError>> {
        let joint_parts = |requests: &[ResidualRequest]| self.model.joint_parts(requests, self.step());
        let problem = Problem {
            model: self.model,
            description: &self.description,
            simulate: &|points| self.simulated(&borrowed(points), self.step(), &|_, residual| residual),
            joint_parts: &|points| self.each(&borrowed(points), &joint_parts, &|_, residual| residual),
        };
        let residuals = self.superposition.residuals(problem, points);
        points.par_iter().zip(residuals).map(|((_, log), residual)| self.known(*log, residual)).collect()
    }

    /// The residual of a log with the response to its start state projected out; missing samples are zero.
    fn known(&self, log: usize, residual: Result<Vec<f64>, WorldError>) -> Result<ResidualVector, WorldError> {
        let mut residual = residual?;
        residual.iter_mut().filter(|r| !r.is_finite()).for_each(|r| *r = 0.0);
        self.starts.project(log, &mut residual);
        Ok(residual)
    }

    /// The residual at one point.
    ///
    /// # Errors
    /// The reason of the first failing rollout.
    pub fn residual(&self, point: &[f64], logs: LogSet) -> Result<ResidualVector, WorldError> {
        self.residuals(&[point.to_vec()], logs).pop().unwrap_or_else(|| Ok(Vec::new()))
    }

    /// The residual at one point with half the step.
    pub(in crate::fit) fn halved(&self, point: &[f64], logs: LogSet) -> Result<ResidualVector, WorldError> {
        self.all_halved(&[point.to_vec()], logs).pop().unwrap_or_else(|| Ok(Vec::new()))
    }

    /// The same at several points, in parallel.
    pub(in crate::fit) fn all_halved(
        &self,
        points: &[Vec<f64>],
        logs: LogSet,
    ) -> Vec<Result<ResidualVector, WorldError>> {
        self.in_steps(points, self.logs(logs), self.step().halved())
    }

    /// Does work at once on what shows in different channels, around points. What these have in common is simulated
    /// before that and kept, so that nothing is simulated twice, and counted twice, in some runs and not in others.
    pub(crate) fn around<T>(&self, points: &[&[f64]], work: impl FnOnce() -> T) -> T {
        if self.description.joint_laws.is_empty() {
            return work();
        }
        self.superposition.keep_all(true);
        points.iter().for_each(|u| drop(self.residual(u, LogSet::Learn)));
        let done = work();
        self.superposition.keep_all(false);
        done
    }

    /// What the integrator's error adds to the residual at a point. Zero where the simulation diverges with half the
    /// step, so that the error is unknown.
    pub fn step_error(&self, point: &[f64], usual: &[f64], logs: LogSet) -> ResidualVector {
        match self.halved(point, logs) {
            Ok(halved) => self.beyond(usual, &halved),
            Err(_) => vec![0.0; usual.len()],
        }
    }

    /// The change by halving the step, extrapolated to a step of zero (Richardson).
    pub(in crate::fit) fn beyond(&self, usual: &[f64], halved: &[f64]) -> ResidualVector {
        let beyond = extrapolation(self.description.order);
        halved.iter().zip(usual).map(|(h, r)| (beyond * (h - r)).clamp(-WORST_STEP_ERROR, WORST_STEP_ERROR)).collect()
    }
}

/// Points in logs, borrowed.
fn borrowed(points: &[(Vec<f64>, usize)]) -> Vec<(&[f64], usize)> {
    points.iter().map(|(u, log)| (u.as_slice(), *log)).collect()
}
