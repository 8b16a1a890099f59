//! The messages between this process and its workers.

use super::bundle::Bundle;
use super::error::{DistributedError, SimulationError, VERSION};
use crate::execution::{Payload, hash_of};
use crate::experiment::RealitySource;
use btr_core::log::Log;
use btr_core::world::{Behaviour, Output};
use btr_identify::residual_model::Derivation;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Encodes the content of a payload, with the version.
pub(super) fn encode(content: &PayloadContent) -> Result<Payload, DistributedError> {
    let bytes = postcard::to_allocvec(&(VERSION, content))?;
    Ok(Payload { key: hash_of(&bytes), bytes })
}

/// Decodes the content of a payload of the same version.
pub(super) fn decode(bytes: &[u8]) -> Result<PayloadContent, DistributedError> {
    let other_version = |theirs: &str| DistributedError::Version { theirs: theirs.to_owned() };
    let (theirs, rest): (String, &[u8]) =
        postcard::take_from_bytes(bytes).map_err(|_| other_version("of another version"))?;
    if theirs != VERSION {
        return Err(other_version(&theirs));
    }
    Ok(postcard::from_bytes(rest)?)
}

/// The content of a payload.
#[derive(Serialize, Deserialize)]
pub(super) enum PayloadContent {
    /// An identification problem: a model with its logs.
    Problem { model: Bundle, learn: Vec<(PathBuf, Log)>, held_out: Vec<(PathBuf, Log)> },
    /// An experiment's simulations, the distance to real tests (as JSON, since postcard cannot decode untagged enums),
    /// and what answers real tests.
    Experiment { experiment: Bundle, distance: String, reality: RealitySource },
    /// The robot's behaviour in a real test.
    Test(Behaviour),
}

/// A sparse point: the coordinates that are not 0.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Sparse {
    length: u32,
    entries: Vec<(u32, f64)>,
}

impl Sparse {
    pub(super) fn of(point: &[f64]) -> Self {
        let entries = point.iter().enumerate().filter(|(_, x)| x.to_bits() != 0);
        Sparse { length: point.len() as u32, entries: entries.map(|(k, x)| (k as u32, *x)).collect() }
    }

    /// Number of coordinates.
    pub(super) fn len(&self) -> usize {
        self.length as usize
    }

    pub(super) fn dense(&self) -> Vec<f64> {
        let mut point = vec![0.0; self.length as usize];
        for &(k, x) in &self.entries {
            if let Some(slot) = point.get_mut(k as usize) {
                *slot = x;
            }
        }
        point
    }
}

/// A rollout of a residual model.
#[derive(Serialize, Deserialize)]
pub(super) struct RolloutMessage {
    pub(super) u: Sparse,
    pub(super) log: usize,
    pub(super) moved: Sparse,
}

/// Rollouts of a residual model.
#[derive(Serialize, Deserialize)]
pub(super) struct Rollouts {
    pub(super) derived: Vec<Derivation>,
    pub(super) halvings: u8,
    pub(super) requests: Vec<RolloutMessage>,
}

/// Residuals, or why the simulation failed.
pub(super) type ResidualMessage = Result<Vec<f64>, SimulationError>;

/// A candidate of a population.
#[derive(Serialize, Deserialize)]
pub(super) struct Candidate {
    pub(super) s: Vec<f64>,
    pub(super) c: Vec<f64>,
    pub(super) scenario: usize,
    pub(super) output: OutputOrder,
}

/// Which output of a candidate is requested.
#[derive(Serialize, Deserialize)]
pub(super) enum OutputOrder {
    Behaviour,
    Fitness,
    /// Index of the test among the payloads, and whether residuals are requested.
    Distance {
        test: usize,
        squares: bool,
    },
}

/// The output of a candidate, or why its simulation failed.
pub(super) type CandidateResult = Result<Output, SimulationError>;

/// A batch of either kind.
#[derive(Serialize, Deserialize)]
pub(super) enum Batch {
    Rollouts(Rollouts),
    Population(Vec<Candidate>),
}
