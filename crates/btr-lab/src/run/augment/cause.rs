//! The cause of a disengagement.

use crate::experiment::Experiment;
use crate::model_text::{AddError, Addition, add};
use btr_identify::LadderStep;
use btr_identify::diagnose::{MissingEffect, Verdict};
use serde::{Deserialize, Serialize};

/// Why simulation and reality lost each other.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cause {
    /// After which iteration it was asked.
    pub after_iteration: usize,
    /// The answer in a word; none where the question could not be asked.
    pub verdict: Option<Verdict>,
    /// What is missing; with the verdict `unexplained`, what helps and does not explain.
    pub effects: Vec<MissingEffect>,
    /// How the error fell, in multiples of the noise floor.
    pub error_ladder: Vec<LadderStep>,
    /// Numbers of the real tests that were learnt from.
    pub learnt: Vec<usize>,
    /// Numbers of those it was judged on.
    pub held_out: Vec<usize>,
    /// Simulated logs.
    pub rollouts: usize,
    /// Why there is no answer, where there is none.
    pub not_diagnosed: Option<String>,
    /// What the run added to S.
    pub added: Vec<String>,
}

impl Cause {
    /// `effect@site` of what is missing for certain; nothing that merely helps.
    pub fn missing(&self) -> Vec<String> {
        let certain = self.verdict == Some(Verdict::EffectMissing);
        let names = self.effects.iter().map(|found| format!("{}@{}", found.effect, found.site));
        names.filter(|_| certain).collect()
    }

    /// In one line.
    pub fn sentence(&self) -> String {
        let named: Vec<String> =
            self.effects.iter().map(|found| format!("{} on {}", found.effect, found.site)).collect();
        let named = named.join("; ");
        match (&self.not_diagnosed, self.verdict) {
            (Some(why), _) => format!("the cause was not looked for: {why}"),
            (None, Some(Verdict::EffectMissing)) => format!("the cause: S lacks {named}"),
            (None, Some(Verdict::NothingMissing)) => {
                "no effect is missing, S holds the robot: the search stopped short of it (more generations, turns or restarts)".to_owned()
            }
            (None, _) if named.is_empty() => "the cause is unexplained: no effect of the library helps".to_owned(),
            (None, _) => format!("the cause is unexplained: {named} helps and does not explain"),
        }
    }

    /// The experiment's text with what is missing in it, free to be found.
    pub(crate) fn remedy(&self, experiment: &Experiment) -> Result<String, AddError> {
        let robot = &experiment.model.robot;
        let additions: Result<Vec<Addition>, AddError> =
            self.missing().iter().map(|name| Addition::parse(name, robot)).collect();
        add(experiment.source(), robot, &additions?)
    }
}
