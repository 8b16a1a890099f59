//! Options and result of a diagnosis.

use super::residual_law::ResidualLaw;
use crate::LadderStep;
use crate::fit::{Degree, Estimate, FitPoint, Objective, RemainingError};
use crate::quality::GlitchReport;
use crate::residual_model::{CandidateKind, EffectCandidate, RecordedLog};
use serde::{Deserialize, Serialize};

/// Share of the rollouts for effects; the rest is for a law.
pub(super) const SEARCH: f64 = 0.8;

/// Share of the allowed rollouts up to which a round looks at the candidates in more than one way.
const SECOND_LOOK: f64 = 0.5;

/// The same where the best candidate explains most already.
const CHEAP_LOOK: f64 = 0.25;

/// Least probability of a rival that is told.
const TOLD: f64 = 0.01;

/// Limits of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DiagnoseOptions {
    /// The most effects to add.
    pub max_effects: usize,
    /// About how many logs may be simulated. No round begins whose first screening would carry them beyond four fifths
    /// of this number, none screens a second time beyond half of it, and no law is searched beyond all of it. What a
    /// round has begun to fit is finished.
    pub max_rollouts: usize,
    /// The same for further rounds while what is found halves the error, and to try another way where the search ends
    /// with an error left: at least as many.
    pub max_rollouts_while_falling: usize,
}

impl DiagnoseOptions {
    /// Whether another round may begin that leads to so many rollouts.
    pub(super) fn allows_round(&self, rollouts: usize, is_falling: bool) -> bool {
        if is_falling { self.while_falling() } else { *self }.allows(SEARCH, rollouts)
    }

    /// The same with the rollouts that are allowed while the error falls.
    pub(super) fn while_falling(&self) -> Self {
        DiagnoseOptions { max_rollouts: self.max_rollouts_while_falling, ..*self }
    }

    /// The same with more rollouts, up to those that are allowed while the error falls.
    pub(super) fn with_more(self, rollouts: usize) -> Self {
        let most = self.max_rollouts.saturating_add(rollouts).min(self.max_rollouts_while_falling);
        DiagnoseOptions { max_rollouts: most, ..self }
    }

    /// Whether a share of the rollouts is left, after these.
    pub(super) fn allows(&self, share: f64, rollouts: usize) -> bool {
        (rollouts as f64) <= share * self.max_rollouts as f64
    }
}

impl Default for DiagnoseOptions {
    fn default() -> Self {
        DiagnoseOptions { max_effects: 3, max_rollouts: usize::MAX, max_rollouts_while_falling: usize::MAX }
    }
}

/// Whether a round may look at the candidates in more than one way.
pub(super) struct SecondLooks {
    options: DiagnoseOptions,
    /// Whether one was not allowed.
    pub(super) refused: bool,
}

impl SecondLooks {
    pub(super) fn new(options: DiagnoseOptions) -> Self {
        SecondLooks { options, refused: false }
    }

    pub(super) fn allow(&mut self, objective: &Objective) -> bool {
        self.allow_up_to(SECOND_LOOK, objective)
    }

    /// Where the best candidate explains most: the next round looks again, with it in place.
    pub(super) fn allow_beside_most(&mut self, objective: &Objective) -> bool {
        self.allow_up_to(CHEAP_LOOK, objective)
    }

    fn allow_up_to(&mut self, share: f64, objective: &Objective) -> bool {
        let allowed = self.options.allows(share, objective.rollouts());
        self.refused |= !allowed;
        allowed
    }
}

/// The verdict of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The named effects, perhaps together with corrected values, explain the error.
    EffectMissing,
    /// Corrected values of the model explain the error; no effect is missing.
    ValueWrong,
    /// What is named explains most of the error, and something else is missing.
    PartlyExplained,
    /// The residual is noise.
    NothingMissing,
    /// No known effect explains the error.
    Unexplained,
}

/// What speaks for a finding besides its fit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evidence {
    /// The share of the squared error above the noise that it explains, on held-out logs if there are any.
    pub share: f64,
    /// The same share on the training logs.
    pub learnt_share: f64,
    /// The mean square error that it removes, in multiples of the noise's: on training or held-out logs, whichever is
    /// larger.
    pub removed: f64,
    /// Whether the share is of the error in the channel of its joint alone, as where the motion is prescribed.
    pub in_own_channel: bool,
    /// The share of the squared error above the noise, as it was without it, that it explains on training and held-out
    /// logs alike.
    pub of_rest: f64,
    /// In how many logs, held-out ones included, the error is smaller with it...
    pub logs_better: usize,
    /// ... and of how many.
    pub logs: usize,
    /// By what share of it the finding's size changes at most if one of the training logs is left out; none with one
    /// log alone.
    pub leave_one_out_change: Option<f64>,
    /// The index of that log.
    pub leave_one_out_log: Option<usize>,
    /// Whether it is established: what is found explains the error and this is more than a negligible part of it, or it
    /// explains a considerable share of it, or of what its joint would be left with, in nearly all logs. Otherwise it
    /// also helps a little.
    pub established: bool,
}

