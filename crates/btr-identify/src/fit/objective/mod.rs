//! Evaluation of a residual model: many points and logs at once, with a count of rollouts.

pub(super) mod blocks;
mod judged;
mod superposition;

use self::blocks::{Block, OwnChannels};
use self::judged::Judged;
use self::superposition::{Problem, Superposition};
use super::residual_vector::{ResidualVector, squares};
use super::rollouts::{Answer, each, rows_near, shared};
use super::start::{MOVED, StartStates, nearest_starts};
use super::time_step::{extrapolation, finer_step};
use crate::residual_model::{
    Derivation, EffectCandidate, FitParameter, LawTerm, ModelDescription, RecordedLog, ResidualModel, ResidualRequest,
    TimeStep,
};
use btr_core::world::{Cancelled, WorldError};
use nalgebra::DMatrix;
use std::iter::{once, once_with};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Bound of the integrator's estimated error at a sample, in multiples of the noise.
const WORST_STEP_ERROR: f64 = 5.0;

/// Whether a search should stop and keep the best so far: a time limit, or a user who has seen enough.
pub type StopSignal = Arc<dyn Fn() -> bool + Send + Sync>;

/// A residual model with its logs split, the time step that it is simulated with, and a counter of rollouts.
pub struct Objective<'a> {
    /// The residual model.
    pub model: &'a dyn ResidualModel,
    /// Its description.
    pub description: ModelDescription,
    learn: Vec<usize>,
    held_out: Vec<usize>,
    starts: StartStates,
    step: TimeStep,
    superposition: Superposition,
    judged: Judged,
    own_channels: OwnChannels,
    rollouts: AtomicUsize,
    stop_signal: Option<StopSignal>,
    /// Whether the signal counts now: the first evaluation and the final report are always finished.
    stoppable: bool,
}

/// The training or the held-out logs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogSet {
    /// The training logs.
    Learn,
    /// The held-out logs.
    HeldOut,
}

impl<'a> Objective<'a> {
    /// The objective of a residual model. Without held-out logs, sums over these are empty.
    pub fn new(model: &'a dyn ResidualModel) -> Self {
        let description = model.description();
        let origin = vec![0.0; description.parameters.len()];
        Self::described(model, description, &origin)
    }

    /// The same with the response to another start state taken from the model at a point.
    pub fn at(model: &'a dyn ResidualModel, u: &[f64]) -> Self {
        Self::described(model, model.description(), u)
    }

    /// The rows of these channels in the residual of a set of logs.
    pub(crate) fn rows_near(&self, logs: LogSet, near: &[String]) -> Vec<Range<usize>> {
        let (mut start, mut rows) = (0, Vec::new());
        for log in self.logs(logs).iter().map(|&log| &self.description.logs[log]) {
            rows.extend(rows_near(log, near).into_iter().map(|of_log| start + of_log.start..start + of_log.end));
            start += log.rows();
        }
        rows
    }

    /// The channels in which a parameter shows, where that is one of what acts in a joint of a prescribed motion, or in a
    /// limb; empty where it shows in all.
    pub(crate) fn channels_of(&self, parameter: usize) -> &[String] {
        self.own_channels.of(parameter)
    }

    /// The blocks of the training logs' Jacobian with respect to some parameters; none where it is dense.
    pub(super) fn blocks(&self, active: &[usize]) -> Vec<Block> {
        self.blocks_of(&self.learn, active)
    }

    /// The same of some logs.
    fn blocks_of(&self, logs: &[usize], active: &[usize]) -> Vec<Block> {
        let logs: Vec<&RecordedLog> = logs.iter().map(|&log| &self.description.logs[log]).collect();
        self.own_channels.blocks(&logs, active)
    }

    /// JᵀJ of a Jacobian of the residual of some logs.
    pub(crate) fn curvature(&self, jacobian: &DMatrix<f64>, logs: &[usize], active: &[usize]) -> DMatrix<f64> {
        blocks::curvature(jacobian, &self.blocks_of(logs, active))
    }

