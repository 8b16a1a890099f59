//! A run with its folder: begin, resume, step, checkpoint.

use super::augment::Cause;
use super::lock::FolderLock;
use super::rescue::rescue;
use super::run_error::RunError;
use crate::distributed::{RemoteSimulator, RunPayloads, TestComparison};
use crate::experiment::Experiment;
use crate::model_text::enlarges;
use btr_core::coevolve::{Coevolution, Environment, Explanation, Plan, RunState, StepOutcome, StopReason};
use btr_core::distance::Distance;
use btr_identify::LadderStep;
use btr_identify::diagnose::Verdict;
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};

/// First bytes of a checkpoint: name and version of the format.
const MAGIC: &[u8; 8] = b"btr-cp\x00\x06";

/// A run with its folder.
pub struct Run {
    folder: PathBuf,
    lock: FolderLock,
    /// The stamp of the experiment that the run began with.
    stamp: String,
    distance: Box<dyn Distance>,
    state: Coevolution,
    larger: Enlargement,
    payloads: RunPayloads,
}

/// State of a checkpoint in addition to the loop's state.
#[derive(Default, Serialize, Deserialize)]
struct Enlargement {
    /// The experiment's text after S has grown.
    text: Option<String>,
    /// The last diagnosis of the disengagement.
    cause: Option<Cause>,
    /// The explanation of the tests that belongs to the diagnosis.
    explanation: Option<Explanation>,
}

impl Run {
    /// Begins a run of `plan` in a folder that must not hold one yet.
    ///
    /// # Errors
    /// A folder in use, or a plan that does not fit.
    pub fn begin(experiment: &Experiment, plan: Plan, folder: &Path) -> Result<Self, RunError> {
        let lock = FolderLock::of(folder)?;
        if checkpoint_path(folder).exists() {
            return Err(RunError::Exists(folder.to_owned()));
        }
        Run::anew(experiment, plan, folder, lock)
    }

    fn anew(experiment: &Experiment, plan: Plan, folder: &Path, lock: FolderLock) -> Result<Self, RunError> {
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
        };
        run.write("experiment.toml", run.stamp.as_bytes())?;
        run.checkpoint()?;
        Ok(run)
    }

    /// Resumes a run from its last checkpoint. If the experiment's S is larger than the run's, the run continues in the
    /// larger one.
    ///
    /// # Errors
    /// No run in the folder, another experiment, a damaged checkpoint, or a real test whose log is missing.
    pub fn resume(experiment: &mut Experiment, plan: Plan, folder: &Path) -> Result<Self, RunError> {
        if !checkpoint_path(folder).exists() {
            return Err(RunError::NoRun(folder.to_owned()));
        }
        let lock = FolderLock::of(folder)?;
        sweep(folder)?;
        Run::locked(experiment, plan, folder, lock)
    }

    fn locked(experiment: &mut Experiment, plan: Plan, folder: &Path, lock: FolderLock) -> Result<Self, RunError> {
        let path = checkpoint_path(folder);
        let bytes = std::fs::read(&path).map_err(|_| RunError::NoRun(folder.to_owned()))?;
        let damaged = |why: &str| RunError::Checkpoint { path: path.clone(), why: why.to_owned() };
        let body = bytes.strip_prefix(MAGIC).ok_or_else(|| damaged("unknown header"))?;
        let (larger, state): (Enlargement, RunState) =
            postcard::from_bytes(body).map_err(|e| damaged(&e.to_string()))?;
        let requested = in_space_of_run(experiment, larger.text.as_deref(), folder)?;
        let mut state = Coevolution::resumed(plan, state);
        state.recall(experiment.reality.as_mut()).map_err(|error| RunError::LostTest(error.text()))?;
        let distance = state.plan().distance.build();
        let stamp = stamp_of(folder);
        let payloads = RunPayloads::default();
        let mut run = Run { folder: folder.to_owned(), lock, stamp, distance, state, larger, payloads };
        if let Some(text) = requested {
            run.enlarge(experiment, text)?;
        }
        Ok(run)
    }

    /// Resumes a run of exactly this experiment, S included, or begins a new one. For results that can be computed
    /// again from the real tests of another run.
    ///
    /// # Errors
    /// As [`Run::begin`] and [`Run::resume`].
    pub fn begin_or_resume(experiment: &mut Experiment, plan: Plan, folder: &Path) -> Result<Self, RunError> {
        if checkpoint_path(folder).exists() && stamp_of(folder) == experiment.stamp() {
            return Run::resume(experiment, plan, folder);
        }
        Run::anew(experiment, plan, folder, FolderLock::of(folder)?)
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
    fn enlarge(&mut self, experiment: &mut Experiment, text: String) -> Result<(), RunError> {
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
        self.larger.cause.as_ref()
    }

    /// The state of the loop.
    pub fn state(&self) -> &Coevolution {
        &self.state
    }

    /// The run's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Writes a file of the run atomically.
    ///
    /// # Errors
    /// A failed write.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<PathBuf, RunError> {
        self.check_folder()?;
        let path = self.folder.join(name);
        btr_io::write_whole(&path, |file| file.write_all(bytes))
            .map_err(|source| RunError::Io { path: path.clone(), source })?;
        Ok(path)
    }

    fn checkpoint(&self) -> Result<(), RunError> {
        self.write("checkpoint.bin", &self.checkpoint_bytes()?).map(|_| ())
    }

    fn checkpoint_bytes(&self) -> Result<Vec<u8>, RunError> {
        let body = postcard::to_allocvec(&(&self.larger, self.state.state()))
            .map_err(|e| RunError::Checkpoint { path: checkpoint_path(&self.folder), why: e.to_string() })?;
        Ok([MAGIC.as_slice(), &body].concat())
    }

    /// Checks that the folder is still there. If not, no test may begin: what is in memory is written beside it.
    fn check_folder(&self) -> Result<(), RunError> {
        if self.lock.is_in_place() {
            return Ok(());
        }
        let checkpoint = self.checkpoint_bytes()?;
        let files = [("experiment.toml", self.stamp.as_bytes()), ("checkpoint.bin", &checkpoint)];
        Err(rescue(&self.folder, &files, self.state.ledger().entries()))
    }
}

