//! The executor: whatever hands out batches to threads, processes or machines.

use super::spot_check::CHECKED_ONE_IN;
use std::error::Error;
use std::num::NonZeroUsize;
use std::sync::Arc;

/// Why work was cancelled, where it was not on request: the error of an executor, a listener or a law's function.
pub type Cause = Box<dyn Error + Send + Sync>;

/// What a worker receives once and may cache under its key: a model with its logs, an experiment, or a real test.
#[derive(Debug)]
pub struct Payload {
    /// Hash of the content.
    pub key: u64,
    /// The content.
    pub bytes: Vec<u8>,
}

/// Hands out batches.
pub trait Executor: Send + Sync {
    /// Number of batches that are worked on at once.
    fn workers(&self) -> usize;
    /// The functions that the model's laws name, packed for the caller of [`serve`](crate::distributed::serve); empty
    /// without any.
    fn functions(&self) -> &[u8] {
        &[]
    }
    /// One in so many results is computed again in this process and compared with the worker's; `None` checks none.
    fn check_one_in(&self) -> Option<NonZeroUsize> {
        Some(CHECKED_ONE_IN)
    }
    /// Has [`serve`](crate::distributed::serve) called by a worker, and waits for the answer. Called from as many
    /// threads at once as there are workers.
    ///
    /// # Errors
    /// Whatever keeps the answer from coming: all work is cancelled for this cause.
    fn work(&self, payloads: &[Arc<Payload>], batch: &[u8]) -> Result<Vec<u8>, Cause>;
}
