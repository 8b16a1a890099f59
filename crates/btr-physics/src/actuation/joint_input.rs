//! Inputs of a motor and the effects on it at the beginning of a step.

use super::neighbour::NeighbourInputs;

/// A joint's state and command at the beginning of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointInput<'a> {
    /// Simulated time in s.
    pub time_s: f64,
    /// Length of the step in s.
    pub dt_s: f64,
    /// Position in rad (m).
    pub q: f64,
    /// Velocity in rad/s (m/s).
    pub dq: f64,
    /// Mean acceleration over the last step, in rad/s² (m/s²).
    pub acceleration: f64,
    /// Whether the engine solves for the step's middle, instead of its end.
    pub midpoint: bool,
    /// Estimate of the inertia that the joint moves, in kg·m² (kg).
    pub inertia: f64,
    /// Torque of this joint's motor in the last step, in N·m (N).
    pub torque: f64,
    /// Sum of the absolute values of all motors' torques in the last step, in N·m; computed only where an effect acts
    /// on all joints at once.
    pub load: f64,
    /// The command that reaches the motor; NaN when it is switched off.
    pub command: f64,
    /// Over how long the readings of a prescribed motion are means, in s; 0 otherwise.
    pub mean_s: f64,
    /// The neighbouring joints; `None` unless an effect of the run uses them. NaN where there is no neighbour.
    pub neighbours: Option<&'a NeighbourInputs>,
}

impl JointInput<'_> {
    /// Extrapolated velocity in the middle of the step: speed-dependent forces are second-order accurate there.
    pub fn dq_midpoint(&self) -> f64 {
        self.dq + 0.5 * self.dt_s * self.acceleration
    }
}