impl Evidence {
    /// Adds what another finding explained.
    pub(super) fn add(&mut self, other: &Evidence) {
        self.share += other.share;
        self.learnt_share += other.learnt_share;
        self.removed += other.removed;
        self.of_rest = self.of_rest.max(other.of_rest);
    }
}

/// Why a probability is not larger.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CapReason {
    /// The finding's size changes much if one of the training logs is left out.
    UnstableSize,
    /// Its size may be none by its own interval.
    UncertainSize,
    /// It is found beside several instances of a similar effect: together they can follow nearly any law.
    Series,
    /// Another effect is found at the same place: one that is not in the library may be behind both.
    SamePlace,
    /// It explains next to nothing, on training and held-out logs: two simulators differ by as much.
    LittleExplained,
    /// A free parameter ended at its bound, which is no limit of physics.
    ParameterAtBound,
    /// The findings leave an error, which another cause may be behind.
    ErrorLeft,
    /// A further candidate would still explain something for certain, but too little to be named.
    LeftOver,
}

/// The largest probability that a finding can have, whatever its rivals.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProbabilityCap {
    /// That probability.
    pub at_most: f64,
    /// Why it is not 1.
    pub reasons: Vec<CapReason>,
}

/// What else may be behind what a finding explains.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RivalProbability {
    /// `effect@site`; `None` for the model as it was without the finding.
    pub name: Option<String>,
    /// Its posterior probability.
    pub probability: f64,
}

impl RivalProbability {
    /// Those that are worth telling, the likeliest first.
    pub(super) fn likeliest(all: impl Iterator<Item = (Option<String>, f64)>) -> Vec<Self> {
        let told = all.filter(|(_, probability)| *probability >= TOLD);
        let mut told: Vec<Self> = told.map(|(name, probability)| RivalProbability { name, probability }).collect();
        told.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        told
    }
}

/// An effect that the model lacks, or a value that it states wrongly.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MissingEffect {
    /// Whether it is an effect or a value.
    #[serde(skip)]
    pub kind: CandidateKind,
    /// What speaks for it.
    #[serde(skip)]
    pub evidence: Evidence,
    /// Its name.
    pub effect: String,
    /// Its site.
    pub site: String,
    /// `effect@site` of the effects that these logs cannot distinguish from it.
    pub alike: Vec<String>,
    /// Its posterior probability among everything that was fitted in its round, including the model without it.
    /// Includes that of a larger law that it replaces.
    pub probability: f64,
    /// Who had the rest of it before it was capped, the likeliest first.
    #[serde(skip)]
    pub rivals: Vec<RivalProbability>,
    /// What caps it, if anything does.
    #[serde(skip)]
    pub probability_cap: Option<ProbabilityCap>,
    /// By how much it lowered B.
    pub delta_bic: f64,
    /// Its parameters.
    pub parameters: Vec<Estimate>,
    /// Indices of the candidates that did nearly as well when it was found, beside what was known then.
    #[serde(skip)]
    pub close: Vec<usize>,
    /// Whether it was taken for granted, and not compared with those yet.
    #[serde(skip)]
    pub is_granted: bool,
    /// Index of the candidate.
    #[serde(skip)]
    pub candidate: usize,
}

impl MissingEffect {
    /// A candidate with this index that lowered B by `delta_bic`, not weighed and without estimates.
    pub(super) fn of(index: usize, candidate: &EffectCandidate, probability: f64, delta_bic: f64) -> Self {
        MissingEffect {
            kind: candidate.kind,
            evidence: Evidence::default(),
            effect: candidate.effect.clone(),
            site: candidate.site.clone(),
            alike: Vec::new(),
            probability,
            rivals: Vec::new(),
            probability_cap: None,
            delta_bic,
            parameters: Vec::new(),
            close: Vec::new(),
            is_granted: false,
            candidate: index,
        }
    }

    /// Bounds the probability.
    pub(super) fn cap(&mut self, at_most: f64, reason: CapReason) {
        if self.probability >= at_most {
            self.probability = at_most;
            self.note_cap(at_most, reason);
        }
    }

