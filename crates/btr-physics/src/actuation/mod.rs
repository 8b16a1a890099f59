//! Motors: from a command to a torque.

mod joint_input;
mod motor;
mod sampled;
mod torque;

pub use joint_input::JointInput;
pub(crate) use motor::Motor;
pub use torque::{MotorTorque, TorqueBound};
