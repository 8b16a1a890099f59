//! What a run's folder says of the run, for who watches it: read without a lock, and never written.

use crate::experiment::Source;
use crate::run::augment::Cause;
use crate::run::checkpoint::{Checkpoint, Unusable};
use crate::run::files::{EXPERIMENT, checkpoint_path};
use crate::run::folder::Enlargement;
use crate::run::run_error::RunError;
use btr_core::coevolve::{Augmentation, Drift, Entry, Generation, Iteration, RunState, Side, StopReason};
use btr_core::distance::DISTANCES;
use serde::Serialize;
use std::path::Path;

/// A run as its last checkpoint has it.
#[derive(Clone, Debug, Serialize)]
pub struct Snapshot {
    /// The text of its experiment, in its present S.
    pub text: String,
    /// The iterations that its plan has.
    pub planned: Option<usize>,
    /// The distance that phi is the mean of: its name, and what it compares.
    pub distance: Option<(&'static str, &'static str)>,
    /// The iteration being worked on, from 1.
    pub iteration: usize,
    /// What it does next, in words.
    pub activity: &'static str,
    /// Why it stopped; `None` while it has not.
    pub stop_reason: Option<StopReason>,
    /// What the last diagnosis of a disengagement says.
    pub cause: Option<String>,
    /// The simulation it began with, in the units of S.
    pub start: Vec<f64>,
    /// Every generation.
    pub generations: Vec<GenerationScores>,
    /// Every closed iteration.
    pub iterations: Vec<Iteration>,
    /// The ledger of real tests.
    pub tests: Vec<Entry>,
    /// How S has grown.
    pub augmentations: Vec<Augmentation>,
    /// How the robot has changed.
    pub drifts: Vec<Drift>,
    /// Simulated behaviours so far.
    pub simulated_evaluations: u64,
}

/// A generation without its individuals.
#[derive(Clone, Debug, Serialize)]
pub struct GenerationScores {
    iteration: usize,
    generation: usize,
    side: Side,
    best: f64,
    mean: f64,
    failed: usize,
}

impl Snapshot {
    /// Reads the run in this folder.
    ///
    /// # Errors
    /// No run in the folder, or a damaged one.
    pub fn read(folder: &Path) -> Result<Self, RunError> {
        let path = checkpoint_path(folder);
        if !path.is_file() {
            return Err(RunError::NotARun(folder.to_owned()));
        }
        let read = |path: &Path| std::fs::read(path).map_err(|source| RunError::Io { path: path.to_owned(), source });
        let (bytes, stamp) = (read(&path)?, read(&folder.join(EXPERIMENT))?);
        let unusable = |why: &str| RunError::Checkpoint { path: path.clone(), why: why.to_owned() };
        let stamp = String::from_utf8(stamp).map_err(|_| RunError::OtherStamp(folder.to_owned()))?;
        let saved = Checkpoint::read(&bytes).map_err(|error| match error {
            Unusable::Version(version) => RunError::OtherVersion { path: path.clone(), version },
            Unusable::Damaged(why) => unusable(why),
        })?;
        if !saved.is_of(&stamp) {
            return Err(RunError::OtherStamp(folder.to_owned()));
        }
        let state = postcard::from_bytes(saved.state).map_err(|error| unusable(&error.to_string()))?;
        Ok(Snapshot::of(&stamp, state))
    }

    fn of(stamp: &str, (larger, state): (Enlargement, RunState)) -> Self {
        // A stamp's first line is the seed.
        let began = stamp.split_once('\n').map_or("", |(_, text)| text);
        let text = larger.text.clone().unwrap_or_else(|| began.to_owned());
        let plan = Source::new(EXPERIMENT, &*text).parse().ok().and_then(|file| file.coevolve);
        let history = state.history();
        Snapshot {
            planned: plan.as_ref().map(|plan| plan.iterations),
            distance: plan.as_ref().and_then(|plan| described(plan.distance.name())),
            text,
            iteration: state.iteration(),
            activity: state.activity(),
            stop_reason: state.stop_reason().cloned(),
            cause: larger.cause().map(Cause::sentence),
            start: state.start().to_vec(),
            generations: history.generations.iter().map(GenerationScores::of).collect(),
            iterations: history.iterations.clone(),
            tests: state.ledger().entries().to_vec(),
            augmentations: history.augmentations.clone(),
            drifts: history.drifts.clone(),
            simulated_evaluations: state.cost().evaluations,
        }
    }
}

/// A distance, and what it compares.
fn described(name: &str) -> Option<(&'static str, &'static str)> {
    DISTANCES.iter().find(|(known, _)| *known == name).copied()
}

impl GenerationScores {
    fn of(generation: &Generation) -> Self {
        let &Generation { iteration, generation, side, best, mean, failed, .. } = generation;
        GenerationScores { iteration, generation, side, best, mean, failed }
    }
}
