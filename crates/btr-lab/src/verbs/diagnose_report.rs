//! The document of `diagnose`.

use super::adds_to::AddsTo;
use super::next_experiment::NextExperiment;
use crate::experiment::LeftOutLog;
use crate::identification::{Doubt, ErrorUnit, FittedGlitch, NoiseFloor, VerbInput};
use btr_identify::LadderStep;
use btr_identify::diagnose::{MissingEffect, ProbabilityCap, RankedCandidate, RivalProbability, StandIn, Verdict};
use btr_identify::fit::{Degree, Estimate, NOISE, RemainingError};
use btr_identify::residual_model::CandidateKind;
use btr_physics::effects::FormulaTarget;
use serde::Serialize;

/// Where an effect acts.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum EffectSite {
    /// On one joint or link, or on `base` or `*`.
    One(String),
    /// On several sites.
    Several(Vec<String>),
}

impl std::fmt::Display for EffectSite {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            EffectSite::One(site) => f.write_str(site),
            EffectSite::Several(sites) => f.write_str(&sites.join(", ")),
        }
    }
}

/// What speaks for a finding, an effect or a value.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Support {
    /// Names of effects and values that these logs cannot distinguish from it, as `name@site`.
    pub alike: Vec<String>,
    /// Its posterior probability among all candidates fitted in the same round.
    pub probability: f64,
    /// Why it is not larger, where that is not for its rivals.
    pub probability_cap: Option<ProbabilityCap>,
    /// Who has the rest of it, the likeliest first; before it was capped.
    pub rivals: Vec<RivalProbability>,
    /// Decrease of the information criterion.
    pub delta_bic: f64,
    /// The share of the squared error above the noise that it explains, on held-out logs if there are any.
    pub share: f64,
    /// The same share on the training logs; none without held-out logs.
    pub learnt_share: Option<f64>,
    /// Whether that is the error in the channel of its joint alone, as where the motion is prescribed: of an effect at
    /// several joints, the smallest share counts then.
    #[serde(skip)]
    pub in_own_channel: bool,
    /// In how many logs the error is smaller with it, held-out ones included, and of how many.
    pub logs_better: [usize; 2],
    /// By what share of it its size changes at most if one of the training logs is left out; none with one log alone.
    pub leave_one_out_change: Option<f64>,
    /// That log; none with one log alone.
    pub leave_one_out_log: Option<String>,
    /// Whether it is established; otherwise it also helps a little.
    pub established: bool,
}

impl Support {
    fn of(input: &VerbInput, found: &MissingEffect) -> Self {
        let evidence = found.evidence;
        let judged = input.problem.logs().iter().any(|log| log.held_out);
        Support {
            alike: found.alike.clone(),
            probability: found.probability,
            probability_cap: found.probability_cap.clone(),
            rivals: found.rivals.clone(),
            delta_bic: found.delta_bic,
            share: evidence.share,
            learnt_share: judged.then_some(evidence.learnt_share),
            in_own_channel: evidence.in_own_channel,
            logs_better: [evidence.logs_better, evidence.logs],
            leave_one_out_change: evidence.leave_one_out_change,
            leave_one_out_log: evidence.leave_one_out_log.and_then(|log| input.file_of(log)),
            established: evidence.established,
        }
    }

    /// That of an effect at several sites.
    fn join(&mut self, other: Support) {
        self.alike.extend(other.alike);
        if other.probability < self.probability {
            self.probability = other.probability;
            (self.probability_cap, self.rivals) = (other.probability_cap, other.rivals);
        }
        self.delta_bic += other.delta_bic;
        let apart = self.in_own_channel;
        let both = |a: f64, b: f64| if apart { a.min(b) } else { a + b };
        self.share = both(self.share, other.share);
        self.learnt_share = self.learnt_share.zip(other.learnt_share).map(|(a, b)| both(a, b));
        self.logs_better[0] = self.logs_better[0].min(other.logs_better[0]);
        if self.leave_one_out_change.unwrap_or(0.0) < other.leave_one_out_change.unwrap_or(0.0) {
            self.leave_one_out_change = other.leave_one_out_change;
            self.leave_one_out_log = other.leave_one_out_log;
        }
        self.established &= other.established;
    }
}

/// An effect that is missing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EffectReport {
    /// Its name.
    pub effect: String,
    /// Where it acts.
    pub site: EffectSite,
    /// What speaks for it.
    #[serde(flatten)]
    pub support: Support,
    /// Estimates of its parameters.
    pub parameters: Vec<Estimate>,
}

