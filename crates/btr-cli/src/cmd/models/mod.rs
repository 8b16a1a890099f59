//! Verbs that write models, or the files of robots.

pub(crate) mod add;
pub(crate) mod export;
pub(crate) mod new;
