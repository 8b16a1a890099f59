//! What stands in a model or experiment file, as it is written. A model file is an experiment file without the sections
//! that steer a run.

use btr_core::coevolve::Plan;
use btr_core::distance::DistanceSpec;
use btr_core::space::Scale;
use btr_io::Mapping;
use btr_physics::effects::FormulaTarget;
use btr_physics::robot::Base;
use btr_physics::setup::EngineName;
use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

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

/// A built-in robot, a URDF, or a pendulum.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RobotSection {
    /// `ant`, `nao` or `pendulum`.
    pub builtin: Option<String>,
    /// A URDF, relative to this file.
    pub urdf: Option<PathBuf>,
    /// Bolted down or free; built-in robots know it themselves.
    #[serde(default)]
    pub base: Option<Base>,
    /// Where the root starts above the ground, in m.
    pub height_m: Option<f64>,
    /// Pendulum: mass of the bob in kg.
    pub mass_kg: Option<f64>,
    /// Pendulum: from the axis to the bob, in m.
    pub length_m: Option<f64>,
}

/// An actuator; see `btr info`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum ActuatorSection {
    /// Nothing drives the joint.
    Passive,
    /// PID on the position.
    Position {
        /// N·m/rad.
        kp: f64,
        /// N·m/(rad·s).
        #[serde(default)]
        ki: f64,
        /// N·m·s/rad.
        #[serde(default)]
        kd: f64,
        /// N·m.
        #[serde(default = "unlimited")]
        max_torque: f64,
        /// Time between two instants at which a digital servo reads, computes and from then on holds, in s; it works in
        /// continuous time unless this is given.
        sample_s: Option<f64>,
        /// With `sample_s`: its velocity is the difference of two readings that are so many instants apart.
        #[serde(default = "one_period")]
        velocity_over: u32,
    },
    /// The command is a torque.
    Torque {
        /// N·m.
        #[serde(default = "unlimited")]
        max_torque: f64,
    },
    /// A DC motor; with `gain` the command is a position, else a voltage.
    Voltage {
        /// N·m/A.
        kt: f64,
        /// Ohm.
        resistance: f64,
        /// Duty per rad of error.
        gain: Option<f64>,
        /// Largest duty.
        #[serde(default = "one")]
        max_duty: f64,
        /// V.
        #[serde(default)]
        supply: f64,
        /// The same as for `position`, for the position loop that `gain` makes.
        sample_s: Option<f64>,
    },
    /// The joint follows its measured motion (its command where none was measured); the torque that this takes is compared
    /// with the measured one, both smoothed alike.
    Prescribed {
        /// Where a digital servo worked out the measured torque: the time between two instants at which it did, in s. Each is
        /// logged at its instant and held until the next.
        sample_s: Option<f64>,
    },
}

fn unlimited() -> f64 {
    f64::INFINITY
}

fn one_period() -> u32 {
    1
}

fn one() -> f64 {
    1.0
}

fn half() -> f64 {
    0.5
}

/// Time steps, ground, ball, gravity.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SimulationSection {
    /// Time between two references, in s. Unless given: the time between two samples of the recorded logs; without logs the
    /// paper's 0.055 s. Commands of logs that change with every sample are taken as they come, at most once a step.
    pub control_s: Option<f64>,
    /// Physics steps between two references; the step is `control_s / steps_per_control`.
    pub steps_per_control: u32,
    /// Whether references are interpolated between control ticks; else they are held.
    pub interpolate: bool,
    /// T_e in s; with recorded logs each log's own duration counts.
    pub duration_s: f64,
    /// Physics steps between two samples of the log.
    pub sample_every: u32,
    /// Coulomb coefficient of the ground; no ground for robots with a fixed base.
    pub ground_friction: f64,
    /// m/s², along world z.
    pub gravity: f64,
    /// A ball on the ground.
    pub ball: Option<BallSection>,
    /// What computes the motion.
    pub engine: EngineName,
}

impl Default for SimulationSection {
    fn default() -> Self {
        SimulationSection {
            control_s: None,
            steps_per_control: 7,
            interpolate: false,
            duration_s: 2.0,
            sample_every: 1,
            ground_friction: 0.8,
            gravity: -9.81,
            ball: None,
            engine: EngineName::Auto,
        }
    }
}

