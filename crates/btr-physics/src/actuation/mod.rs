//! Motors: from a command to a torque.

mod joint_input;
mod motor;
mod neighbour;
mod sampled;
mod torque;

pub use joint_input::JointInput;
pub(crate) use motor::Motor;
pub use neighbour::{NeighbourInputs, NeighbourQuantity};
pub use torque::{MotorTorque, TorqueBound};
