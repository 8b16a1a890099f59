//! What a motor and the effects on it know at the beginning of a step.

/// What a joint is doing at the beginning of a step, and what it is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointInput {
    /// Simulated time in s.
    pub time_s: f64,
    /// Length of the step in s.
    pub dt_s: f64,
    /// Position in rad (m).
    pub q: f64,
    /// Velocity in rad/s (m/s).
    pub dq: f64,
    /// How `dq` changed in the last step, in rad/s² (m/s²).
    pub acceleration: f64,
    /// Whether the step is solved for its middle, and not for its end.
    pub midway: bool,
    /// Roughly what the joint moves, in kg·m² (kg).
    pub inertia: f64,
    /// What this joint's motor did in the last step, in N·m (N).
    pub torque: f64,
    /// Sum of the sizes of all motors' torques in the last step, in N·m; kept only where an effect acts on all joints
    /// at once.
    pub load: f64,
    /// The command that reaches the motor; NaN when it is switched off.
    pub command: f64,
}

impl JointInput {
    /// The velocity in the middle of the step, as the past predicts it: what depends on speed is exact to second order
    /// there.
    pub fn dq_midway(&self) -> f64 {
        self.dq + 0.5 * self.dt_s * self.acceleration
    }
}
