//! Simulations on other threads, processes or machines, behind an [`Executor`](crate::execution::Executor).
//!
//! A worker receives a payload once (the model with its files, the logs) and then batches: points of a residual model,
//! or candidates of a population. It answers with numbers. Workers draw no random numbers, so that an answer does not
//! depend on the worker, nor on how often a batch is repeated because a machine was lost. Every answer carries the
//! worker's fingerprint: what it computes at the model's nominal values, which must equal what this process computes,
//! bit by bit.

mod bundle;
mod cache;
mod error;
mod messages;
mod remote_model;
mod remote_simulator;
mod shape;
#[cfg(test)]
mod tests;
mod worker;

pub use error::DistributedError;
pub use remote_model::RemoteModel;
pub use remote_simulator::{RemoteSimulator, RunPayloads, TestComparison};
pub use worker::serve;
