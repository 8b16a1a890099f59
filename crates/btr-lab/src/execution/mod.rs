//! How work is done: on how many threads, whether it was cancelled, and the executor that hands out batches to workers.

mod context;
mod exchange;
mod executor;
mod spot_check;

pub use context::{ExecutionContext, ThreadError};
pub use exchange::ExchangeError;
pub(crate) use exchange::{Answer, BATCH_SIZE, fingerprint_of, hash_of};
pub use executor::{Cause, Executor, Payload};
pub use spot_check::CHECKED_ONE_IN;
pub(crate) use spot_check::{Expected, Numbers};
