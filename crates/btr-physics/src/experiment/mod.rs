//! Experiments: a file becomes a model, a plan and a reality.

mod build;
mod build_drive;
mod build_model;
mod build_reality;
mod enlarged;
mod file;
mod log_source;
mod parse;
mod pieces;
mod plan_error;
mod replays;
mod scenarios;
mod single;
mod start;

pub(crate) use build::told;
pub use build::{Experiment, Robotic, simulations};
pub use enlarged::enlarges;
pub use file::{CommandSection, File, LogIndexSection, LogsSection, NoiseSection, SimulationSection, TwinSection};
pub use log_source::LogSource;
pub use parse::{FileError, Source, nearest, suggestion};
pub(crate) use pieces::timely;
pub use replays::{Checked, Replays, replays};
pub use single::{model, model_driven_by, model_replaying, recorded};
pub use start::starts;
