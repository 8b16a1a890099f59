//! A plan that cannot be carried out: at which line, and what to do about it.

use super::build::Builder;
use super::parse::FileError;
use btr_core::coevolve::{MapError, Plan, PlanError};
use btr_core::world::Simulator;
use btr_physics::model::Model;
use btr_physics::model::task::TERMS;

impl Builder<'_> {
    /// What the core says of a plan, at its place in the file.
    pub(super) fn refused(&self, error: &PlanError, model: &Model) -> FileError {
        match error {
            PlanError::Map(MapError::Unknown { name }) => {
                let keys = ["coevolve", "map", "descriptors", name];
                let controllers = model.controllers().dims().iter().map(|dim| dim.name.as_str());
                self.unknown(&keys, "descriptor", name, TERMS.iter().map(|term| term.name).chain(controllers))
            }
            PlanError::Map(MapError::Bounds { name, .. }) => {
                self.error(&["coevolve", "map", "descriptors", name], error, Some(remedy(error)))
            }
            PlanError::Map(MapError::TooManyCells { .. }) => {
                self.error(&["coevolve", "map", "cells"], error, Some(remedy(error)))
            }
            PlanError::Map(MapError::NoDescriptors) => self.error(&["coevolve", "map"], error, Some(remedy(error))),
            PlanError::Map(MapError::Posterior) => self.error(&["coevolve", "posterior"], error, Some(remedy(error))),
            _ => self.error(&["coevolve"], error, Some(remedy(error))),
        }
    }

    /// Terms that a map describes behaviours by need channels, as those of a fitness do.
    pub(super) fn check_descriptors(&self, plan: &Plan, model: &Model) -> Result<(), FileError> {
        let names = plan.map.iter().flat_map(|map| map.descriptors.keys());
        for term in names.filter_map(|name| TERMS.iter().find(|term| term.name == name)) {
            self.check_channels_of(term, &model.robot, &["coevolve", "map", "descriptors", term.name])?;
        }
        Ok(())
    }
}

fn remedy(error: &PlanError) -> String {
    match error {
        PlanError::NoControllerSearch(_) => {
            "controllers = { generations = 10, search = { algorithm = \"ga\", population = 20 } }; or set them in [drive]"
        }
        PlanError::NoSimulatorSearch(_) => {
            "simulators = { generations = 20, search = { algorithm = \"cma_es\", population = 12 } }, or posterior = {}; or empty \
             [parameters]"
        }
        PlanError::NothingToControl => "give [drive] a search, or take method = \"back_to_reality\"",
        PlanError::NoLikelihood => "distance = \"whitened\", and the sensors' noise under [noise]",
        PlanError::NoPosterior => "add [coevolve.posterior], or take rule = \"disagreement\"",
        PlanError::NoIterations => "iterations = 10",
        PlanError::Map(MapError::Posterior) => "take it out of the file, or take method = \"back_to_reality\"",
        PlanError::Map(MapError::TooManyCells { .. }) => "take fewer cells, or fewer descriptors",
        PlanError::Map(MapError::Bounds { .. }) => "NAME = [LEAST, MOST]: what lies outside counts as on the edge",
        PlanError::Map(_) => "map = { descriptors = { energy = [0.0, 50.0] } }; `btr info` lists the terms",
    }
    .to_owned()
}