    /// Multiplies the probability.
    pub(super) fn lower(&mut self, by: f64, reason: CapReason) {
        self.probability *= by;
        self.note_cap(by * self.probability_cap.as_ref().map_or(1.0, |cap| cap.at_most), reason);
    }

    /// Shares its probability with others, which these logs cannot tell from it. Their beliefs are given as multiples
    /// of its own.
    pub(super) fn share_with(&mut self, others: Vec<(String, f64)>) {
        let own = self.probability / (1.0 + others.iter().map(|(_, belief)| belief).sum::<f64>());
        self.probability = own;
        self.alike.extend(others.iter().map(|(name, _)| name.clone()));
        let others = others.into_iter().map(|(name, belief)| (Some(name), own * belief));
        let known = std::mem::take(&mut self.rivals).into_iter().map(|rival| (rival.name, rival.probability));
        self.rivals = RivalProbability::likeliest(known.chain(others));
    }

    /// Turns into another candidate, whose share of the probability it has from then on.
    pub(super) fn turn_into(&mut self, index: usize, candidate: &EffectCandidate) {
        let name = Some(candidate.name());
        let share = self.rivals.iter().filter(|rival| rival.name == name).map(|rival| rival.probability).sum::<f64>();
        self.probability = (self.probability + share).min(1.0);
        self.rivals.retain(|rival| rival.name != name);
        self.alike.retain(|alike| Some(alike) != name.as_ref());
        (self.effect, self.site) = (candidate.effect.clone(), candidate.site.clone());
        (self.candidate, self.kind) = (index, candidate.kind);
    }

    /// What another finding explained, this one explains in its place.
    pub(super) fn take_over(&mut self, other: &MissingEffect) {
        self.evidence.add(&other.evidence);
        self.delta_bic += other.delta_bic;
    }

    fn note_cap(&mut self, at_most: f64, reason: CapReason) {
        let mut reasons = self.probability_cap.take().map_or_else(Vec::new, |cap| cap.reasons);
        reasons.push(reason);
        self.probability_cap = Some(ProbabilityCap { at_most, reasons });
    }
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

/// A fitted candidate that the logs do not distinguish from others.
#[derive(Clone, Debug, PartialEq)]
pub struct RivalPoint {
    /// Index of the candidate.
    pub candidate: usize,
    /// One coordinate per parameter of the model.
    pub u: Vec<f64>,
}

/// A free parameter that may stand in for an effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StandIn {
    /// The parameter.
    pub parameter: String,
    /// Its unit.
    pub unit: String,
    /// Its value in the model.
    pub in_model: f64,
    /// Its value in the logs, without the effect.
    pub value: f64,
    /// `effect@site` of each effect that explains the logs as well while the parameter keeps the model's value.
    pub effects: Vec<String>,
}

/// The whole diagnosis.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// What was fitted in each round, best first.
    pub rounds: Vec<Vec<RankedCandidate>>,
    /// The verdict.
    pub verdict: Verdict,
    /// How far the error is explained.
    pub degree: Degree,
    /// What is left in each channel.
    pub left: Vec<RemainingError>,
    /// The missing effects, or those that lower the error without explaining it.
    pub effects: Vec<MissingEffect>,
    /// The error after each step.
    pub ladder: Vec<LadderStep>,
    /// Where something is found that explains the error: what would still lower B for certain, but by too little to be
    /// named.
    pub left_over: Option<RankedCandidate>,
    /// The share of the final squared error that is not noise: of held-out logs, if there are any, or, where an error
    /// is left, of the training logs if theirs is larger.
    pub unexplained_share: f64,
    /// The integrator's error in multiples of the noise floor, on the training or on the held-out logs, whichever is
    /// larger.
    pub integrator_error: f64,
    /// Free parameters that ended at a bound.
    pub at_bound: Vec<String>,
    /// The last fit, with everything that was accepted.
    pub fit: FitPoint,
    /// For the latest effect with any in `alike`: itself first, then its rivals. Input of the next experiment.
    pub rivals: Vec<RivalPoint>,
    /// With the verdict `Unexplained`: a law that fits the error, if there is one.
    pub residual_law: Option<ResidualLaw>,
    /// Where nothing is left to explain: free parameters that may stand in for an effect.
    pub stand_ins: Vec<StandIn>,
    /// Whether the limit of rollouts ended it.
    pub cut_short: bool,
    /// The logs, with the noise floors that errors are multiples of.
    pub logs: Vec<RecordedLog>,
    /// The glitches that showed beside a fitted model and were left out, each with its log.
    pub glitches: Vec<(usize, GlitchReport)>,
    /// Simulated logs.
    pub rollouts: usize,
}
