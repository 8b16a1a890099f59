//! The format of an answer, and how it is checked before its numbers are used.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::hash::{DefaultHasher, Hasher};

/// Largest number of rollouts or candidates in one batch; batches are smaller where some workers would otherwise be
/// idle.
pub(crate) const BATCH_SIZE: usize = 64;

/// A worker's answer to a batch, with the fingerprint of its simulations.
#[derive(Serialize, Deserialize)]
pub(crate) struct Answer<T> {
    pub(crate) fingerprint: u64,
    /// Hash of the batch that it answers.
    pub(crate) batch: u64,
    pub(crate) results: Vec<T>,
}

/// Why a batch or its answer cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExchangeError {
    /// The batch cannot be encoded.
    #[error(transparent)]
    Encode(#[from] postcard::Error),
    /// The answer cannot be decoded.
    #[error("a worker's answer cannot be decoded: {0}")]
    Decode(#[source] postcard::Error),
    /// The worker simulates the model differently.
    #[error(
        "a worker simulates the model differently than this process: its files may differ (an index of logs?), or its build of btr"
    )]
    Fingerprint,
    /// The answer belongs to another batch.
    #[error("a worker's answer belongs to another batch")]
    OtherBatch,
    /// A result that was computed again in this process is another one.
    #[error(
        "a worker gave another result than this machine for {task}: {difference}. It may have another kind of processor, \
        another build of btr, or faulty memory: use workers of one kind with the same btr, and begin this work again"
    )]
    Different {
        /// Which simulation the result is of.
        task: String,
        /// What differs.
        difference: String,
    },
}

impl<T: DeserializeOwned> Answer<T> {
    /// The results, if the fingerprints agree and there are `count` results for this batch.
    pub(super) fn read(bytes: &[u8], fingerprint: u64, batch: &[u8], count: usize) -> Result<Vec<T>, ExchangeError> {
        let answer: Answer<T> = postcard::from_bytes(bytes).map_err(ExchangeError::Decode)?;
        if answer.fingerprint != fingerprint {
            return Err(ExchangeError::Fingerprint);
        }
        if answer.batch != hash_of(batch) || answer.results.len() != count {
            return Err(ExchangeError::OtherBatch);
        }
        Ok(answer.results)
    }
}

/// A hash of bytes.
pub(crate) fn hash_of(bytes: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    hasher.write(bytes);
    hasher.finish()
}

/// A fingerprint of numbers: equal for equal bits.
pub(crate) fn fingerprint_of<'a>(blocks: impl Iterator<Item = &'a [f64]>) -> u64 {
    let mut hasher = DefaultHasher::new();
    for block in blocks {
        hasher.write_usize(block.len());
        block.iter().for_each(|x| hasher.write_u64(x.to_bits()));
    }
    hasher.finish()
}
