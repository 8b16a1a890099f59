//! Experiments: a file becomes a model, a plan and a reality.

mod build;
mod file;
mod loaded;
mod logs;
mod models;
mod real_tests;
mod replays;
mod source;
mod stated;

pub(crate) use file::USUAL_STEPS;
pub use file::{
    ActuatorSection, CommandSection, DriveSection, File, LogIndexSection, LogsSection, NoiseSection, RealitySource,
    SimulationSection, TwinSection,
};
pub use loaded::Experiment;
pub use logs::batch::{DamagedLogs, LeftOutLog};
pub use logs::source::{LogSource, ReadLog, Recordings};
pub use logs::start::starts;
pub use models::{mesh_warnings, model, model_driven_by, model_replaying, simulations};
pub(crate) use replays::LogPlace;
pub use replays::{CheckedLog, Replays, replays, replays_of};
pub use source::{FileError, Source};
