//! A model or experiment file.

use super::drive::DriveSection;
use super::logs::LogIndexSection;
use super::parameters::{EffectSection, ParameterSection};
use super::reality::RealitySection;
use super::robot::{ActuatorSection, RobotSection};
use super::simulation::{NoiseSection, SimulationSection};
use btr_core::coevolve::Plan;
use btr_core::distance::DistanceSpec;
use btr_io::Mapping;
use btr_physics::inertials::StatedInertials;
use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A model or experiment file.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct File {
    /// Name in reports and of the default output folder.
    pub name: String,
    /// Seed of all random numbers of a run; `--seed` takes precedence.
    #[serde(default)]
    pub seed: u64,
    /// The robot.
    pub robot: RobotSection,
    /// Inertial parameters of links by name, instead of those in the robot's own file. `fit --base-parameters` writes
    /// them.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub links: IndexMap<String, StatedInertials>,
    /// Actuators by joint name or pattern (`*` matches anything); later entries take precedence.
    #[serde(default)]
    pub actuators: IndexMap<String, ActuatorSection>,
    /// Time steps, ground, ball, gravity.
    #[serde(default)]
    pub simulation: SimulationSection,
    /// Noise and quantisation of the sensors.
    #[serde(default)]
    pub noise: NoiseSection,
    /// S: the free parameters by name (`mass@LINK`, `kp@JOINT`, `coulomb_friction.torque@JOINT`, ...).
    #[serde(default)]
    pub parameters: IndexMap<String, ParameterSection>,
    /// The effects that the model has.
    #[serde(default)]
    pub effects: Vec<EffectSection>,
    /// Mapping from the columns of logs to channels.
    #[serde(default)]
    pub channels: Mapping,
    /// Index with properties of the logs that are named on the command line.
    pub logs: Option<LogIndexSection>,
    /// The drive: the commands of the joints.
    pub drive: Option<DriveSection>,
    /// Fitness f(B): weights by term; `btr info` lists the terms.
    #[serde(default)]
    pub fitness: IndexMap<String, f64>,
    /// How real tests are carried out.
    pub reality: Option<RealitySection>,
    /// The Back-to-Reality loop.
    pub coevolve: Option<Plan>,
    /// Further distances with which the identification is repeated on the same real tests, for comparison with the
    /// plan's.
    #[serde(default)]
    pub distances: Vec<DistanceSpec>,
}
