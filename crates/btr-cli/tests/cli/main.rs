//! The built `btr`, as its users meet it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod adapted;
mod bad_input;
mod base_parameters;
mod check;
mod compare;
mod damaged;
mod determinism;
mod disengage;
mod doubts;
mod export;
mod fitted_models;
mod freeze;
mod glitches;
mod integrity;
mod inverse_dynamics;
mod lab;
mod limits;
mod meshes;
mod new;
mod new_refused;
mod next_drive;
mod patterns;
mod priors;
mod real_arm;
mod real_servo;
mod realities;
mod repeats;
mod reports;
mod reproducibility;
#[cfg(unix)]
mod robot_programs;
mod runs;
mod scenarios;
mod start;
mod studio;
mod terminal;
mod usual_laws;
mod verbs;
mod warned;
