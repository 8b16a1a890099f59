//! Initial states of logs: their changes, standing starts, and windows for multiple shooting.

pub(super) mod moved;
mod standing;
pub(super) mod windows;
