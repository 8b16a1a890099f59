//! One file per verb.

pub(crate) mod check;
pub(crate) mod coevolve;
pub(crate) mod common;
pub(crate) mod compare;
pub(crate) mod convert;
pub(crate) mod diagnose;
pub(crate) mod effects;
pub(crate) mod fit;
pub(crate) mod generated;
pub(crate) mod info;
pub(crate) mod model_files;
pub(crate) mod simulate;
