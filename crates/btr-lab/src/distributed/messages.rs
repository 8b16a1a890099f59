//! What goes to workers and comes back.

use super::bundle::Folder;
use btr_core::log::Log;
use btr_core::world::{Behaviour, Output, WorldError};
use btr_identify::residual_model::Derivation;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::hash::{DefaultHasher, Hasher};
use std::path::PathBuf;

/// Both ends must be of one version: messages have no format that outlives it.
pub(super) const VERSION: &str = env!("CARGO_PKG_VERSION");

/// What a worker is told once, with a name under which it may keep what it made of it.
#[derive(Debug)]
pub struct Payload {
    /// The same for the same content.
    pub key: u64,
    /// The content.
    pub bytes: Vec<u8>,
}

impl Payload {
    pub(super) fn of(content: &PayloadContent) -> Result<Self, String> {
        let bytes = postcard::to_allocvec(&(VERSION, content)).map_err(|e| e.to_string())?;
        Ok(Payload { key: name_of(&bytes), bytes })
    }

    pub(super) fn content(bytes: &[u8]) -> Result<PayloadContent, String> {
        let of_another =
            |theirs: &str| format!("btr {VERSION} cannot work for btr {theirs}: install the same version everywhere");
        let (theirs, rest): (String, &[u8]) =
            postcard::take_from_bytes(bytes).map_err(|_| of_another("of another version"))?;
        if theirs != VERSION {
            return Err(of_another(&theirs));
        }
        postcard::from_bytes(rest).map_err(|e| e.to_string())
    }
}

/// What may be in a parcel.
#[derive(Serialize, Deserialize)]
pub(super) enum PayloadContent {
    /// A model beside its logs.
    Problem { model: Folder, learn: Vec<(PathBuf, Log)>, held_out: Vec<(PathBuf, Log)> },
    /// An experiment's simulations, by what they are compared with real tests (as JSON, which tells names from tables), and
    /// whether a robot of its own stands for its `[reality]`.
    Experiment { experiment: Folder, distance: String, robot: bool },
    /// What came of a real test.
    Test(Behaviour),
}

/// A point of a family, most of whose coordinates are 0: those that are not.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Sparse {
    length: u32,
    there: Vec<(u32, f64)>,
}

impl Sparse {
    pub(super) fn of(point: &[f64]) -> Self {
        let there = point.iter().enumerate().filter(|(_, x)| x.to_bits() != 0);
        Sparse { length: point.len() as u32, there: there.map(|(k, x)| (k as u32, *x)).collect() }
    }

    pub(super) fn dense(&self) -> Vec<f64> {
        let mut point = vec![0.0; self.length as usize];
        for &(k, x) in &self.there {
            if let Some(slot) = point.get_mut(k as usize) {
                *slot = x;
            }
        }
        point
    }
}

/// A rollout of a family.
#[derive(Serialize, Deserialize)]
pub(super) struct RolloutMessage {
    pub(super) u: Sparse,
    pub(super) log: usize,
    pub(super) moved: Sparse,
}

/// Rollouts of a family.
#[derive(Serialize, Deserialize)]
pub(super) struct Rollouts {
    pub(super) derived: Vec<Derivation>,
    pub(super) halvings: u8,
    pub(super) asked: Vec<RolloutMessage>,
}

/// Residuals, or why there are none.
pub(super) type ResidualMessage = Result<Vec<f64>, RolloutFailure>;

/// Why a rollout failed.
#[derive(Serialize, Deserialize)]
pub(super) enum RolloutFailure {
    BlewUp { time_s: f64, what: String },
    Law { what: String },
    Setup { what: String },
}

impl From<WorldError> for RolloutFailure {
    fn from(error: WorldError) -> Self {
        match error {
            WorldError::BlewUp { time_s, what } => RolloutFailure::BlewUp { time_s, what },
            WorldError::Law { what } => RolloutFailure::Law { what },
            WorldError::Setup { what } => RolloutFailure::Setup { what },
            WorldError::Space(error) => RolloutFailure::Setup { what: error.to_string() },
            WorldError::Log(error) => RolloutFailure::Setup { what: error.to_string() },
        }
    }
}

impl From<RolloutFailure> for WorldError {
    fn from(failure: RolloutFailure) -> Self {
        match failure {
            RolloutFailure::BlewUp { time_s, what } => WorldError::BlewUp { time_s, what },
            RolloutFailure::Law { what } => WorldError::Law { what },
            RolloutFailure::Setup { what } => WorldError::Setup { what },
        }
    }
}

/// A candidate of a population.
#[derive(Serialize, Deserialize)]
pub(super) struct Candidate {
    pub(super) s: Vec<f64>,
    pub(super) c: Vec<f64>,
    pub(super) scenario: usize,
    pub(super) wanted: OutputOrder,
}

/// What is wanted of a candidate.
#[derive(Serialize, Deserialize)]
pub(super) enum OutputOrder {
    Behaviour,
    Fitness,
    /// The place of the test among the parcels, and whether residuals are wanted.
    Distance {
        test: usize,
        squares: bool,
    },
}

/// What was made of a candidate, or why nothing was.
pub(super) type CandidateResult = Result<Output, String>;

/// A batch of either kind.
#[derive(Serialize, Deserialize)]
pub(super) enum Batch {
    Rollouts(Rollouts),
    Population(Vec<Candidate>),
}

/// An answer with the worker's proof.
#[derive(Serialize, Deserialize)]
pub(super) struct Answer<T> {
    pub(super) fingerprint: u64,
    /// Which batch it answers.
    pub(super) batch: u64,
    pub(super) results: Vec<T>,
}

impl<T: DeserializeOwned> Answer<T> {
    /// The results, if the proof is this one and they are those of a batch for so many.
    pub(super) fn read(bytes: &[u8], fingerprint: u64, batch: &[u8], many: usize) -> Result<Vec<T>, String> {
        let answer: Answer<T> =
            postcard::from_bytes(bytes).map_err(|e| format!("a worker's answer makes no sense: {e}"))?;
        if answer.fingerprint != fingerprint {
            return Err("a worker simulates the model differently than it is simulated here: its files may differ (an index of logs?), \
                        or its build of btr"
                .to_owned());
        }
        if answer.batch != name_of(batch) || answer.results.len() != many {
            return Err("a worker's answer makes no sense: it is one to another batch".to_owned());
        }
        Ok(answer.results)
    }
}

/// A name for bytes: the same for the same ones.
pub(super) fn name_of(bytes: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    hasher.write(bytes);
    hasher.finish()
}

/// A proof of numbers: the same for the same bits.
pub(super) fn fingerprint_of<'a>(blocks: impl Iterator<Item = &'a [f64]>) -> u64 {
    let mut hasher = DefaultHasher::new();
    for block in blocks {
        hasher.write_usize(block.len());
        block.iter().for_each(|x| hasher.write_u64(x.to_bits()));
    }
    hasher.finish()
}
