//! A person operates the robot: trials are written to disk, and the run waits until their logs exist.

use super::revealed::Revealing;
use super::store::{Store, StoreError, outcome_of};
use btr_core::text::{Mention, Text};
use btr_core::world::{AnnounceError, Outcome, Reality, Trial};
use btr_physics::model::Model;
use std::sync::Arc;

/// Waits for logs that a person puts into the folders of the trials.
pub struct ManualReality {
    model: Arc<Model>,
    store: Store,
}

impl ManualReality {
    /// Keeps trials in `store`; `model` computes the references of a controller.
    pub fn new(model: Arc<Model>, store: Store) -> Self {
        ManualReality { model, store }
    }

    fn perform(&self, trial: &Trial) -> Result<Outcome, StoreError> {
        if let Some(before) = self.store.recall(trial)? {
            return Ok(before);
        }
        let folder = self.store.folder_of(trial);
        let play = format!(
            "{0}: play references.csv on the robot, save what it did as {0}/log.csv or log.mcap (or why it could not be \
             done as failed.txt), then ",
            folder.display()
        );
        Ok(Outcome::Pending { what: Text::from(play) + Mention::RunAgain })
    }
}

impl Reality for ManualReality {
    fn announce(&mut self, trials: &[Trial]) -> Result<(), AnnounceError> {
        trials.iter().try_for_each(|trial| {
            let references = self.model.references(&trial.controller, trial.scenario)?;
            self.store.ask(trial, &references).map(|_| ()).map_err(|error| AnnounceError::Storage(error.text()))
        })
    }

    fn test(&mut self, trial: &Trial) -> Outcome {
        outcome_of(self.perform(trial))
    }
}

impl Revealing for ManualReality {}
