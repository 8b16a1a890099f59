//! An identification problem before effects are offered, and the same problem with other logs.

use super::catalogue::parameters::free_parameter;
use super::catalogue::sites::limbs;
use super::log_parts::{LogPart, whole};
use super::problem::IdentificationProblem;
use crate::scales::RobotScales;
use btr_core::log::Log;
use btr_core::world::WorldError;
use btr_physics::model::{Model, Scenario};
use std::collections::HashMap;
use std::sync::Arc;

impl IdentificationProblem {
    pub(super) fn without_effects(
        model: Arc<Model>,
        recorded: Vec<Log>,
        parts: Vec<LogPart>,
    ) -> Result<Self, WorldError> {
        let scales = RobotScales::of(&model, &recorded)?;
        let dims = model.simulations.dims().iter().enumerate();
        Ok(IdentificationProblem {
            parameters: dims.map(|(k, dim)| free_parameter(dim, model.prior_sd(k), &scales)).collect(),
            free: (0..model.simulations.len()).collect(),
            candidates: Vec::new(),
            logs: Vec::new(),
            floors_of_model: vec![HashMap::new(); recorded.len()],
            uncertain: vec![HashMap::new(); recorded.len()],
            means_of: 1,
            changes: Vec::new(),
            features: Vec::new(),
            terms: Vec::new(),
            limbs: limbs(&model.robot),
            near: Vec::new(),
            scales,
            parts,
            situations: model.scenarios.clone(),
            rests: false,
            searches_glitches: false,
            glitches: Vec::new(),
            clocks_s: model.scenarios.iter().zip(&recorded).map(law_clock).collect(),
            model,
            recorded,
        })
    }

    /// The same residual model with other logs of the same scenarios, none held out. Noise floors are the sensors'
    /// noise alone; initial states are those that the model at `u` estimates.
    pub(crate) fn with_logs(&self, model: Arc<Model>, recorded: Vec<Log>, u: &[f64]) -> Result<Self, WorldError> {
        let parts = whole(&recorded);
        let other = Self::without_effects(model, recorded, parts)?;
        let (parameters, candidates, features) =
            (self.parameters.clone(), self.candidates.clone(), self.features.clone());
        let (changes, terms) = (self.changes.clone(), self.terms.clone());
        let mut other = IdentificationProblem {
            parameters,
            candidates,
            features,
            changes,
            terms,
            near: self.near.clone(),
            ..other
        };
        other.begin(u)?;
        Ok(other)
    }
}

/// The clock of a log in the time of laws.
fn law_clock((scenario, log): (&Scenario, &Log)) -> Vec<f64> {
    log.clock_s().iter().map(|t| scenario.begins_s + t).collect()
}
