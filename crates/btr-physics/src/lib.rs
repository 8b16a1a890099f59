//! What btr simulates: robots, their motors and sensors, physical effects, drives and tasks, on Rapier; and what a run of
//! it needs around it: experiment files, realities, logs on disk.

pub mod adapt;
pub mod ant;
mod articulated;
mod assemble;
pub mod augment;
pub mod beside;
mod control;
pub mod drive;
pub mod effect;
pub mod engine;
mod excite;
pub mod experiment;
pub mod identify;
pub mod io;
pub mod kinematics;
pub mod leg;
pub mod model;
pub mod motor;
pub mod nao;
pub mod parameter;
pub mod pendulum;
pub mod rapier;
pub mod reality;
mod record;
pub mod report;
pub mod robot;
pub mod run;
mod scales;
pub mod sensor;
pub mod sim;
pub mod site;
mod stretch;
pub mod task;
mod term;
pub mod urdf;
pub mod verbs;
