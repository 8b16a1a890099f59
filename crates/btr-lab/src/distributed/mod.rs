//! Simulations that somebody else works out: other threads, processes or machines, behind whatever hands out calls there.
//!
//! A worker is told once what it works on (a [`Payload`]: the model with its files, the logs) and then gets batches: points of
//! a family, or candidates of a population. It answers with numbers. No random number is drawn there, so that an answer is
//! the same whoever gives it, and however often it is asked for again because a machine was lost. Every answer carries the
//! worker's proof: what it computes at the model's own values, which must be what is computed here, bit by bit.

mod bundle;
mod cache;
mod messages;
mod remote_model;
mod remote_simulator;
mod worker;

pub use messages::Payload;
pub use remote_model::RemoteModel;
pub use remote_simulator::{RemoteSimulator, RunPayloads};
pub use worker::serve;

use messages::{Answer, Batch};
use serde::de::DeserializeOwned;
use std::any::Any;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// How many rollouts or candidates go out in one message at most; fewer where else some workers would have nothing to do.
const MOST_AT_ONCE: usize = 64;

/// Hands out batches.
pub trait Executor: Send + Sync {
    /// How many batches are worked on at once.
    fn workers(&self) -> usize;
    /// The functions that the model's laws name, as whoever calls [`serve`] can read them; nothing where it has none.
    fn functions(&self) -> &[u8] {
        &[]
    }
    /// Has [`serve`] called elsewhere, and waits for the answer. Called from as many threads at once as there are workers.
    ///
    /// # Errors
    /// Whatever keeps the answer from coming: all work ends with it.
    fn work(&self, payloads: &[Arc<Payload>], batch: &[u8]) -> Result<Vec<u8>, Box<dyn Any + Send>>;
}

/// How long work is done, and by whom: it can be stopped, and it can be handed out.
#[derive(Default)]
pub struct ExecutionContext {
    threads: Option<usize>,
    executor: Option<Box<dyn Executor>>,
    stopped: AtomicBool,
}

/// What work unwinds with that was stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stopped;

impl ExecutionContext {
    /// Work for somebody else.
    pub fn elsewhere(executor: Box<dyn Executor>) -> Self {
        ExecutionContext { threads: Some(executor.workers()), executor: Some(executor), ..ExecutionContext::default() }
    }

    /// Work here, on so many threads.
    pub fn here(threads: usize) -> Self {
        ExecutionContext { threads: Some(threads), ..ExecutionContext::default() }
    }

    /// Ends the work soon: it unwinds with [`Stopped`], and nothing comes of it.
    pub fn stop(&self) {
        self.stopped.store(true, Ordering::Relaxed);
    }

    /// Whether it was stopped.
    pub fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    /// Does all work on its threads: as many as there are workers, each of which waits for one batch at a time.
    ///
    /// # Errors
    /// More threads than the system allows.
    pub fn during<T: Send>(&self, work: impl FnOnce() -> T + Send) -> Result<T, String> {
        let Some(threads) = self.threads else { return Ok(work()) };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.max(1)).build();
        Ok(pool.map_err(|e| format!("there cannot be {threads} threads: {e}"))?.install(work))
    }

    /// Unwinds with [`Stopped`] where the work was stopped.
    pub fn check_cancelled(&self) {
        if self.is_stopped() {
            resume_unwind(Box::new(Stopped));
        }
    }

    /// The answer to a batch for so many, from a worker that has proved itself; `None` where there is nobody to ask.
    fn ask<T: DeserializeOwned>(
        &self,
        payloads: &[Arc<Payload>],
        batch: &Batch,
        many: usize,
        fingerprint: impl FnOnce() -> u64,
    ) -> Option<Vec<T>> {
        self.check_cancelled();
        let executor = self.executor.as_ref()?;
        let senseless = |why: String| -> Box<dyn Any + Send> { Box::new(why) };
        let asked = || {
            let batch = postcard::to_allocvec(batch).map_err(|e| senseless(e.to_string()))?;
            let answer = executor.work(payloads, &batch)?;
            Answer::read(&answer, fingerprint(), &batch, many).map_err(senseless)
        };
        let answer = asked().unwrap_or_else(|why| resume_unwind(why));
        self.check_cancelled();
        Some(answer)
    }
}
