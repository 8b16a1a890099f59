//! The logs that an experiment names: found, read, cut at their gaps, judged, and put beside scenarios.

pub(crate) mod pieces;
pub(crate) mod quality;
pub(crate) mod replays;
pub(crate) mod scenarios;
pub(crate) mod single;
pub(crate) mod source;
pub(crate) mod start;
