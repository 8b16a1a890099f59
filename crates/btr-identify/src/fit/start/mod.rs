//! Start states of logs: a search for the best ones, and the residual's response to other ones.

mod search;
mod states;

pub(super) use search::MOVED;
pub use search::nearest_starts;
pub(super) use states::StartStates;
