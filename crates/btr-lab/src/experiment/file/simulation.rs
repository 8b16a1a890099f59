//! `[simulation]` and `[noise]`.

use btr_core::limits::MOST_STEPS;
use btr_physics::robot::Robot;
use btr_physics::setup::EngineName;
use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Steps per control period, as in the paper...
pub(crate) const USUAL_STEPS: u32 = 7;
/// ... unless they would be shorter than this for logs that are sampled fast: where the error of a step shows, fits and
/// diagnoses halve it.
const LONG_STEP_S: f64 = 0.0025;

/// Time steps, ground, ball, gravity.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SimulationSection {
    /// Time between two references, in s. Default: the sampling period of the recorded logs, or the paper's 0.055 s
    /// without logs. Commands of logs that change with every sample are applied at their own rate, at most once per
    /// step.
    pub control_s: Option<f64>,
    /// Physics steps between two references; the step is `control_s / steps_per_control`. Default: 7; without
    /// `control_s`, fewer for fast logs, so that a step lasts 2.5 ms if 7 would be shorter; 1 where the motion of all
    /// joints is prescribed.
    pub steps_per_control: Option<u32>,
    /// Whether references are interpolated between control ticks instead of held.
    pub interpolate: bool,
    /// Duration T_e of a test in s; recorded logs have their own duration.
    pub duration_s: f64,
    /// Physics steps between two samples of the log.
    pub sample_every: u32,
    /// The most physics steps of one simulation; a longer one is refused. Default: 20 million.
    pub max_steps: u64,
    /// Coulomb friction coefficient of the ground; robots with a fixed base have no ground.
    pub ground_friction: f64,
    /// Acceleration of gravity in m/s², along world z.
    pub gravity: f64,
    /// A ball on the ground.
    pub ball: Option<BallSection>,
    /// The engine that computes the motion.
    pub engine: EngineName,
}

impl Default for SimulationSection {
    fn default() -> Self {
        SimulationSection {
            control_s: None,
            steps_per_control: None,
            interpolate: false,
            duration_s: 2.0,
            sample_every: 1,
            max_steps: MOST_STEPS,
            ground_friction: 0.8,
            gravity: -9.81,
            ball: None,
            engine: EngineName::Auto,
        }
    }
}

impl SimulationSection {
    /// Physics steps in a control period of `control_s` of this robot. A prescribed motion needs no finer steps.
    pub(crate) fn steps(&self, control_s: f64, robot: &Robot) -> u32 {
        self.steps_per_control.unwrap_or_else(|| match self.control_s {
            _ if robot.is_prescribed() => 1,
            Some(_) => USUAL_STEPS,
            None => (control_s / LONG_STEP_S).ceil().clamp(1.0, f64::from(USUAL_STEPS)) as u32,
        })
    }
}

/// A ball on the ground.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BallSection {
    /// Initial position of its centre, x and y in m; it lies on the ground.
    pub position_m: [f64; 2],
    /// Radius in m.
    pub radius_m: f64,
    /// Mass in kg.
    pub mass_kg: f64,
    /// Coulomb friction coefficient.
    #[serde(default = "half")]
    pub friction: f64,
    /// Coefficient of restitution: the share of the speed that remains after a central impact.
    #[serde(default = "half")]
    pub restitution: f64,
    /// Decay rate of its spin, in 1/s.
    #[serde(default = "half")]
    pub rolling_damping_per_s: f64,
}

/// Noise of the sensors: standard deviations of white noise, and quantisation steps; and what differs from run to run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NoiseSection {
    /// Joint encoders, in rad.
    pub position_rad: f64,
    /// Quantisation step of the joint encoders, in rad.
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
    /// Single channels, in their units, instead of their kind: `channels = { tau_wrist = 0.09 }`.
    pub channels: IndexMap<String, f64>,
    /// Standard deviation of joint positions from what the best model could predict, beyond the noise of the encoders,
    /// in rad: how far runs of the same command differ. Default: measured where logs repeat a command.
    pub model_rad: f64,
    /// The same for joint torques, in N·m.
    pub model_n_m: f64,
}

fn half() -> f64 {
    0.5
}
