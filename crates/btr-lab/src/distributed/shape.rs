//! What a batch must fit before it is computed: its numbers are indices and lengths, and a damaged one is refused.

use super::messages::{Candidate, RolloutMessage, Rollouts};
use btr_identify::residual_model::{Derivation, ModelDescription};
use btr_physics::model::Model;

/// The finest time step that is asked for: a model's own, halved so many times.
const MOST_HALVINGS: u8 = 16;

/// The lengths of a residual model's points.
pub(super) struct Shape {
    /// Number of parameters.
    parameters: usize,
    /// For each log, how many numbers its start has.
    starts: Vec<usize>,
}

impl Shape {
    pub(super) fn of(description: &ModelDescription) -> Self {
        let starts = description.starts.iter().map(|start| start.numbers.len());
        Shape { parameters: description.parameters.len(), starts: starts.collect() }
    }

    /// Whether all rollouts are about points and logs of the model.
    pub(super) fn fits(&self, rollouts: &Rollouts) -> bool {
        rollouts.halvings <= MOST_HALVINGS && rollouts.requests.iter().all(|request| self.fits_one(request))
    }

    fn fits_one(&self, RolloutMessage { u, log, moved }: &RolloutMessage) -> bool {
        u.len() == self.parameters && (moved.len() == 0 && *log < self.starts.len() || self.is_start(*log, moved.len()))
    }

    /// Whether the model can be derived so.
    pub(super) fn allows(&self, derivation: &Derivation) -> bool {
        match derivation {
            Derivation::Beginnings | Derivation::InWindows => true,
            // It is answered where the search runs.
            Derivation::WithNoisierMotion(_) => false,
            Derivation::WithStartsAt(u) | Derivation::WithoutGlitchesAt(u) | Derivation::WithTorqueFloorsAt(u) => {
                u.len() == self.parameters
            }
            Derivation::WithInitialState(moved) => moved.iter().all(|start| self.is_start(start.log, start.by.len())),
        }
    }

    fn is_start(&self, log: usize, numbers: usize) -> bool {
        self.starts.get(log) == Some(&numbers)
    }
}

/// Whether all candidates are about scenarios of the model. Their points are checked as they are simulated.
pub(super) fn are_of(candidates: &[Candidate], model: &Model) -> bool {
    candidates.iter().all(|candidate| candidate.scenario < model.scenarios.len())
}
