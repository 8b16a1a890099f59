//! The cause of a disengagement.

use crate::experiment::Experiment;
use crate::model_text::{AddError, Addition, add};
use btr_core::world::Cancelled;
use btr_identify::LadderStep;
use btr_identify::diagnose::{MissingEffect, Verdict};
use serde::{Deserialize, Serialize};

/// Why a diagnosis was not finished.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum DiagnosisError {
    /// It is not possible.
    #[error("{0}")]
    NotPossible(String),
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl DiagnosisError {
    /// A diagnosis that is not possible, for this reason.
    pub(super) fn why(why: &(impl ToString + ?Sized)) -> Self {
        DiagnosisError::NotPossible(why.to_string())
    }
}

/// Why simulation and reality disengaged.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cause {
    /// Number of closed iterations at the time of the diagnosis.
    pub after_iteration: usize,
    /// The verdict; `None` if no diagnosis was possible.
    pub verdict: Option<Verdict>,
    /// The missing effects; with the verdict `unexplained`, effects that help but do not explain.
    pub effects: Vec<MissingEffect>,
    /// Error after each step, in multiples of the noise floor.
    pub error_ladder: Vec<LadderStep>,
    /// Numbers of the training tests.
    pub learnt: Vec<usize>,
    /// Numbers of the held-out tests.
    pub held_out: Vec<usize>,
    /// Number of simulated logs.
    pub rollouts: usize,
    /// Why there is no diagnosis, if there is none.
    pub not_diagnosed: Option<String>,
    /// Effects that the run added to S.
    pub added: Vec<String>,
}

impl Cause {
    /// `effect@site` of each effect that is certainly missing; effects that only help are left out.
    pub fn missing(&self) -> Vec<String> {
        let certain = self.verdict == Some(Verdict::EffectMissing);
        let names = self.effects.iter().map(|found| format!("{}@{}", found.effect, found.site));
        names.filter(|_| certain).collect()
    }

    /// One-line summary.
    pub fn sentence(&self) -> String {
        let named: Vec<String> =
            self.effects.iter().map(|found| format!("{} on {}", found.effect, found.site)).collect();
        let named = named.join("; ");
        match (&self.not_diagnosed, self.verdict) {
            (Some(why), _) => format!("the cause was not diagnosed: {why}"),
            (None, Some(Verdict::EffectMissing)) => format!("the cause: S lacks {named}"),
            (None, Some(Verdict::NothingMissing)) => {
                "no effect is missing: S contains the robot, but the search did not find it (use more generations, turns or restarts)".to_owned()
            }
            (None, _) if named.is_empty() => "the cause is unexplained: no effect of the library helps".to_owned(),
            (None, _) => format!("the cause is unexplained: {named} helps but does not explain the error"),
        }
    }

    /// The experiment's text with the missing effects added as free parameters.
    pub(crate) fn remedy(&self, experiment: &Experiment) -> Result<String, AddError> {
        let robot = &experiment.model.robot;
        let additions: Result<Vec<Addition>, AddError> =
            self.missing().iter().map(|name| Addition::parse(name, robot)).collect();
        add(experiment.source(), robot, &additions?)
    }
}