/// A value that the model states wrongly.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ValueReport {
    /// The quantity, or the effect of the model whose parameters these are.
    pub value: String,
    /// The joint or link, or the sites of the effect.
    pub site: String,
    /// What speaks for it.
    #[serde(flatten)]
    pub support: Support,
    /// The model's values and those of the logs.
    pub parameters: Vec<CorrectedValue>,
}

/// A value in the model and in the logs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CorrectedValue {
    /// In the logs.
    #[serde(flatten)]
    pub estimate: Estimate,
    /// In the model.
    pub in_model: f64,
}

/// A law that describes an error that no effect explains, and can be added to the model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LawReport {
    /// The law as a formula.
    pub law: String,
    /// The joint.
    pub site: String,
    /// The quantity that it changes.
    pub on: FormulaTarget,
    /// Share of the squared error above the noise that it explains on held-out logs.
    pub explains: f64,
    /// `effect@site` of the effects it was fitted together with; empty if it replaces all of them.
    pub beside: Vec<String>,
    /// TOML to paste into the model file.
    pub toml: String,
}

/// A channel whose readings are noisier than the model states.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StatedLow {
    /// The channel.
    pub channel: String,
    /// Its unit.
    pub unit: String,
    /// Standard deviation of its noise as stated in the model.
    pub stated: f64,
    /// Standard deviation of its noise as estimated from the readings.
    pub shown: f64,
}

/// The result of `diagnose`, with the keys of `--json`.
#[derive(Clone, Debug, Serialize)]
pub struct DiagnoseReport {
    /// Always true: failures have another document.
    pub ok: bool,
    /// The verdict.
    pub verdict: Verdict,
    /// How far the error is explained.
    pub degree: Degree,
    /// What is left in each channel, on held-out logs if there are any.
    pub remaining: Vec<RemainingError>,
    /// The missing effects; with the verdict `unexplained`, effects that help but do not explain.
    pub effects: Vec<EffectReport>,
    /// The values that the model states wrongly, in the same sense.
    pub wrong_values: Vec<ValueReport>,
    /// Error after each step, in multiples of the noise floor.
    pub error_ladder: Vec<LadderStep>,
    /// All fitted candidates, round by round, best first.
    pub ranking: Vec<Vec<RankedCandidate>>,
    /// The noise floors.
    pub noise_floor: Vec<NoiseFloor>,
    /// Share of the squared error that remains and is not noise.
    pub unexplained_share: f64,
    /// Where the verdict explains the error: a candidate that would still explain more for certain, but too little to
    /// be named. What is named may then stand in for something else.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_over: Option<RankedCandidate>,
    /// Where the verdict explains the error: free parameters that ended far from the model's values, while an effect
    /// would explain the logs as well with these values.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stand_ins: Vec<StandIn>,
    /// Where an error is left that follows no law: channels whose noise seems to be stated too low.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub noise_stated_low: Vec<StatedLow>,
    /// A law for the remaining error, where one is left.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub residual_law: Option<LawReport>,
    /// The experiment that best distinguishes the explanations that these logs cannot.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub next_experiment: Option<NextExperiment>,
    /// Discretisation error in multiples of the noise floor.
    pub integrator_error: f64,
    /// Time step of the diagnosis, in s; finer than the model's if that is too coarse.
    pub time_step_s: f64,
    /// Findings of `check` that make the result doubtful.
    pub doubts: Vec<Doubt>,
    /// Glitches that only a fitted model showed and that were left out.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub glitches: Vec<FittedGlitch>,
    /// Joints without measurements: the result does not cover them.
    pub not_judged: Vec<String>,
    /// Logs that could not be used.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOutLog>,
    /// Parameters that kept the model's values, by name.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frozen: Vec<String>,
    /// Free parameters whose prior is what earlier logs left (`sd` in the model file), by name.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub with_prior: Vec<String>,
    /// Free parameters that ended at a bound: the bounds may cause the remaining error.
    pub at_bound: Vec<String>,
    /// Those of them whose bound is one of physics, such as a friction of 0: it cannot be wider.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub at_limit: Vec<String>,
    /// Findings that add to a free parameter: the size of either depends on that parameter's bounds.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub adds_to: Vec<AddsTo>,
    /// Effects of the model, as `effect@site`, whose fitted values are those at which they do nothing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub without_effect: Vec<String>,
    /// Whether the diagnosis was stopped before it had finished: this is the best so far.
    pub cut_short: bool,
    /// Number of simulated logs.
    pub rollouts: usize,
    /// Wall time.
    pub seconds: f64,
}

impl DiagnoseReport {
    /// Whether an error is left that nothing explains.
    pub fn leaves_something(&self) -> bool {
        matches!(self.verdict, Verdict::Unexplained | Verdict::PartlyExplained)
    }

