//! What btr simulates: robots, their motors and sensors, physical effects, drives and tasks, on Rapier.

pub mod drive;
pub mod io;
pub mod robot;
pub mod urdf;
