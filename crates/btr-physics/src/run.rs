//! A run of `btr coevolve` on disk: a folder with the experiment, the real tests, a checkpoint after every step and, at the
//! end, the results. Killed at any moment it loses at most the step in flight, never a real test.

use crate::experiment::{Experiment, FileError};
use crate::io;
use btr_core::coevolve::{Coevolution, On, Plan, PlanError, State, Step};
use btr_core::distance::Distance;
use std::io::Write;
use std::path::{Path, PathBuf};

/// First bytes of a checkpoint: name and version of the format.
const MAGIC: &[u8; 8] = b"btr-cp\x00\x02";

/// Why a run cannot begin or go on.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The experiment.
    #[error(transparent)]
    File(#[from] FileError),
    /// The plan does not fit the experiment.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The folder belongs to a run already.
    #[error("{} holds a run already", .0.display())]
    Exists(PathBuf),
    /// There is nothing to resume.
    #[error("{} holds no run to resume", .0.display())]
    NoRun(PathBuf),
    /// The experiment is not the one the run began with.
    #[error("the experiment is not the one that {} was begun with", .0.display())]
    OtherExperiment(PathBuf),
    /// A checkpoint of another version, or a damaged one.
    #[error("{} is not a checkpoint of this version: {why}", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// A real test that was done and is gone.
    #[error("{0}")]
    LostTest(String),
    /// The disk refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// Where.
        path: PathBuf,
        /// What it said.
        source: std::io::Error,
    },
}

impl RunError {
    /// What to do about it.
    pub fn help(&self) -> Option<String> {
        match self {
            RunError::File(error) => error.help.clone(),
            RunError::Exists(_) => Some("go on with --resume, or choose another --out".to_owned()),
            RunError::NoRun(_) => Some("start it without --resume".to_owned()),
            RunError::OtherExperiment(path) => Some(format!(
                "resume with the file, --set and --seed that {} shows, or choose another --out",
                path.join("experiment.toml").display()
            )),
            RunError::Checkpoint { .. } => {
                Some("choose another --out; the real tests in transfers/ are untouched".to_owned())
            }
            RunError::LostTest(_) => Some("put the log back into its folder under transfers/".to_owned()),
            RunError::Plan(_) | RunError::Io { .. } => None,
        }
    }
}

/// A run with its folder.
pub struct Run {
    folder: PathBuf,
    distance: Box<dyn Distance>,
    state: Coevolution,
}

impl Run {
    /// Begins a run of `plan` in a folder that must not hold one yet.
    ///
    /// # Errors
    /// A folder in use, or a plan that does not fit.
    pub fn begin(experiment: &Experiment, plan: Plan, folder: &Path) -> Result<Self, RunError> {
        if checkpoint_path(folder).exists() {
            return Err(RunError::Exists(folder.to_owned()));
        }
        let distance = plan.distance.build();
        let state = Coevolution::new(plan, experiment.seed, experiment.model.as_ref())?;
        let run = Run { folder: folder.to_owned(), distance, state };
        run.write("experiment.toml", experiment.stamp().as_bytes())?;
        run.checkpoint()?;
        Ok(run)
    }

    /// Takes a run up again where its last checkpoint left it.
    ///
    /// # Errors
    /// No run there, another experiment, a damaged checkpoint, or a real test whose log is gone.
    pub fn resume(experiment: &mut Experiment, plan: Plan, folder: &Path) -> Result<Self, RunError> {
        let path = checkpoint_path(folder);
        let bytes = std::fs::read(&path).map_err(|_| RunError::NoRun(folder.to_owned()))?;
        let stamp = std::fs::read_to_string(folder.join("experiment.toml")).unwrap_or_default();
        if stamp != experiment.stamp() {
            return Err(RunError::OtherExperiment(folder.to_owned()));
        }
        let damaged = |why: &str| RunError::Checkpoint { path: path.clone(), why: why.to_owned() };
        let body = bytes.strip_prefix(MAGIC).ok_or_else(|| damaged("unknown header"))?;
        let state: State = postcard::from_bytes(body).map_err(|e| damaged(&e.to_string()))?;
        let mut state = Coevolution::resumed(plan, state);
        state.recall(experiment.reality.as_mut()).map_err(RunError::LostTest)?;
        Ok(Run { folder: folder.to_owned(), distance: state.plan().distance.build(), state })
    }

    /// Begins, or resumes when there is something to resume.
    ///
    /// # Errors
    /// As [`Run::begin`] and [`Run::resume`].
    pub fn begin_or_resume(experiment: &mut Experiment, plan: Plan, folder: &Path) -> Result<Self, RunError> {
        if checkpoint_path(folder).exists() {
            return Run::resume(experiment, plan, folder);
        }
        Run::begin(experiment, plan, folder)
    }

    /// Does the next unit of work and writes it down.
    ///
    /// # Errors
    /// When the disk refuses; the state before the step is still there.
    pub fn step(&mut self, experiment: &mut Experiment) -> Result<Step, RunError> {
        let mut on = On {
            simulator: experiment.model.as_ref(),
            distance: self.distance.as_ref(),
            reality: experiment.reality.as_mut(),
        };
        let step = self.state.step(&mut on);
        self.checkpoint()?;
        Ok(step)
    }

    /// Where the run is.
    pub fn state(&self) -> &Coevolution {
        &self.state
    }

    /// The run's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Writes a file of the run, whole or not at all.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<PathBuf, RunError> {
        let path = self.folder.join(name);
        let written = path.parent().map_or(Ok(()), std::fs::create_dir_all);
        written
            .and_then(|()| io::write_whole(&path, |file| file.write_all(bytes)))
            .map_err(|source| RunError::Io { path: path.clone(), source })?;
        Ok(path)
    }

    fn checkpoint(&self) -> Result<(), RunError> {
        let body = postcard::to_allocvec(self.state.state())
            .map_err(|e| RunError::Checkpoint { path: checkpoint_path(&self.folder), why: e.to_string() })?;
        self.write("checkpoint.bin", &[MAGIC.as_slice(), &body].concat()).map(|_| ())
    }
}

fn checkpoint_path(folder: &Path) -> PathBuf {
    folder.join("checkpoint.bin")
}