/// Gives an experiment the S of the run in this folder and the reality that the run began with; `grown` is the run's
/// text after its S has grown. Returns the experiment's original text if its S is even larger.
fn in_space_of_run(
    experiment: &mut Experiment,
    grown: Option<&str>,
    folder: &Path,
) -> Result<Option<String>, RunError> {
    let (stamp, requested) = (experiment.stamp(), experiment.source().text.clone());
    let began = stamp_of(folder);
    let mut larger = None;
    if began != stamp {
        // A stamp's first line is the seed, its rest the text.
        let (seed, text) = began.split_once('\n').unwrap_or_default();
        let present = grown.unwrap_or(text);
        let grows = enlarges(present, &requested);
        if stamp.lines().next() != Some(seed) || !(grows || requested == present) {
            return Err(RunError::OtherExperiment(folder.to_owned()));
        }
        experiment.restart(text.to_owned(), folder)?;
        larger = grows.then_some(requested);
    }
    if let Some(text) = grown {
        experiment.enlarge(text.to_owned())?;
    }
    Ok(larger)
}

/// The stamp of the experiment that the run in this folder began with; empty if there is none.
fn stamp_of(folder: &Path) -> String {
    std::fs::read_to_string(folder.join("experiment.toml")).unwrap_or_default()
}

/// Removes the temporary files that killed runs left in the folder and in those of its real tests.
fn sweep(folder: &Path) -> Result<(), RunError> {
    let swept =
        |path: &Path| btr_io::sweep_temporary(path).map_err(|source| RunError::Io { path: path.to_owned(), source });
    swept(folder)?;
    let tests = std::fs::read_dir(folder.join("transfers")).into_iter().flatten().flatten();
    tests.map(|entry| entry.path()).filter(|path| path.is_dir()).try_for_each(|path| swept(&path))
}

fn checkpoint_path(folder: &Path) -> PathBuf {
    folder.join("checkpoint.bin")
}
