//! The execution context: number of threads, cancellation, executor.
//!
//! Cancellation is a value. Rollouts that have not begun end with
//! [`WorldError::Cancelled`](btr_core::world::WorldError), and the caller of the work takes the cause from the context.

use super::exchange::{Answer, ExchangeError, hash_of};
use super::executor::{Cause, Executor, Payload};
use super::spot_check::{Expected, Numbers, chosen, difference};
use btr_core::world::Cancelled;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Where work is done and whether it was cancelled.
#[derive(Default)]
pub struct ExecutionContext {
    threads: Option<usize>,
    executor: Option<Box<dyn Executor>>,
    /// Whether a result of a worker was computed again.
    checked: AtomicBool,
    cancelled: AtomicBool,
    interrupted: AtomicBool,
    robot: Mutex<()>,
    cause: Mutex<Option<Cause>>,
}

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

    /// Cancels the work: it soon ends with [`Cancelled`] in place of a result.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Cancels the work for a cause; of several, the first is kept.
    pub fn fail(&self, cause: Cause) {
        self.cause.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(cause);
        self.cancel();
    }

    /// Takes the cause that the work was cancelled for; `None` where it was not cancelled, or on request.
    pub fn take_cause(&self) -> Option<Cause> {
        self.cause.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// Whether the work was cancelled.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Asks the work to end in an orderly way: simulations finish their step, a real test is ended.
    pub fn interrupt(&self) {
        self.interrupted.store(true, Ordering::Relaxed);
    }

    /// Whether the work was asked to end or cancelled.
    pub fn is_interrupted(&self) -> bool {
        self.interrupted.load(Ordering::Relaxed) || self.is_cancelled()
    }

    /// Waits until no program moves the robot; while the guard is held, none begins to. To be held by who moves the
    /// robot, and by who ends the process.
    pub fn robot(&self) -> MutexGuard<'_, ()> {
        self.robot.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Passes on a cancellation.
    ///
    /// # Errors
    /// Cancelled work.
    pub fn check_cancelled(&self) -> Result<(), Cancelled> {
        if self.is_cancelled() { Err(Cancelled) } else { Ok(()) }
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

    /// A worker's results for a batch, checked against what is expected of them; `None` without an executor.
    ///
    /// # Errors
    /// Cancelled work. A failure of the executor or the worker cancels it, with the executor's own cause or with an
    /// [`ExchangeError`].
    pub(crate) fn dispatch<T: DeserializeOwned + Serialize + Numbers>(
        &self,
        payloads: &[Arc<Payload>],
        batch: &impl Serialize,
        expected: &Expected<T>,
    ) -> Result<Option<Vec<T>>, Cancelled> {
        self.check_cancelled()?;
        let Some(executor) = &self.executor else { return Ok(None) };
        let as_cause = |error: ExchangeError| -> Cause { Box::new(error) };
        let exchange = || {
            let batch = postcard::to_allocvec(batch).map_err(|e| as_cause(e.into()))?;
            let answer = executor.work(payloads, &batch)?;
            let results = Answer::read(&answer, (expected.fingerprint)(), &batch, expected.count).map_err(as_cause)?;
            self.check_some(executor.as_ref(), hash_of(&batch), expected, &results).map_err(as_cause)?;
            Ok(results)
        };
        let results = exchange().map_err(|cause| {
            self.fail(cause);
            Cancelled
        })?;
        self.check_cancelled()?;
        Ok(Some(results))
    }

    /// Computes a few results of a batch again; of the first batch, at least one.
    fn check_some<T: Serialize + Numbers>(
        &self,
        executor: &dyn Executor,
        batch: u64,
        expected: &Expected<T>,
        results: &[T],
    ) -> Result<(), ExchangeError> {
        let Some(one_in) = executor.check_one_in() else { return Ok(()) };
        let batch = if self.checked.swap(true, Ordering::Relaxed) { batch } else { 0 };
        for k in chosen(batch, results.len(), one_in) {
            let ours = (expected.again)(k);
            // What was computed while a law's function failed says nothing.
            let differs = if self.is_cancelled() { None } else { difference(&results[k], &ours) };
            if let Some(difference) = differs {
                return Err(ExchangeError::Different { task: (expected.task)(k), difference });
            }
        }
        Ok(())
    }
}
