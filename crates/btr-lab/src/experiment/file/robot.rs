//! `[robot]` and `[actuators]`.

use btr_physics::robot::Base;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A built-in robot, a URDF, or a pendulum.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RobotSection {
    /// `ant`, `nao` or `pendulum`.
    pub builtin: Option<String>,
    /// Path of a URDF, relative to this file.
    pub urdf: Option<PathBuf>,
    /// The URDF itself, instead of its path. Models made from a compiled MuJoCo model have it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub urdf_text: Option<String>,
    /// Folders with the packages of the URDF's meshes (`package://NAME/...`), relative to this file. Where this is
    /// stated, be it empty, the boxes around the meshes are known: they are drawn, and say where a tool is held.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub package_paths: Option<Vec<PathBuf>>,
    /// Fixed or floating base of a URDF robot; built-in robots define their own.
    #[serde(default)]
    pub base: Option<Base>,
    /// Initial height of the root above the ground, in m.
    pub height_m: Option<f64>,
    /// Pendulum: mass of the bob in kg.
    pub mass_kg: Option<f64>,
    /// Pendulum: distance from the axis to the bob, in m.
    pub length_m: Option<f64>,
}

/// An actuator; see `btr info`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum ActuatorSection {
    /// Nothing drives the joint.
    Passive,
    /// PID controller of the position.
    Position {
        /// N·m/rad.
        kp: f64,
        /// N·m/(rad·s).
        #[serde(default)]
        ki: f64,
        /// N·m·s/rad.
        #[serde(default)]
        kd: f64,
        /// N·m. Default: unlimited, whatever the `effort` of a URDF is; a new model file states it here.
        #[serde(default = "unlimited")]
        max_torque: f64,
        /// Sampling period of a digital servo, in s: it reads and computes once per period and holds the result.
        /// Default: continuous time.
        sample_s: Option<f64>,
        /// With `sample_s`: the velocity is the difference of two readings that are this many periods apart.
        #[serde(default = "one_period")]
        velocity_over: u32,
    },
    /// The command is a torque.
    Torque {
        /// N·m. Default: unlimited, whatever the `effort` of a URDF is; a new model file states it here.
        #[serde(default = "unlimited")]
        max_torque: f64,
    },
    /// A DC motor; the command is a position with `gain`, else a voltage.
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
        /// Sampling period of the position loop that `gain` adds, in s; as for `position`.
        sample_s: Option<f64>,
    },
    /// The joint follows its measured motion (its command where no motion was measured); the torque that this requires
    /// is compared with the measured torque, both smoothed in the same way.
    Prescribed {
        /// If a digital servo computed the measured torque: its sampling period in s. Each torque is logged at its
        /// instant and held until the next.
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
