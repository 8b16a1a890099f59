//! The execution context: number of threads, cancellation flag, executor.

use super::exchange::{Answer, ExchangeError};
use super::executor::{Executor, Payload};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::any::Any;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Where work is done and whether it was cancelled.
#[derive(Default)]
pub struct ExecutionContext {
    threads: Option<usize>,
    executor: Option<Box<dyn Executor>>,
    cancelled: AtomicBool,
}

/// What cancelled work unwinds with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cancelled;

/// More threads than the system allows.
#[derive(Debug, thiserror::Error)]
#[error("there cannot be {threads} threads: {source}")]
pub struct ThreadError {
    /// Number of threads.
    pub threads: usize,
    /// Why they cannot be started.
    pub source: rayon::ThreadPoolBuildError,
}

impl ExecutionContext {
    /// Work that an executor hands out to its workers.
    pub fn with_executor(executor: Box<dyn Executor>) -> Self {
        ExecutionContext { threads: Some(executor.workers()), executor: Some(executor), ..ExecutionContext::default() }
    }

    /// Work in this process, on this number of threads.
    pub fn local(threads: usize) -> Self {
        ExecutionContext { threads: Some(threads), ..ExecutionContext::default() }
    }

    /// Cancels the work: it unwinds soon with [`Cancelled`], without a result.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether the work was cancelled.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Unwinds with [`Cancelled`] if the work was cancelled.
    pub fn check_cancelled(&self) {
        if self.is_cancelled() {
            resume_unwind(Box::new(Cancelled));
        }
    }

    /// The executor; none where all work is done in this process.
    pub(crate) fn executor(&self) -> Option<&dyn Executor> {
        self.executor.as_deref()
    }

    /// Does all work on the context's threads: as many as there are workers, each of which waits for one batch at a
    /// time.
    ///
    /// # Errors
    /// More threads than the system allows.
    pub fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> Result<T, ThreadError> {
        let Some(threads) = self.threads else { return Ok(work()) };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.max(1)).build();
        Ok(pool.map_err(|source| ThreadError { threads, source })?.install(work))
    }

    /// A worker's `count` results for a batch, checked against the fingerprint; `None` without an executor. Where the
    /// executor or the worker fails, this unwinds: with the executor's own cause, or with an [`ExchangeError`].
    pub(crate) fn dispatch<T: DeserializeOwned>(
        &self,
        payloads: &[Arc<Payload>],
        batch: &impl Serialize,
        count: usize,
        fingerprint: impl FnOnce() -> u64,
    ) -> Option<Vec<T>> {
        self.check_cancelled();
        let executor = self.executor.as_ref()?;
        let as_cause = |error: ExchangeError| -> Box<dyn Any + Send> { Box::new(error) };
        let exchange = || {
            let batch = postcard::to_allocvec(batch).map_err(|e| as_cause(e.into()))?;
            let answer = executor.work(payloads, &batch)?;
            Answer::read(&answer, fingerprint(), &batch, count).map_err(as_cause)
        };
        let results = exchange().unwrap_or_else(|cause| resume_unwind(cause));
        self.check_cancelled();
        Some(results)
    }
}
