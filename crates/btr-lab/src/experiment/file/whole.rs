//! The whole file.

use super::drive::DriveSection;
use super::logs::LogIndexSection;
use super::parameters::{EffectSection, ParameterSection};
use super::reality::RealitySection;
use super::robot::{ActuatorSection, RobotSection};
use super::simulation::{NoiseSection, SimulationSection};
use btr_core::coevolve::Plan;
use btr_core::distance::DistanceSpec;
use btr_io::Mapping;
use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A whole file.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct File {
    /// What it is called in reports and as the default output folder.
    pub name: String,
    /// Seed of every random number of a run; `--seed` wins.
    #[serde(default)]
    pub seed: u64,
    /// The robot.
    pub robot: RobotSection,
    /// What drives the joints, by joint name or pattern (`*` matches anything); later entries win.
    #[serde(default)]
    pub actuators: IndexMap<String, ActuatorSection>,
    /// Time steps, ground, ball, gravity.
    #[serde(default)]
    pub simulation: SimulationSection,
    /// Noise and quantum of the sensors.
    #[serde(default)]
    pub noise: NoiseSection,
    /// S: the parameters in doubt, by name (`mass@LINK`, `kp@JOINT`, `coulomb_friction.torque@JOINT`, ...).
    #[serde(default)]
    pub parameters: IndexMap<String, ParameterSection>,
    /// The effects that are present.
    #[serde(default)]
    pub effects: Vec<EffectSection>,
    /// Where the channels of logs are found.
    #[serde(default)]
    pub channels: Mapping,
    /// What is known of each log that is named on the command line.
    pub logs: Option<LogIndexSection>,
    /// What the joints are told.
    pub drive: Option<DriveSection>,
    /// f(B): weights of the terms that `btr info` lists.
    #[serde(default)]
    pub fitness: IndexMap<String, f64>,
    /// Where the truth comes from.
    pub reality: Option<RealitySection>,
    /// The Back-to-Reality loop.
    pub coevolve: Option<Plan>,
    /// Distances to identify with once more on the same real tests, for a table beside the plan's own.
    #[serde(default)]
    pub distances: Vec<DistanceSpec>,
}
