//! The hidden twin: a simulation of its own parameters and effects that stands in for the robot.

use super::Revealing;
use super::store::{Store, or_pending};
use crate::io::Meta;
use crate::model::Model;
use btr_core::world::{Outcome, Reality, Simulator, Trial};
use indexmap::IndexMap;
use serde::Serialize;

/// A simulation that nobody looks into before the run is over.
pub struct Twin {
    model: Model,
    parameters: Vec<f64>,
    hidden: Vec<String>,
    seed: u64,
    store: Store,
}

/// What the twin was, told at the end.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Revealed {
    /// Its parameters by name, in the units of S.
    pub parameters: IndexMap<String, f64>,
    /// The effects that the model did not have.
    pub effects: Vec<String>,
}

impl Twin {
    /// A twin with its own model (effects, time step, noise) at a point of S; `hidden` names the effects for the report.
    pub fn new(model: Model, parameters: Vec<f64>, hidden: Vec<String>, seed: u64, store: Store) -> Self {
        Twin { model, parameters, hidden, seed, store }
    }

    fn perform(&self, trial: &Trial) -> Result<Outcome, super::StoreError> {
        if let Some(before) = self.store.recall(trial)? {
            return Ok(before);
        }
        let noise = btr_core::random::derive(self.seed, &[trial.number as u64]);
        match self.model.simulate(&self.parameters, &trial.controller, trial.scenario, Some(noise)) {
            Ok(log) => {
                self.store.ask(trial, &log)?;
                self.store.keep(trial, &log, &Meta::default())
            }
            Err(why) => Ok(Outcome::Failed { why: why.to_string() }),
        }
    }
}

impl Reality for Twin {
    fn test(&mut self, trial: &Trial) -> Outcome {
        or_pending(self.perform(trial))
    }
}

impl Revealing for Twin {
    fn reveal(&self) -> Option<Revealed> {
        let names = self.model.simulations().dims().iter().map(|d| d.name.clone());
        Some(Revealed {
            parameters: names.zip(self.parameters.iter().copied()).collect(),
            effects: self.hidden.clone(),
        })
    }
}
