//! Experiments: a file becomes a model, a plan and a reality.

pub mod adapt;
mod build;
mod enlarged;
mod file;
pub(crate) mod logs;
mod parse;
mod plan_error;

pub(crate) use build::told;
pub use build::{Experiment, RobotFunction, simulations};
pub use enlarged::enlarges;
pub use file::{CommandSection, File, LogIndexSection, LogsSection, NoiseSection, SimulationSection, TwinSection};
pub(crate) use logs::pieces::timely;
pub use logs::replays::{CheckedLog, Replays, replays};
pub use logs::single::{model, model_driven_by, model_replaying, recorded};
pub use logs::source::LogSource;
pub use logs::start::starts;
pub use parse::{FileError, Source, nearest, suggestion};
