//! Assembles an identification problem: free parameters, candidate effects and law terms.

use super::contact::{noise_floor, probes};
use super::log_parts::{LogPart, parts, whole};
use super::problem::IdentificationProblem;
use btr_core::log::Log;
use btr_core::world::WorldError;
use btr_physics::model::Model;
use std::sync::Arc;

impl IdentificationProblem {
    /// The problem of a model and its logs: `recorded` in the order of the model's scenarios. `without` names effects
    /// that are not considered.
    ///
    /// # Errors
    /// A log without any measured channel that the model has; a model that diverges at its current values.
    pub fn new(model: Arc<Model>, recorded: Vec<Log>, without: &[&str]) -> Result<Self, WorldError> {
        let parts = parts(&model, &recorded);
        Self::in_parts(model, recorded, without, parts)
    }

    /// The same with every log as a whole training log.
    ///
    /// # Errors
    /// See [`new`](Self::new).
    pub fn to_learn(model: Arc<Model>, recorded: Vec<Log>) -> Result<Self, WorldError> {
        let parts = whole(&recorded);
        Self::in_parts(model, recorded, &[], parts)
    }

    fn in_parts(
        model: Arc<Model>,
        recorded: Vec<Log>,
        without: &[&str],
        parts: Vec<LogPart>,
    ) -> Result<Self, WorldError> {
        let mut problem = Self::without_effects(model, recorded, parts)?;
        let origin = vec![0.0; problem.parameters.len()];
        problem.begin(&origin)?;
        problem.lower_floors(&origin)?;
        if problem.is_chaotic() {
            noise_floor::raise(&mut problem, &origin)?;
        }
        problem.offer_effects(without);
        if problem.is_chaotic() {
            probes::enlarge(&mut problem)?;
        }
        problem.offer_terms()?;
        Ok(problem)
    }
}
