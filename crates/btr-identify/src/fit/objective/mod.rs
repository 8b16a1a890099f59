//! The objective of a fit: a residual model with its logs split, a time step, and a count of rollouts.

pub(super) mod blocks;
mod channels;
mod evaluation;
mod judged;
mod superposition;

use self::blocks::OwnChannels;
use self::judged::Judged;
use self::superposition::Superposition;
use super::residual_vector::squares;
use super::start::{MOVED, StartStates, nearest_starts};
use super::time_step::finer_step;
use crate::residual_model::{
    Derivation, EffectCandidate, FitParameter, LawTerm, ModelDescription, ResidualModel, TimeStep,
};
use std::iter::{once, once_with};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

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

    /// The same objective without one of the training logs.
    pub(crate) fn without_log(&self, log: usize) -> Self {
        Objective {
            model: self.model,
            description: self.description.clone(),
            learn: self.learn.iter().copied().filter(|other| *other != log).collect(),
            held_out: self.held_out.clone(),
            starts: self.starts.clone(),
            step: self.step,
            superposition: Superposition::default(),
            judged: Judged::default(),
            own_channels: OwnChannels::new(&self.description),
            rollouts: self.rollouts().into(),
            stop_signal: self.stop_signal.clone(),
            stoppable: self.stoppable,
        }
    }

    /// The model with starts from the model at a point; see [`Derivation::WithStartsAt`]. `None` where that makes no
    /// difference.
    pub(crate) fn with_starts_at(&self, u: &[f64]) -> Option<Box<dyn ResidualModel>> {
        let (moved, rollouts) = nearest_starts(self.model, &self.description, u, MOVED);
        self.add_rollouts(rollouts);
        self.model.derive(&match moved.is_empty() {
            true => Derivation::WithStartsAt(u.to_vec()),
            false => Derivation::WithInitialState(moved),
        })
    }

    /// Takes over the rollout count of an objective that was derived from this one.
    pub(crate) fn count(&self, other: &Objective) {
        self.rollouts.store(other.rollouts(), Ordering::Relaxed);
    }

    /// Counts logs that were simulated for another objective.
    pub(super) fn add_rollouts(&self, rollouts: usize) {
        self.rollouts.fetch_add(rollouts, Ordering::Relaxed);
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

    /// Whether small errors grow, so that the noise floors are only roughly known.
    pub fn has_rough_floors(&self) -> bool {
        self.description.has_contact || self.description.is_chaotic
    }

    /// The logs of a set, as indices.
    pub fn logs(&self, logs: LogSet) -> &[usize] {
        match logs {
            LogSet::Learn => &self.learn,
            LogSet::HeldOut => &self.held_out,
        }
    }

    /// What the held-out logs said of points lately.
    pub(super) fn judged(&self) -> &Judged {
        &self.judged
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
