//! From a file to a model, a plan and a reality; one file per section.

mod builder;
mod drive;
mod effects;
mod parameters;
mod plan;
mod reality;
mod robot;
mod setup;

pub(crate) use builder::Builder;
