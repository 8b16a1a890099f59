//! Motors: from a command to a torque.

pub mod motor;
mod sampled;
