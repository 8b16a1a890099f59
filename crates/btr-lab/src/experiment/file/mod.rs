//! The sections of a model or experiment file, as serde reads them. A model file is an experiment file without the
//! sections that control a run. The doc comments are the descriptions in the JSON schema.

mod drive;
mod logs;
mod parameters;
mod reality;
mod robot;
mod simulation;
mod whole;

pub use drive::DriveSection;
pub(crate) use drive::SearchedSection;
pub(crate) use logs::{Choice, ColumnSection};
pub use logs::{LogIndexSection, LogsSection};
pub(crate) use parameters::{EffectSection, ParameterSection};
pub use reality::{CommandSection, RealitySource, TwinSection};
pub(crate) use reality::{DriftSection, RealitySection, TwinParameters};
pub use robot::ActuatorSection;
pub(crate) use simulation::USUAL_STEPS;
pub use simulation::{NoiseSection, SimulationSection};
pub use whole::File;
