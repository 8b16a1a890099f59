//! A run with its folder: begin, resume, step, checkpoint.

use super::augment::Cause;
use super::checkpoint;
use super::files::{CHECKPOINT, EXPERIMENT, checkpoint_path, locked, write_in};
use super::lock::FolderLock;
use super::rescue::rescue;
use super::run_error::RunError;
use crate::distributed::{RemoteSimulator, RunPayloads, TestComparison};
use crate::experiment::Experiment;
use btr_core::coevolve::{Coevolution, Environment, Explanation, Plan, StepOutcome, StopReason};
use btr_core::distance::Distance;
use btr_core::log::Log;
use btr_identify::LadderStep;
use btr_identify::diagnose::Verdict;
use btr_io::Meta;
use serde::{Deserialize, Serialize};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// A run with its folder.
pub struct Run {
    pub(super) folder: PathBuf,
    pub(super) lock: FolderLock,
    /// The stamp of the experiment that the run began with.
    pub(super) stamp: String,
    pub(super) distance: Box<dyn Distance>,
    pub(super) state: Coevolution,
    pub(super) larger: Enlargement,
    pub(super) payloads: RunPayloads,
    /// Damage that was repaired as the run was resumed.
    pub(super) repaired: Option<String>,
    /// Whether it is a part of another run, with which it would be computed again.
    pub(super) is_part: bool,
}

/// State of a checkpoint in addition to the loop's state.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct Enlargement {
    /// The experiment's text after S has grown.
    pub(super) text: Option<String>,
    /// The last diagnosis of the disengagement.
    cause: Option<Cause>,
    /// The explanation of the tests that belongs to the diagnosis.
    explanation: Option<Explanation>,
}

impl Enlargement {
    /// The last diagnosis of the disengagement, if there was one.
    pub(super) fn cause(&self) -> Option<&Cause> {
        self.cause.as_ref()
    }

    /// Whether the explanation is one of its own space.
    pub(super) fn is_whole(&self) -> bool {
        self.explanation.as_ref().is_none_or(|known| known.estimated.belief.is_of(known.space.len()))
    }
}

impl Run {
    /// Begins a run of `plan` in a folder that must not hold one yet.
    ///
    /// # Errors
    /// A folder in use, or a plan that does not fit.
    pub fn begin(experiment: &Experiment, plan: Plan, folder: &Path) -> Result<Self, RunError> {
        std::fs::create_dir_all(folder).map_err(|source| RunError::Io { path: folder.to_owned(), source })?;
        let lock = locked(folder)?;
        if checkpoint_path(folder).exists() {
            return Err(RunError::Exists(folder.to_owned()));
        }
        Run::anew(experiment, plan, folder, lock)
    }

    pub(super) fn anew(experiment: &Experiment, plan: Plan, folder: &Path, lock: FolderLock) -> Result<Self, RunError> {
        let distance = plan.distance.build();
        let state = Coevolution::new(plan, experiment.seed, experiment.model.as_ref())?;
        let run = Run {
            folder: folder.to_owned(),
            lock,
            stamp: experiment.stamp(),
            distance,
            state,
            larger: Enlargement::default(),
            payloads: RunPayloads::default(),
            repaired: None,
            is_part: false,
        };
        write_in(folder, EXPERIMENT, run.stamp.as_bytes())?;
        write_in(folder, CHECKPOINT, &run.checkpoint_bytes()?)?;
        Ok(run)
    }

    /// Executes the next unit of work and writes a checkpoint.
    ///
    /// # Errors
    /// A failed write, or cancelled work; the checkpoint before the step is intact.
    pub fn step(&mut self, experiment: &mut Experiment) -> Result<StepOutcome, RunError> {
        self.check_folder()?;
        let model = experiment.model.clone();
        let comparison = TestComparison { distance: &self.state.plan().distance, reality: experiment.reality_source() };
        let (context, payloads) = (&experiment.context, &self.payloads);
        let simulator = RemoteSimulator::new(&model, experiment.source(), comparison, context, payloads)?;
        let (distance, reality) = (self.distance.as_ref(), experiment.reality.as_mut());
        let step = self.state.step(&mut Environment { simulator: &simulator, distance, reality })?;
        self.checkpoint()?;
        Ok(step)
    }

