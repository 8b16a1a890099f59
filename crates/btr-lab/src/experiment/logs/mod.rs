//! The logs that an experiment names: found, read, cut at their gaps, and turned into scenarios.

pub(crate) mod batch;
pub(crate) mod index;
pub(crate) mod listed;
pub(crate) mod pieces;
pub(crate) mod rate;
pub(crate) mod read;
pub(crate) mod scenarios;
pub(crate) mod source;
pub(crate) mod start;
