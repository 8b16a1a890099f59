//! Verbs that write models, or the files of robots. The studio does so from its page.

pub(crate) mod add;
pub(crate) mod export;
pub(crate) mod new;
pub(crate) mod studio;
