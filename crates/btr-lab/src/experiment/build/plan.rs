//! Validates a plan; errors name the line and a remedy.

use super::builder::Builder;
use crate::experiment::file::RealitySection;
use crate::experiment::source::FileError;
use btr_core::coevolve::{Coevolution, MapError, Plan, PlanError};
use btr_core::distance::DistanceSpec;
use btr_core::log::{Log, Role};
use btr_core::text::{Text, Verb};
use btr_core::world::Simulator;
use btr_physics::model::Model;
use btr_physics::model::task::TERMS;

impl Builder<'_> {
    /// Checks before a run that plan, model and reality fit together.
    pub(crate) fn check_plan(
        &self,
        plan: &Plan,
        reality: &RealitySection,
        model: &Model,
        recorded: &[Log],
    ) -> Result<(), FileError> {
        if matches!(reality, RealitySection::Logs(_)) && !model.drive.space().is_empty() {
            let help = "remove search from [drive]; the commands of the logs are replayed in any case".into();
            return Err(self.error(
                &["drive", "search"],
                "controllers cannot be searched with recorded logs",
                Some(help),
            ));
        }
        if !self.file.distances.is_empty() && !model.drive.space().is_empty() {
            let help = "remove search from [drive], or remove distances".into();
            let message = "other distances need a fixed drive: otherwise each of them would select other controllers";
            return Err(self.error(&["distances"], message, Some(help)));
        }
        Coevolution::new(plan.clone(), 0, model).map_err(|e| self.refused(&e, model))?;
        self.check_descriptors(plan, model)?;
        let mut distances = std::iter::once(&plan.distance).chain(&self.file.distances);
        let refine = plan.simulators.as_ref().is_some_and(|phase| phase.refine > 0);
        if refine && distances.all(|distance| distance.build().as_squares().is_none()) {
            let help = "use distance = \"rmse\", or remove refine".into();
            let message = "only a sum of squares can be refined by least squares";
            return Err(self.error(&["coevolve", "simulators", "refine"], message, Some(help)));
        }
        let distances = [(&["coevolve", "distance"][..], &plan.distance)];
        for (keys, distance) in distances.into_iter().chain(self.file.distances.iter().map(|d| (&["distances"][..], d)))
        {
            self.check_channels(keys, distance, model, recorded)?;
        }
        Ok(())
    }

    /// Checks that the channels of a distance exist: without any, every distance would be infinite.
    fn check_channels(
        &self,
        keys: &[&str],
        distance: &DistanceSpec,
        model: &Model,
        recorded: &[Log],
    ) -> Result<(), FileError> {
        let Some(channels) = distance.channels() else { return Ok(()) };
        let nominal = (model.simulations.nominal(), model.drive.space().nominal());
        // A model that diverges here is reported in the run, where failures are counted.
        let Ok(log) = model.simulate(model.request(&nominal.0, 0).controller(&nominal.1)) else { return Ok(()) };
        let known: Vec<&str> = log.channels().filter(|(_, c)| c.role != Role::Truth).map(|(name, _)| name).collect();
        for log in std::iter::once(&log).chain(recorded) {
            if let Some(wrong) = channels.unmatched(log).first() {
                return Err(self.unknown(keys, "channel", wrong, known));
            }
        }
        Ok(())
    }

    /// An error of the core about a plan, at its place in the file.
    fn refused(&self, error: &PlanError, model: &Model) -> FileError {
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

    /// Checks that the model has the channels that a map's descriptors need.
    fn check_descriptors(&self, plan: &Plan, model: &Model) -> Result<(), FileError> {
        let names = plan.map.iter().flat_map(|map| map.descriptors.keys());
        for term in names.filter_map(|name| TERMS.iter().find(|term| term.name == name)) {
            self.check_channels_of(term, &model.robot, &["coevolve", "map", "descriptors", term.name])?;
        }
        Ok(())
    }
}

fn remedy(error: &PlanError) -> Text {
    let words = match error {
        PlanError::NoControllerSearch(_) => {
            "controllers = { generations = 10, search = { algorithm = \"ga\", population = 20 } }; or set them in [drive]"
        }
        PlanError::NoSimulatorSearch(_) => {
            "simulators = { generations = 20, search = { algorithm = \"cma_es\", population = 12 } }, or posterior = {}; or empty \
             [parameters]"
        }
        PlanError::NothingToControl => "add a search to [drive], or use method = \"back_to_reality\"",
        PlanError::NoLikelihood => "distance = \"whitened\", and the sensors' noise under [noise]",
        PlanError::NoPosterior => "add [coevolve.posterior], or use rule = \"disagreement\"",
        PlanError::NoIterations => "iterations = 10",
        PlanError::Map(MapError::Posterior) => "remove it, or use method = \"back_to_reality\"",
        PlanError::Map(MapError::TooManyCells { .. }) => "use fewer cells, or fewer descriptors",
        PlanError::Map(MapError::Bounds { .. }) => "NAME = [LEAST, MOST]: values outside count as the nearest bound",
        PlanError::Map(_) => {
            return Text::from("map = { descriptors = { energy = [0.0, 50.0] } }; ") + Verb::Info + " lists the terms";
        }
    };
    words.into()
}
