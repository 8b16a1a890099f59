//! Where a log begins: the start states that a model prefers, and what another start state would do to the residual.

mod search;
mod states;

pub(super) use search::MOVED;
pub use search::nearest_starts;
pub(super) use states::StartStates;