    /// What speaks for each finding, effects first.
    pub fn support(&self) -> impl Iterator<Item = &Support> {
        let effects = self.effects.iter().map(|effect| &effect.support);
        effects.chain(self.wrong_values.iter().map(|value| &value.support))
    }

    /// What is established: names for `--add`, of effects and of parameters of the model.
    pub fn names_to_add(&self) -> Vec<String> {
        let effects = self.effects.iter().filter(|effect| effect.support.established).flat_map(EffectReport::names);
        let values =
            self.wrong_values.iter().filter(|value| value.support.established).flat_map(|value| &value.parameters);
        effects.chain(values.map(|value| value.estimate.name.clone())).collect()
    }

    /// A message if the remaining error may be sensor noise.
    pub fn shows_noise(&self) -> Option<String> {
        let sentence = |low: &StatedLow| {
            format!("{} shows {:.2e} {}, {:.2e} is stated", low.channel, low.shown, low.unit, low.stated)
        };
        let all: Vec<String> = self.noise_stated_low.iter().map(sentence).collect();
        (!all.is_empty()).then(|| {
            format!(
                "what is left is white, as noise is, and above what [noise] states: {}; is that too low? Raise it, or leave it \
                 out and it is taken from the logs",
                all.join("; ")
            )
        })
    }

    /// A message if the findings leave something for certain that is too small to be named.
    pub fn shows_left_over(&self) -> Option<String> {
        let (left, last) = (self.left_over.as_ref()?, self.error_ladder.last()?);
        let times = ErrorUnit::of(&self.noise_floor).times();
        let held_out = last.held_out.map_or_else(String::new, |error| format!(" and {error:.2} on held-out logs"));
        Some(format!(
            "what is left counts as noise ({:.2} {times}{held_out}), so the verdict holds; but {} would lower it to {:.2} for \
             certain (delta BIC {:.0}), by less than the 5 % that a name needs: what is named may stand in for something else",
            last.train, left.name, left.train, left.delta_bic
        ))
    }

    /// A message if the training logs are explained and the held-out logs are not.
    pub fn shows_where_judged(&self) -> Option<String> {
        let last = self.error_ladder.last()?;
        let explained = last.train <= NOISE && self.leaves_something();
        explained.then(|| {
            format!(
                "the training logs are explained ({:.2} noise floors): the remaining error shows in the held-out logs alone, so train \
                 on one of these and hold out another",
                last.train
            )
        })
    }
}

/// Merges findings of one effect at several sites, those that cannot be told from others apart from the rest.
pub(super) fn grouped(input: &VerbInput, found: &[MissingEffect]) -> Vec<EffectReport> {
    let mut reports: Vec<EffectReport> = Vec::new();
    for one in found.iter().filter(|one| one.kind == CandidateKind::Effect) {
        let is_same = |report: &&mut EffectReport| {
            report.effect == one.effect && report.support.alike.is_empty() == one.alike.is_empty()
        };
        match reports.iter_mut().find(is_same) {
            Some(report) => report.join(input, one),
            None => reports.push(EffectReport {
                effect: one.effect.clone(),
                site: EffectSite::One(one.site.clone()),
                support: Support::of(input, one),
                parameters: one.parameters.clone(),
            }),
        }
    }
    reports
}

/// The findings that are values, with what the model states.
pub(super) fn wrong_values(input: &VerbInput, found: &[MissingEffect]) -> Vec<ValueReport> {
    let parameters = input.problem.parameters();
    let corrected = |estimate: &Estimate| {
        let in_model = parameters.iter().find(|parameter| parameter.name == estimate.name);
        Some(CorrectedValue { estimate: estimate.clone(), in_model: in_model?.origin })
    };
    let report = |one: &MissingEffect| ValueReport {
        value: one.effect.clone(),
        site: one.site.clone(),
        support: Support::of(input, one),
        parameters: one.parameters.iter().filter_map(corrected).collect(),
    };
    found.iter().filter(|one| one.kind == CandidateKind::Value).map(report).collect()
}

impl EffectReport {
    fn join(&mut self, input: &VerbInput, other: &MissingEffect) {
        let mut sites = match &self.site {
            EffectSite::One(site) => vec![site.clone()],
            EffectSite::Several(sites) => sites.clone(),
        };
        sites.push(other.site.clone());
        self.site = EffectSite::Several(sites);
        self.support.join(Support::of(input, other));
        self.parameters.extend(other.parameters.iter().cloned());
    }

    /// `effect@site` for each of its sites.
    pub fn names(&self) -> Vec<String> {
        match &self.site {
            EffectSite::One(site) => vec![format!("{}@{site}", self.effect)],
            EffectSite::Several(sites) => sites.iter().map(|site| format!("{}@{site}", self.effect)).collect(),
        }
    }
}
