//! The question and the answer of a diagnosis.

use super::residual_law::ResidualLaw;
use crate::LadderStep;
use crate::fit::{Estimate, FitPoint};
use serde::{Deserialize, Serialize};

/// How much is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DiagnoseOptions {
    /// The most effects to add.
    pub max_effects: usize,
    /// No round begins whose first screening would carry the simulated logs beyond this number, and no law is looked
    /// for beyond it. What a round goes on to (refits, and on the ground a second screening) is not counted in advance.
    pub max_rollouts: usize,
}

impl Default for DiagnoseOptions {
    fn default() -> Self {
        DiagnoseOptions { max_effects: 3, max_rollouts: usize::MAX }
    }
}

/// The answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The effects named explain the error.
    EffectMissing,
    /// The residual is noise.
    NothingMissing,
    /// There is an error that nothing known explains.
    Unexplained,
}

/// An effect that the model lacks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MissingEffect {
    /// Its name.
    pub effect: String,
    /// Where it sits.
    pub site: String,
    /// `effect@site` of the effects that these logs cannot distinguish from it.
    pub alike: Vec<String>,
    /// Its share of belief among everything that was fitted in its round, the model without it included; with that of a
    /// larger law which it stands for.
    pub probability: f64,
    /// By how much it lowered B.
    pub delta_bic: f64,
    /// Its parameters.
    pub parameters: Vec<Estimate>,
    /// Index of the candidate.
    #[serde(skip)]
    pub candidate: usize,
}

/// A candidate that was fitted in a round.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RankedCandidate {
    /// `effect@site`.
    pub name: String,
    /// Error on the training logs, in multiples of the noise floor.
    pub train: f64,
    /// Error on held-out logs; none without such, or where they cannot be simulated.
    pub held_out: Option<f64>,
    /// By how much it lowers B; negative where it is not worth its parameters.
    pub delta_bic: f64,
}

/// The whole diagnosis.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// What was fitted in each round, best first.
    pub rounds: Vec<Vec<RankedCandidate>>,
    /// The answer.
    pub verdict: Verdict,
    /// What is missing, or helps without explaining.
    pub effects: Vec<MissingEffect>,
    /// How the error fell.
    pub ladder: Vec<LadderStep>,
    /// The share of the final squared error that is not noise.
    pub unexplained_share: f64,
    /// The integrator's error in multiples of the noise floor, on the training or on the held-out logs, whichever is
    /// larger.
    pub integrator_error: f64,
    /// Free parameters that ended at a bound.
    pub at_bound: Vec<String>,
    /// The last fit, with everything that was accepted.
    pub fit: FitPoint,
    /// What the last found with any in `alike` was compared with, and first itself: candidate and point, for the next
    /// experiment.
    pub rivals: Vec<(usize, Vec<f64>)>,
    /// With the verdict `Unexplained`: what the error looks like, if it looks like something.
    pub residual_law: Option<ResidualLaw>,
    /// Whether the rollouts that were allowed ended it.
    pub cut_short: bool,
    /// Simulated logs.
    pub rollouts: usize,
}
