//! What btr simulates: robots, their motors and sensors, physical effects, drives and tasks, on Rapier.

pub mod ant;
mod assemble;
mod control;
pub mod drive;
pub mod effect;
pub mod engine;
pub mod kinematics;
pub mod leg;
pub mod motor;
pub mod nao;
pub mod parameter;
pub mod pendulum;
pub mod rapier;
mod record;
pub mod robot;
pub mod sensor;
pub mod sim;
pub mod site;
mod stretch;
