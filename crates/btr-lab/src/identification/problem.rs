//! The identification problem: its parts, and properties of its logs.

use super::catalogue::law_terms::TermDefinition;
use super::log_parts::LogPart;
use crate::scales::RobotScales;
use btr_core::log::Log;
use btr_identify::quality::GlitchReport;
use btr_identify::residual_model::{EffectCandidate, FitParameter, LawTerm, RecordedLog};
use btr_physics::effects::Effect;
use btr_physics::model::parameter::Target;
use btr_physics::model::{Model, Scenario};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// What a candidate changes in the model.
#[derive(Clone)]
pub(super) enum Change {
    /// It adds an effect.
    Effect(&'static dyn Effect),
    /// It sets values, one for each of its parameters.
    Values(Vec<Target>),
}

/// A model, its logs, and everything that may be varied.
#[derive(Clone)]
pub struct IdentificationProblem {
    pub(super) model: Arc<Model>,
    pub(super) recorded: Vec<Log>,
    /// Whether glitches are searched beside fitted models.
    pub(super) searches_glitches: bool,
    /// Those that were found so and are left out, each with its scenario.
    pub(super) glitches: Vec<(usize, GlitchReport)>,
    /// The model's scenarios, with the initial states estimated from the logs.
    pub(super) situations: Vec<Scenario>,
    /// Whether the robot is floating and has a standing start before every log.
    pub(super) rests: bool,
    /// The clocks of the logs in the time of laws.
    pub(super) clocks_s: Vec<Vec<f64>>,
    pub(super) parts: Vec<LogPart>,
    pub(super) parameters: Vec<FitParameter>,
    pub(super) free: Vec<usize>,
    pub(super) candidates: Vec<EffectCandidate>,
    pub(super) logs: Vec<RecordedLog>,
    /// For each scenario, the noise floors that are taken from a model: those that are lower beside it than in the
    /// readings alone, and those of the torques that a prescribed motion requires.
    pub(super) floors_of_model: Vec<HashMap<String, f64>>,
    /// For each scenario, what single samples have beside the noise floor: torques whose dry friction has an uncertain
    /// sign.
    pub(super) uncertain: Vec<HashMap<String, Arc<[f64]>>>,
    /// How many recorded samples a sample is the mean of.
    pub(super) means_of: usize,
    pub(super) scales: RobotScales,
    /// With windows: for each joint, the channels of the joints of its limb.
    pub(super) limbs: Vec<Vec<String>>,
    /// The channels in which each candidate shows first; empty if it shows in all.
    pub(super) near: Vec<Vec<String>>,
    /// What each candidate changes.
    pub(super) changes: Vec<Change>,
    pub(super) features: Vec<LawTerm>,
    /// The definition and the effect of each feature.
    pub(super) terms: Vec<(TermDefinition, &'static dyn Effect)>,
}

impl IdentificationProblem {
    /// The logs' channels, to change their floors.
    pub(crate) fn floors(&mut self) -> impl Iterator<Item = &mut RecordedLog> {
        self.logs.iter_mut()
    }

    /// The same problem with logs whose samples are means of so many recorded ones.
    pub(crate) fn of_means(self, means_of: usize) -> Self {
        IdentificationProblem { means_of, ..self }
    }

    /// The model's own parameters, free or frozen; they come before those of candidates.
    pub(super) fn own(&self) -> Range<usize> {
        0..self.model.simulations.len()
    }

    /// Makes only these of the model's own parameters free.
    pub(in crate::identification) fn set_free(&mut self, free: Vec<usize>) {
        self.free = free;
    }

    /// The scenario of a log.
    pub(crate) fn scenario(&self, log: usize) -> usize {
        self.parts[log].scenario
    }

    /// Whether a channel's noise floor is assumed, in the first log that has the channel.
    pub(crate) fn is_assumed(&self, name: &str) -> bool {
        let first = self.recorded.iter().find_map(|log| log.channel(name));
        first.is_some_and(|channel| self.model.setup.noise.is_assumed(name, &channel.values))
    }

    /// The model at its current values.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// The logs, in the order of the model's scenarios.
    pub fn recorded(&self) -> &[Log] {
        &self.recorded
    }

    /// Typical magnitudes of this robot.
    pub(crate) fn scales(&self) -> &RobotScales {
        &self.scales
    }

    /// The scenarios of the training logs.
    pub(crate) fn learnt(&self) -> Vec<usize> {
        self.parts.iter().filter(|part| !part.held_out).map(|part| part.scenario).collect()
    }

    /// Whether all joints stay within their range in the logs, widened by a share of it.
    pub(crate) fn is_within(&self, log: &Log, margin: f64) -> bool {
        let mut joints = self.model.robot.movable().map(|(_, link)| &link.joint.name);
        joints.all(|joint| {
            let (low, high) = self.range(joint);
            let margin = margin * (high - low);
            let values = log.channel(&format!("q_{joint}")).map_or(&[][..], |channel| &channel.values);
            values.iter().all(|x| *x >= low - margin && *x <= high + margin)
        })
    }

    /// Least and greatest position of a joint in all logs.
    pub(super) fn range(&self, joint: &str) -> (f64, f64) {
        let name = format!("q_{joint}");
        let values = self.recorded.iter().filter_map(|log| log.channel(&name)).flat_map(|channel| &channel.values);
        let finite = values.copied().filter(|x| x.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        if low < high { (low, high) } else { (-1.0, 1.0) }
    }

    /// Length of the longest log.
    pub(super) fn longest_s(&self) -> f64 {
        self.recorded.iter().map(Log::duration_s).fold(f64::MIN_POSITIVE, f64::max)
    }
}
