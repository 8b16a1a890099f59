//! Drives: what the joints are told, over time.

pub mod cart_table;
pub mod nao_walk;
pub mod posture;
pub mod reference;

/// A source of joint references.
pub trait Drive: Send + Sync {
    /// Writes the reference of every driven joint at `time_s` into `command`, in the order of the robot's
    /// [`movable`](crate::robot::Robot::movable) joints: rad for hinges, m for slides, N·m for torque actuators, V for voltage.
    /// NaN means "not driven" (torque off).
    fn command(&self, time_s: f64, command: &mut [f64]);
}
