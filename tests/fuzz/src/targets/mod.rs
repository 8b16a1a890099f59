//! The targets.

pub mod logs;
pub mod models;
pub mod runs;
pub mod workers;

use crate::folder::Folder;
use btr_core::world::Simulator;
use btr_lab::experiment::FileError;
use btr_physics::model::Model;

/// A small experiment: a driven pendulum.
pub(crate) const PENDULUM: &str = include_str!("../../corpus/model/pendulum");

/// A target's simulations are short: long ones are no finding.
pub(crate) const FEW_STEPS: &str = "simulation.max_steps=1000";

/// Checks that a complaint names a file of the folder.
fn names_a_file(complaint: &str, folder: &Folder) {
    let folder = folder.path().to_string_lossy();
    assert!(complaint.contains(&*folder), "names no file: {complaint}");
}

/// Checks a complaint about a model, with its help.
fn refused(error: &FileError, folder: &Folder) {
    names_a_file(&error.to_string(), folder);
    error.help.iter().for_each(|help| drop(help.to_string()));
}

/// Simulates a model at its own values.
fn simulated(model: &Model) {
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    match model.simulate(model.request(&s, 0).controller(&c).noise_seed(1)) {
        Ok(log) => drop(model.fitness.terms(&log)),
        Err(error) => drop(error.to_string()),
    }
}