    /// Residuals with each of some parameters moved, those that show in different channels in one rollout;
    /// the error of a rollout in the place of those that it was for. `usual` is the residual without a move, for the
    /// channels where a parameter does not show.
    pub(super) fn moved(
        &self,
        points: &[(usize, Vec<f64>)],
        u: &[f64],
        usual: &[f64],
    ) -> Vec<Result<ResidualVector, WorldError>> {
        let alone = self.own_channels.hold_at(u);
        let channels_of = |parameter: usize| if alone { self.channels_of(parameter) } else { &[] };
        let groups = shared(points.iter().map(|(parameter, _)| channels_of(*parameter)));
        let together = |group: &Vec<usize>| {
            let mut point = u.to_vec();
            group.iter().for_each(|&k| point[points[k].0] = points[k].1[points[k].0]);
            point
        };
        let residuals = self.residuals(&groups.iter().map(together).collect::<Vec<_>>(), LogSet::Learn);
        let mut of_points: Vec<_> = points.iter().map(|_| Ok(Vec::new())).collect();
        for (group, residual) in groups.iter().zip(residuals) {
            for &k in group {
                of_points[k] = residual.as_ref().map_err(Clone::clone).map(|residual| {
                    let near = channels_of(points[k].0);
                    let mut own = if near.is_empty() { residual.clone() } else { usual.to_vec() };
                    let rows = if near.is_empty() { Vec::new() } else { self.rows_near(LogSet::Learn, near) };
                    rows.into_iter().for_each(|rows| own[rows.clone()].copy_from_slice(&residual[rows]));
                    own
                });
            }
        }
        of_points
    }

    fn described(model: &'a dyn ResidualModel, description: ModelDescription, u: &[f64]) -> Self {
        let logs = &description.logs;
        let (held_out, learn) = (0..logs.len()).partition(|log| logs[*log].held_out);
        let (starts, rollouts) = StartStates::at(model, &description, u);
        Objective {
            model,
            superposition: Superposition::default(),
            judged: Judged::default(),
            own_channels: OwnChannels::new(&description),
            description,
            learn,
            held_out,
            starts,
            step: TimeStep::USUAL,
            rollouts: AtomicUsize::new(rollouts),
            stop_signal: None,
            stoppable: false,
        }
    }

    /// The same, which a diagnosis stops searching on once the signal says so. From then on no rollout begins until the
    /// final report: all simulations that are still requested count as failed, so that every search keeps what it has.
    #[must_use]
    pub fn stopping_when(self, signal: StopSignal) -> Self {
        Objective { stop_signal: Some(signal), ..self }
    }

    /// Whether the search was told to stop.
    pub fn is_stopped(&self) -> bool {
        self.stoppable && self.stop_signal.as_ref().is_some_and(|signal| signal())
    }

    /// Whether the signal counts from now on.
    pub(crate) fn set_stoppable(&mut self, stoppable: bool) {
        self.stoppable = stoppable;
    }

