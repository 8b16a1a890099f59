//! Verbs that write a model file and simulate nothing.

pub(crate) mod add;
pub(crate) mod new;
