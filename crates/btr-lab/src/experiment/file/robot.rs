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
    /// The joint follows its measured motion (its command where none was measured); the torque that this takes is
    /// compared with the measured one, both smoothed alike.
    Prescribed {
        /// Where a digital servo worked out the measured torque: the time between two instants at which it did, in s.
        /// Each is logged at its instant and held until the next.
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
