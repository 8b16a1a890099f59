//! Channels: names and units, btr's own and those of foreign logs, and the series that become a log.

pub(crate) mod foreign;
pub(crate) mod mapping;
pub(crate) mod names;
pub(crate) mod renamed;
pub(crate) mod series;
