//! Experiments: a file becomes a model, a plan and a reality.

mod build;
mod file;
mod parse;
mod scenarios;

pub use build::Experiment;
pub use file::{CommandSection, File, LogsSection, NoiseSection, TwinSection};
pub use parse::{FileError, Source, nearest};
