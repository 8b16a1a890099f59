//! What btr simulates: robots, their motors and sensors, physical effects, drives and tasks, on Rapier; and what a run of
//! it needs around it: experiment files, realities, logs on disk.

pub mod adapt;
pub mod ant;
pub mod drive;
pub mod effect;
pub mod experiment;
pub mod identify;
pub mod io;
pub mod model;
pub mod nao;
pub mod parameter;
pub mod pendulum;
pub mod reality;
pub mod report;
pub mod robot;
pub mod run;
pub mod sensor;
pub mod sim;
pub mod task;
pub mod urdf;
