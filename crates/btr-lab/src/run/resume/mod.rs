//! How a run goes on from what is in its folder. Nothing damaged is used: what can be computed again is.

mod snapshot;

pub use snapshot::Snapshot;

use super::checkpoint::{Checkpoint, Unusable};
use super::files::{EXPERIMENT, checkpoint_path, locked, stamp_of, write_in};
use super::folder::{Enlargement, Run};
use super::lock::FolderLock;
use super::run_error::RunError;
use crate::distributed::RunPayloads;
use crate::experiment::Experiment;
use crate::model_text::enlarges;
use btr_core::coevolve::{Coevolution, Plan, RunState};
use std::path::Path;

impl Run {
    /// Resumes a run from its last checkpoint. If the experiment's S is larger than the run's, the run continues in the
    /// larger one. A damaged checkpoint is not used: the run is computed again, with its real tests as they are on
    /// disk.
    ///
    /// # Errors
    /// No run in the folder, another experiment, a checkpoint of another version or a damaged one of a run that has
    /// grown since, or a real test whose log is missing or damaged.
    pub fn resume(experiment: &mut Experiment, plan: Plan, folder: &Path) -> Result<Self, RunError> {
        if !checkpoint_path(folder).exists() {
            return Err(RunError::NoRun(folder.to_owned()));
        }
        let lock = locked(folder)?;
        let path = checkpoint_path(folder);
        let bytes = std::fs::read(&path).map_err(|_| RunError::NoRun(folder.to_owned()))?;
        let (began, stamp) = (stamp_of(folder), experiment.stamp());
        match Checkpoint::read(&bytes) {
            Ok(saved) if saved.is_of(&began) => Run::saved(experiment, plan, folder, lock, saved.state),
            Ok(saved) if saved.is_of(&stamp) => {
                let repaired = write_in(folder, EXPERIMENT, stamp.as_bytes())?;
                let run = Run::saved(experiment, plan, folder, lock, saved.state)?;
                let told = format!("{} was damaged and is written again", repaired.display());
                Ok(Run { repaired: Some(told), ..run })
            }
            Ok(_) if began != stamp => Err(RunError::OtherStamp(folder.to_owned())),
            Ok(_) => Run::again(experiment, plan, folder, lock, "it belongs to another run"),
            Err(Unusable::Version(version)) => Err(RunError::OtherVersion { path, version }),
            Err(Unusable::Damaged(why)) if began != stamp => Err(RunError::Checkpoint { path, why: why.to_owned() }),
            Err(Unusable::Damaged(why)) => Run::again(experiment, plan, folder, lock, why),
        }
    }

    /// Computes a run again from its beginning. Its real tests are read back as they come.
    fn again(
        experiment: &Experiment,
        plan: Plan,
        folder: &Path,
        lock: FolderLock,
        why: &str,
    ) -> Result<Self, RunError> {
        let path = checkpoint_path(folder);
        let told = format!("{} is not used: {why}; the run is computed again with its real tests", path.display());
        Ok(Run { repaired: Some(told), ..Run::anew(experiment, plan, folder, lock)? })
    }

    fn saved(
        experiment: &mut Experiment,
        plan: Plan,
        folder: &Path,
        lock: FolderLock,
        state: &[u8],
    ) -> Result<Self, RunError> {
        let stamp = stamp_of(folder);
        let given = experiment.stamp();
        let Restored { mut state, larger, requested } = match restored(experiment, plan.clone(), folder, state) {
            // An experiment that has taken the run's larger S is not the one that the run began with.
            Err(RunError::Checkpoint { why, .. }) if [given, experiment.stamp()].iter().all(|s| *s == stamp) => {
                return Run::again(experiment, plan, folder, lock, &why);
            }
            restored => restored?,
        };
        state.recall(experiment.reality.as_mut()).map_err(|error| RunError::LostTest(error.text()))?;
        let distance = state.plan().distance.build();
        let payloads = RunPayloads::default();
        let mut run = Run {
            folder: folder.to_owned(),
            lock,
            stamp,
            distance,
            state,
            larger,
            payloads,
            repaired: None,
            is_part: false,
        };
        if let Some(text) = requested {
            run.enlarge(experiment, text)?;
        }
        Ok(run)
    }

    /// Resumes a run of exactly this experiment, S included, or begins a new one. For results that can be computed
    /// again from the real tests of another run, in a folder that must be there.
    ///
    /// # Errors
    /// As [`Run::begin`] and [`Run::resume`].
    pub fn begin_or_resume(experiment: &mut Experiment, plan: Plan, folder: &Path) -> Result<Self, RunError> {
        let is_there = checkpoint_path(folder).exists() && stamp_of(folder) == experiment.stamp();
        let run = match is_there {
            true => Run::resume(experiment, plan, folder)?,
            false => Run::anew(experiment, plan, folder, locked(folder)?)?,
        };
        Ok(Run { is_part: true, ..run })
    }
}

/// What a checkpoint holds.
struct Restored {
    state: Coevolution,
    larger: Enlargement,
    /// The experiment's text if its S is larger than the run's.
    requested: Option<String>,
}

/// Reads the state of the run in this folder, and gives the experiment the run's S.
///
/// # Errors
/// A state that is none, or not one of this run; another experiment.
fn restored(experiment: &mut Experiment, plan: Plan, folder: &Path, state: &[u8]) -> Result<Restored, RunError> {
    let unusable = |why: String| RunError::Checkpoint { path: checkpoint_path(folder), why };
    let (larger, state): (Enlargement, RunState) = postcard::from_bytes(state).map_err(|e| unusable(e.to_string()))?;
    let requested = in_space_of_run(experiment, larger.text.as_deref(), folder)?;
    let state = Coevolution::resumed(plan, state, experiment.model.as_ref()).map_err(|e| unusable(e.to_string()))?;
    if !larger.is_whole() {
        return Err(unusable("the explanation in it is of no space".to_owned()));
    }
    Ok(Restored { state, larger, requested })
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