/// A ball on the ground.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BallSection {
    /// Position of its centre over the ground at the start, x and y in m.
    pub position_m: [f64; 2],
    /// m.
    pub radius_m: f64,
    /// kg.
    pub mass_kg: f64,
    /// Coulomb coefficient.
    #[serde(default = "half")]
    pub friction: f64,
    /// Speed kept in a central impact.
    #[serde(default = "half")]
    pub restitution: f64,
    /// Rate at which its spin decays, in 1/s.
    #[serde(default = "half")]
    pub rolling_damping_per_s: f64,
}

/// Standard deviations of white noise, and steps of quantisation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NoiseSection {
    /// Joint encoders, in rad.
    pub position_rad: f64,
    /// Step of the joint encoders, in rad.
    pub position_quantum_rad: f64,
    /// Joint velocities, in rad/s.
    pub velocity_rad_s: f64,
    /// Joint torques, in N·m.
    pub torque_n_m: f64,
    /// Gyroscope, in rad/s.
    pub gyro_rad_s: f64,
    /// Accelerometer, in m/s².
    pub acceleration_m_s2: f64,
    /// Foot force sensors, in N.
    pub force_n: f64,
}

/// A parameter in doubt: its bounds and what is believed now.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ParameterSection {
    /// Smallest and largest value, in the parameter's unit.
    pub bounds: Option<[f64; 2]>,
    /// The same as factors of the robot's own value.
    pub relative: Option<[f64; 2]>,
    /// Linear or logarithmic.
    #[serde(default)]
    pub scale: ScaleName,
    /// What is believed now; the robot's own value unless given. A fitted model carries its estimate here.
    pub value: Option<f64>,
}

/// Linear or logarithmic.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ScaleName {
    /// Equal steps are equal differences.
    #[default]
    Linear,
    /// Equal steps are equal ratios.
    Log,
}

impl From<ScaleName> for Scale {
    fn from(name: ScaleName) -> Self {
        match name {
            ScaleName::Linear => Scale::Linear,
            ScaleName::Log => Scale::Log,
        }
    }
}

/// An effect with its parameters.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct EffectSection {
    /// Its name; `btr effects` lists them.
    pub effect: String,
    /// Joint, link, `base`, `*` or a pattern.
    #[serde(default = "everywhere")]
    pub site: String,
    /// Formula: what the law gives.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub on: Option<FormulaTarget>,
    /// Formula: an expression over `q`, `dq`, `ddq`, `cmd`, `tau`, `t` and its parameters, or the name of a function
    /// that the program brings along (`python:slip`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub law: Option<String>,
    /// Its parameters by name; those left out have their off value.
    #[serde(flatten)]
    pub values: IndexMap<String, f64>,
}

fn everywhere() -> String {
    "*".to_owned()
}

/// What the joints are told, and which numbers of it are searched.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DriveSection {
    /// `sine`, `nao_walk`, `nao_kick`, `hold`, `policy`, or `replay` (the command channels of `log`).
    pub kind: String,
    /// Sine, and the clock of a policy: angular frequency in rad/s.
    pub omega_rad_s: Option<f64>,
    /// Policy: the kind of the drive that it corrects; `hold` if not stated.
    pub around: Option<String>,
    /// Policy: what it goes by, of `tilt`, `gyro`, `positions`, `velocities`, `feet` and `clock`; `tilt` and `gyro` if not stated.
    pub sensors: Option<Vec<String>>,
    /// Policy: the joints that it corrects, as a pattern; all if not stated.
    pub joints: Option<String>,
    /// Policy: hidden units. It is linear without them.
    pub hidden: Option<usize>,
    /// Replay: the log, relative to this file.
    pub log: Option<PathBuf>,
    /// Fixed values by name; parameters left out have their nominal value.
    #[serde(default)]
    pub set: IndexMap<String, f64>,
    /// C: bounds by parameter name; `search = "all"` takes every parameter with its own bounds.
    #[serde(default)]
    pub search: SearchedSection,
    /// Whether the search starts from the drive's nominal values (c_0) or from random ones.
    #[serde(default)]
    pub start_from_nominal: bool,
}

/// Which parameters of a drive make up C.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected \"all\", \"none\", a list of names, or bounds by name: { NAME = [min, max] }")]
pub enum SearchedSection {
    /// `all` or `none`.
    Word(String),
    /// Some, with their own bounds.
    Names(Vec<String>),
    /// Some, with these bounds.
    Bounds(IndexMap<String, [f64; 2]>),
}

