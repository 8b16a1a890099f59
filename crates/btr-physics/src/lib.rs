//! What btr simulates: robots, their motors and sensors, physical effects, drives and tasks, on an engine of its own
//! or on Rapier; and what a run of it needs around it: experiment files, realities, logs on disk.

pub mod actuation;
pub mod drive;
pub mod effects;
pub mod engine;
pub mod model;
pub mod presets;
pub mod robot;
pub mod rollout;
pub mod sensor;
pub mod setup;
