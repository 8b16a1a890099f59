//! A robot, and what a model file can say about it.

use crate::experiment::ActuatorSection;
use btr_physics::robot::Base;
use indexmap::IndexMap;
use serde::Deserialize;

/// A robot with what its own file states of it.
#[derive(Clone, Debug, Deserialize)]
pub struct RobotDescription {
    /// Name of the model.
    pub name: String,
    /// The file that it was made from, in words.
    pub made_from: String,
    /// Links and joints as URDF.
    pub urdf: String,
    /// How the root is held; `None` if that is unknown.
    pub base: Option<Base>,
    /// Height of a floating root above the ground, in m.
    pub height_m: Option<f64>,
    /// Gravity along z in m/s², if it is stated.
    pub gravity: Option<f64>,
    /// Time step in s, if it is stated.
    pub step_s: Option<f64>,
    /// Friction coefficient of the ground, if it is stated.
    pub ground_friction: Option<f64>,
    /// Facts by joint.
    pub joints: IndexMap<String, JointFacts>,
    /// What the robot's file states and btr cannot represent, in words.
    pub not_represented: Vec<String>,
    /// What is not known of its meshes, in words.
    #[serde(default)]
    pub warnings: Vec<String>,
}

/// What is known of one joint besides what the URDF states.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct JointFacts {
    /// The actuator; `None` if it is unknown.
    pub actuator: Option<ActuatorSection>,
    /// Largest torque in N·m, where the actuator itself does not have it.
    pub torque_limit: Option<f64>,
    /// Rotor inertia in kg·m².
    pub armature: f64,
    /// Stiffness of a spring in N·m/rad, and the position in rad at which it is at rest.
    pub stiffness: f64,
    /// See `stiffness`.
    pub rest: f64,
    /// Time constant of the command's filter, in s.
    pub lag_s: f64,
    /// Delay of the command, in s.
    pub delay_s: f64,
    /// How the command follows from the control of the simulator that the robot comes from, unless they are equal.
    pub command: Option<Command>,
}

/// command = factor·control + offset.
#[derive(Clone, Debug, Deserialize)]
pub struct Command {
    /// The name of the control.
    pub control: String,
    /// The factor.
    pub factor: f64,
    /// The offset.
    pub offset: f64,
}