impl Default for SearchedSection {
    fn default() -> Self {
        SearchedSection::Word("none".to_owned())
    }
}

/// Where the truth comes from.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum RealitySection {
    /// A simulation that nobody looks into before the end.
    Twin(TwinSection),
    /// What a robot did on other days.
    Logs(LogsSection),
    /// A program that runs one test.
    Command(CommandSection),
    /// A person at the robot: the run stops after writing what is to be tried, and goes on with `--resume`.
    Manual {},
}

/// A hidden twin.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TwinSection {
    /// Its parameters: `nominal`, `random` (drawn from the seed within S), or values by name (the others nominal).
    pub parameters: TwinParameters,
    /// With `random`: the share of the bounds, around their middle, that is drawn from.
    pub spread: Option<f64>,
    /// Effects that the model does not have.
    pub effects: Vec<EffectSection>,
    /// Finer physics than the model's: steps between two references.
    pub steps_per_control: Option<u32>,
    /// Its sensors' noise.
    pub noise: NoiseSection,
    /// How it changes during the run, in this order.
    pub drift: Vec<DriftSection>,
}

/// A change of the twin: from then on it is another robot.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DriftSection {
    /// Number of the first real test of the changed robot, from 0.
    pub test: usize,
    /// Factors on parameters of S, by name.
    pub times: IndexMap<String, f64>,
    /// Effects that it has besides from then on.
    pub effects: Vec<EffectSection>,
}

/// How the twin's parameters are chosen.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected \"nominal\", \"random\", or values by name: { NAME = value }")]
pub enum TwinParameters {
    /// `nominal` or `random`.
    Word(String),
    /// Values by name, in the units of S.
    Values(IndexMap<String, f64>),
}

impl Default for TwinParameters {
    fn default() -> Self {
        TwinParameters::Word("random".to_owned())
    }
}

/// Recorded logs.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LogsSection {
    /// The logs, relative to this file.
    #[serde(default)]
    pub files: Vec<PathBuf>,
    /// Logs to judge on that the search never sees.
    #[serde(default)]
    pub held_out: Vec<PathBuf>,
    /// A table with one log per row (column `file`) and whatever else is known of each.
    pub index: Option<PathBuf>,
    /// Rows of the table to learn from: column = value, or a list of values.
    #[serde(default)]
    pub learn: IndexMap<String, Choice>,
    /// Rows of the table to judge on.
    #[serde(default)]
    pub judge: IndexMap<String, Choice>,
    /// Parameters that a column sets for its log: `"gain@motor" = { column = "kp", factor = 0.003 }`.
    #[serde(default)]
    pub columns: IndexMap<String, ColumnSection>,
}

/// A table with one log per row, for logs that are named on the command line.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LogIndexSection {
    /// The table (CSV), relative to this file: a column `file`, and whatever else is known of each log.
    pub index: PathBuf,
    /// Parameters that a column sets for its log: `"mass@bob" = { column = "mass" }`.
    #[serde(default)]
    pub columns: IndexMap<String, ColumnSection>,
}

/// One value or several.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a text, a number, or a list of either")]
pub enum Choice {
    /// A text.
    Text(String),
    /// A number.
    Number(f64),
    /// Any of these texts.
    Texts(Vec<String>),
    /// Any of these numbers.
    Numbers(Vec<f64>),
}

/// A column of the index and what to multiply it with.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ColumnSection {
    /// Its name in the table's first line.
    pub column: String,
    /// From the column's unit to the parameter's.
    #[serde(default = "one")]
    pub factor: f64,
}

/// A program that runs one test.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CommandSection {
    /// The program and its arguments; `{trial}` stands for the file with the controller, `{references}` for the CSV of joint
    /// references, `{log}` for the file to write (`.csv` or `.mcap`).
    pub run: Vec<String>,
    /// Ending of the log it writes.
    #[serde(default = "csv")]
    pub log: String,
    /// After so many seconds a try is given up.
    pub timeout_s: f64,
    /// How often a failed try is repeated.
    #[serde(default)]
    pub retries: u32,
}

fn csv() -> String {
    "csv".to_owned()
}