    /// An objective for a derived model, with start states around a point, this objective's time step and its count of
    /// rollouts.
    pub(crate) fn going_on<'b>(&self, model: &'b dyn ResidualModel, u: &[f64]) -> Objective<'b> {
        let other = Objective::at(model, u);
        let rollouts = self.rollouts() + other.rollouts();
        let (stop_signal, stoppable) = (self.stop_signal.clone(), self.stoppable);
        Objective { step: self.step, rollouts: rollouts.into(), stop_signal, stoppable, ..other }
    }

    /// The model with starts from the model at a point; see [`Derivation::WithStartsAt`]. `None` where that makes no
    /// difference.
    pub(crate) fn with_starts_at(&self, u: &[f64]) -> Option<Box<dyn ResidualModel>> {
        let (moved, rollouts) = nearest_starts(self.model, &self.description, u, MOVED);
        self.rollouts.fetch_add(rollouts, Ordering::Relaxed);
        self.model.derive(&match moved.is_empty() {
            true => Derivation::WithStartsAt(u.to_vec()),
            false => Derivation::WithInitialState(moved),
        })
    }

    /// Takes over the rollout count of an objective that was derived from this one.
    pub(crate) fn count(&self, other: &Objective) {
        self.rollouts.store(other.rollouts(), Ordering::Relaxed);
    }

    /// Simulated logs so far.
    pub fn rollouts(&self) -> usize {
        self.rollouts.load(Ordering::Relaxed)
    }

    /// The time step that everything is simulated with.
    pub fn step(&self) -> TimeStep {
        self.step
    }

    /// Halves the time step from now on if the integrator's error requires it, on the training or else on the held-out
    /// logs, in noise floors; returns whether it did. Where motion is chaotic, the noise floors include that error.
    /// This is the only place where a fit or a diagnosis changes its time step.
    pub(super) fn refine(&mut self, learn: f64, held_out: impl FnOnce(&Objective) -> f64) -> bool {
        if self.description.is_chaotic {
            return false;
        }
        let finer = finer_step(self.step, once(learn).chain(once_with(|| held_out(self))));
        if let Some(finer) = finer {
            // What was simulated in longer steps counts no more.
            (self.step, self.superposition, self.judged) = (finer, Superposition::default(), Judged::default());
        }
        finer.is_some()
    }

    /// Everything that may be varied.
    pub fn parameters(&self) -> &[FitParameter] {
        &self.description.parameters
    }

    /// Effects that may be missing.
    pub fn candidates(&self) -> &[EffectCandidate] {
        &self.description.candidates
    }

    /// Terms of laws.
    pub fn law_terms(&self) -> &[LawTerm] {
        &self.description.law_terms
    }

    /// Largest error of a residual that counts as noise.
    pub fn noise_bound(&self) -> f64 {
        self.description.noise_bound
    }

    /// The logs of a set, as indices.
    pub fn logs(&self, logs: LogSet) -> &[usize] {
        match logs {
            LogSet::Learn => &self.learn,
            LogSet::HeldOut => &self.held_out,
        }
    }

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
        points.iter().zip(residuals).map(|((_, log), residual)| self.known(*log, residual)).collect()
    }

    /// The residual of a log with the response to its start state projected out; missing samples are zero.
    fn known(&self, log: usize, residual: Result<Vec<f64>, WorldError>) -> Result<ResidualVector, WorldError> {
        let mut residual = residual?;
        residual.iter_mut().filter(|r| !r.is_finite()).for_each(|r| *r = 0.0);
        self.starts.project(log, &mut residual);
        Ok(residual)
    }

    /// Measured samples of a set of logs, minus the degrees of freedom of their start states.
    pub fn samples(&self, logs: LogSet) -> usize {
        let count = |log: &usize| self.description.logs[*log].present.saturating_sub(self.starts.rank(*log));
        self.logs(logs).iter().map(count).sum()
    }

    /// The training logs with the largest sums of squares above the noise, worst first, with their rows in the
    /// residual. Near the noise floor, the sum alone would rank the logs by their lengths.
    pub fn worst_logs(&self, residual: &[f64], most: usize) -> Vec<(usize, Range<usize>)> {
        let mut start = 0;
        let mut logs: Vec<(f64, usize, Range<usize>)> = Vec::new();
        for &log in &self.learn {
            let rows = start..start + self.description.logs[log].rows();
            start = rows.end;
            let noise = self.description.logs[log].present as f64;
            logs.push((squares(&residual[rows.clone()]) - noise, log, rows));
        }
        logs.sort_by(|a, b| b.0.total_cmp(&a.0));
        logs.into_iter().take(most).map(|(_, log, rows)| (log, rows)).collect()
    }

    /// The residual at one point.
    ///
    /// # Errors
    /// The reason of the first failing rollout.
    pub fn residual(&self, point: &[f64], logs: LogSet) -> Result<ResidualVector, WorldError> {
        self.residuals(&[point.to_vec()], logs).pop().unwrap_or_else(|| Ok(Vec::new()))
    }

    /// The residual at one point with half the step.
    pub(super) fn halved(&self, point: &[f64], logs: LogSet) -> Result<ResidualVector, WorldError> {
        self.all_halved(&[point.to_vec()], logs).pop().unwrap_or_else(|| Ok(Vec::new()))
    }

    /// The same at several points, in parallel.
    pub(super) fn all_halved(&self, points: &[Vec<f64>], logs: LogSet) -> Vec<Result<ResidualVector, WorldError>> {
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

    /// What the held-out logs said of points lately.
    pub(super) fn judged(&self) -> &Judged {
        &self.judged
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
    pub(super) fn beyond(&self, usual: &[f64], halved: &[f64]) -> ResidualVector {
        let beyond = extrapolation(self.description.order);
        halved.iter().zip(usual).map(|(h, r)| (beyond * (h - r)).clamp(-WORST_STEP_ERROR, WORST_STEP_ERROR)).collect()
    }
}

/// Points in logs, borrowed.
fn borrowed(points: &[(Vec<f64>, usize)]) -> Vec<(&[f64], usize)> {
    points.iter().map(|(u, log)| (u.as_slice(), *log)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::SyntheticModel;

    #[test]
    fn a_log_is_not_the_worst_for_being_long() {
        let model = SyntheticModel::new(Vec::new(), 100, |_| Vec::new()).and_log(40);
        let residual: Vec<f64> = [vec![1.0; 100], vec![1.3; 40]].concat();
        let worst = Objective::new(&model).worst_logs(&residual, 1);
        assert_eq!(worst, [(1, 100..140)]);
    }
}