    /// Diagnoses a run that stopped because the populations disengaged, once. If the plan allows it and the cause is
    /// clear, adds the missing effects to S; true if the run continues. `on_step` is called with every step of the
    /// error ladder.
    ///
    /// # Errors
    /// A failed write, or cancelled work.
    pub fn look_for_cause(
        &mut self,
        experiment: &mut Experiment,
        reason: &StopReason,
        on_step: &dyn Fn(&LadderStep),
    ) -> Result<bool, RunError> {
        if !self.state.disengaged() {
            return Ok(false);
        }
        let closed = self.state.history().iterations.len();
        let cause = match self.larger.cause.take().filter(|cause| cause.after_iteration == closed) {
            Some(known) => known,
            None => {
                let (cause, explanation) = Cause::of(experiment, &self.state, on_step)?;
                self.larger.explanation = explanation;
                cause
            }
        };
        let stopped = *reason == StopReason::Disengaged;
        if stopped && cause.verdict == Some(Verdict::NothingMissing) && self.explain(experiment) {
            self.larger.cause = Some(cause);
            self.checkpoint()?;
            return Ok(true);
        }
        let missing = cause.missing();
        let goes_on = self.state.plan().self_augment && stopped && !missing.is_empty();
        let text = if goes_on { Some(cause.remedy(experiment)?) } else { None };
        self.larger.cause = Some(Cause { added: if goes_on { missing } else { Vec::new() }, ..cause });
        match text {
            Some(text) => self.enlarge(experiment, text)?,
            None => self.checkpoint()?,
        }
        Ok(goes_on)
    }

    /// Continues with the experiment of this text, which has more parameters.
    pub(super) fn enlarge(&mut self, experiment: &mut Experiment, text: String) -> Result<(), RunError> {
        experiment.enlarge(text.clone())?;
        self.state.enlarge(&experiment.model.simulations);
        self.explain(experiment);
        self.larger.text = Some(text);
        self.checkpoint()
    }

    /// Continues from the explanation of the tests; false if there is none in the present S.
    fn explain(&mut self, experiment: &Experiment) -> bool {
        let known = self.larger.explanation.take();
        known.is_some_and(|known| self.state.explain(&experiment.model.simulations, &known))
    }

    /// The last diagnosis of the disengagement, if there was one.
    pub fn cause(&self) -> Option<&Cause> {
        self.larger.cause()
    }

    /// The state of the loop.
    pub fn state(&self) -> &Coevolution {
        &self.state
    }

    /// The run's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Damage that was repaired as the run was resumed, as a sentence.
    pub fn repaired(&self) -> Option<&str> {
        self.repaired.as_deref()
    }

    /// Writes a file of the run atomically.
    ///
    /// # Errors
    /// A failed write.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<PathBuf, RunError> {
        self.check_folder()?;
        write_in(&self.folder, name, bytes).map_err(|error| self.lost_or(error))
    }

    /// Writes a log of the run atomically.
    ///
    /// # Errors
    /// A failed write.
    pub fn write_log(&self, name: &str, log: &Log, meta: &Meta) -> Result<PathBuf, RunError> {
        self.check_folder()?;
        let path = self.folder.join(name);
        match btr_io::write_log(&path, log, meta) {
            Ok(()) => Ok(path),
            Err(error) => Err(self.lost_or(RunError::Log(error))),
        }
    }

    /// Why a file could not be written, once the run had begun.
    fn lost_or(&self, error: RunError) -> RunError {
        self.check_folder().err().unwrap_or_else(|| RunError::Unwritable(Box::new(error)))
    }

    fn checkpoint(&self) -> Result<(), RunError> {
        self.write(CHECKPOINT, &self.checkpoint_bytes()?).map(|_| ())
    }

    fn checkpoint_bytes(&self) -> Result<Vec<u8>, RunError> {
        let state = postcard::to_allocvec(&(&self.larger, self.state.state()))
            .map_err(|e| RunError::Checkpoint { path: checkpoint_path(&self.folder), why: e.to_string() })?;
        Ok(checkpoint::bytes(&self.stamp, &state))
    }

    /// Checks that the folder is still there. If not, no test may begin: what is in memory is written beside it.
    ///
    /// # Errors
    /// [`RunError::FolderGone`], which says where that is.
    pub(super) fn check_folder(&self) -> Result<(), RunError> {
        if self.lock.is_in_place() {
            return Ok(());
        }
        if self.is_part {
            return Err(RunError::Io { path: self.folder.clone(), source: ErrorKind::NotFound.into() });
        }
        let checkpoint = self.checkpoint_bytes()?;
        let files = [(EXPERIMENT, self.stamp.as_bytes()), (CHECKPOINT, &checkpoint)];
        Err(rescue(&self.folder, &files, self.state.ledger().entries()))
    }
}
