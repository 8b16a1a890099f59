//! `diagnose`: which physical effect is missing.

use super::next_experiment::NextExperiment;
use crate::experiment::Source;
use crate::identification::{Doubt, NoiseFloor, VerbInput};
use crate::model_text::{AddError, Addition, adapted, add_scaled, in_finer_steps};
use btr_core::signal::noise::NoiseEstimate;
use btr_core::signal::stats;
use btr_core::world::WorldError;
use btr_identify::LadderStep;
use btr_identify::diagnose::{DiagnoseOptions, Diagnosis, MissingEffect, RankedCandidate, Verdict};
use btr_identify::fit::{Estimate, FitPoint, NOISE, Objective, StopSignal};
use btr_identify::residual_model::{CandidateKind, ResidualModel, TimeStep};
use btr_physics::effects::FormulaTarget;
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

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

/// An effect that is missing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EffectReport {
    /// Its name.
    pub effect: String,
    /// Where it acts.
    pub site: EffectSite,
    /// `effect@site` of effects that these logs cannot distinguish from it.
    pub alike: Vec<String>,
    /// Its posterior probability among all candidates fitted in the same round.
    pub probability: f64,
    /// Decrease of the information criterion.
    pub delta_bic: f64,
    /// The share of the squared error above the noise that it explains, on held-out logs if there are any.
    pub share: f64,
    /// In how many of the logs the error is smaller with it, held-out ones included.
    pub logs_better: [usize; 2],
    /// Whether it is established; otherwise it also helps a little.
    pub established: bool,
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
    /// Names of effects and other values that these logs cannot distinguish from it.
    pub alike: Vec<String>,
    /// Its posterior probability among all candidates fitted in the same round.
    pub probability: f64,
    /// Decrease of the information criterion.
    pub delta_bic: f64,
    /// As for an effect.
    pub share: f64,
    /// As for an effect.
    pub logs_better: [usize; 2],
    /// As for an effect.
    pub established: bool,
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
    /// Where an error is left: channels whose noise seems to be stated too low.
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
    /// Joints without measurements: the result does not cover them.
    pub not_judged: Vec<String>,
    /// Free parameters that ended at a bound: the bounds may cause the remaining error.
    pub at_bound: Vec<String>,
    /// Whether the diagnosis was stopped before it had finished: this is the best so far.
    pub cut_short: bool,
    /// Number of simulated logs.
    pub rollouts: usize,
    /// Wall time.
    pub seconds: f64,
}

/// The model at the end of a diagnosis.
pub struct Diagnosed {
    /// The values of all parameters.
    pub fit: FitPoint,
    /// The effects and the values that were added to it.
    found: Vec<MissingEffect>,
    step: TimeStep,
}

impl VerbInput {
    /// The text of the diagnosed model for a file in the folder `into`: the effects that were found are in it as free
    /// parameters, and all parameters have their fitted values. The time step is that of the diagnosis.
    ///
    /// # Errors
    /// An effect that the model's text has already, which a diagnosis does not name.
    pub fn diagnosed_text(&self, diagnosed: &Diagnosed, into: &Path) -> Result<String, AddError> {
        let Diagnosed { fit, found, step } = diagnosed;
        let (problem, parameters) = (&self.problem, self.problem.parameters());
        let additions: Result<Vec<Vec<Addition>>, AddError> = found.iter().map(|one| self.addition(one)).collect();
        let text = add_scaled(&self.source, self.problem.scales(), &additions?.concat())?;
        let source = Source { text, ..self.source.clone() };
        let added = found.iter().flat_map(|found| problem.candidates()[found.candidate].parameters());
        let added = added.map(|k| (parameters[k].name.as_str(), parameters[k].value(fit.u[k])));
        let free = problem.model().simulations.dims().iter().map(|dim| dim.name.as_str()).zip(self.values(fit));
        let text = adapted(&source, free.chain(added), into)?;
        Ok(if *step == TimeStep::USUAL { text } else { in_finer_steps(&text, step.divides_by())? })
    }

    /// What adds a finding to the model's text.
    fn addition(&self, found: &MissingEffect) -> Result<Vec<Addition>, AddError> {
        let robot = &self.problem.model().robot;
        let value = |k: usize| {
            let parameter = &self.problem.parameters()[k];
            let bounds = [parameter.bounds.0, parameter.bounds.1].map(|u| parameter.value(u));
            Addition::value(&parameter.name, bounds, robot)
        };
        match found.kind {
            CandidateKind::Effect => Ok(vec![Addition::parse(&format!("{}@{}", found.effect, found.site), robot)?]),
            CandidateKind::Value => self.problem.candidates()[found.candidate].parameters().map(value).collect(),
        }
    }
}

/// Diagnoses the missing effects; `on_step` is called with every step of the error ladder. `residual_model` is the
/// input's problem, evaluated locally or by workers. Once `stop_signal` says so, the search ends with the best so far.
///
/// # Errors
/// The reason why the model cannot be simulated at its current values.
pub fn diagnose(
    input: &VerbInput,
    residual_model: &dyn ResidualModel,
    options: DiagnoseOptions,
    stop_signal: StopSignal,
    on_step: &dyn Fn(&LadderStep),
) -> Result<(DiagnoseReport, Diagnosed), WorldError> {
    let began = Instant::now();
    let mut objective = Objective::new(residual_model).stopping_when(stop_signal);
    let diagnosis = btr_identify::diagnose::diagnose(&mut objective, options, on_step)?;
    let report = DiagnoseReport {
        ok: true,
        verdict: diagnosis.verdict,
        effects: grouped(&diagnosis.effects),
        wrong_values: wrong_values(input, &diagnosis.effects),
        ranking: diagnosis.rounds.clone(),
        error_ladder: diagnosis.ladder.clone(),
        noise_floor: input.floors(),
        unexplained_share: diagnosis.unexplained_share,
        noise_stated_low: match diagnosis.verdict {
            Verdict::Unexplained | Verdict::PartlyExplained => stated_low(input, &diagnosis),
            Verdict::EffectMissing | Verdict::ValueWrong | Verdict::NothingMissing => Vec::new(),
        },
        residual_law: residual_law(input, &diagnosis),
        next_experiment: input.next_experiment(&diagnosis.rivals),
        integrator_error: diagnosis.integrator_error,
        time_step_s: input.time_step_s(objective.step()),
        doubts: input.doubts.clone(),
        not_judged: input.not_judged.clone(),
        at_bound: diagnosis.at_bound.clone(),
        cut_short: diagnosis.cut_short,
        rollouts: diagnosis.rollouts,
        seconds: began.elapsed().as_secs_f64(),
    };
    let step = objective.step();
    Ok((report, Diagnosed { fit: diagnosis.fit, found: diagnosis.effects, step }))
}

impl DiagnoseReport {
    /// Whether an error is left that nothing explains.
    pub fn leaves_something(&self) -> bool {
        matches!(self.verdict, Verdict::Unexplained | Verdict::PartlyExplained)
    }

    /// What is established: names for `--add`, of effects and of parameters of the model.
    pub fn names_to_add(&self) -> Vec<String> {
        let effects = self.effects.iter().filter(|effect| effect.established).flat_map(EffectReport::names);
        let values = self.wrong_values.iter().filter(|value| value.established).flat_map(|value| &value.parameters);
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

/// Factor within which the remaining error of a channel equals the noise of its readings.
const AS_LARGE: f64 = 1.15;
/// Largest autocorrelation time, in samples, of an error that counts as white.
const NEARLY_WHITE: f64 = 2.0;

/// Channels whose remaining error is white, exceeds the noise that the model states, and equals the noise of the
/// readings.
fn stated_low(input: &VerbInput, diagnosis: &Diagnosis) -> Vec<StatedLow> {
    let model = input.problem.model();
    let (mut found, mut start) = (Vec::<StatedLow>::new(), 0);
    for (log, readings) in input.problem.logs().iter().zip(input.problem.recorded()).filter(|(log, _)| !log.held_out) {
        for channel in &log.channels {
            let rows = start + channel.samples.start..start + channel.samples.end;
            let left = diagnosis.fit.residual.get(rows).unwrap_or_default();
            let stated = model.setup.noise.stated(&channel.name);
            let shown =
                readings.channel(&channel.name).and_then(|c| NoiseEstimate::of(&c.values)).map(|noise| noise.sigma());
            let (Some(stated), Some(shown)) = (stated, shown) else { continue };
            // A floor that was raised above the sensor's noise contains errors that the model does not state.
            let is_the_floor = (channel.sigma / stated - 1.0).abs() < 0.01;
            let times = stats::std(left);
            let as_large = times > AS_LARGE && shown > AS_LARGE * stated && times * stated < AS_LARGE * shown;
            if is_the_floor && as_large && stats::autocorrelation_time(left) < NEARLY_WHITE {
                let (name, unit) = (channel.name.clone(), channel.unit.clone());
                match found.iter_mut().find(|known| known.channel == name) {
                    Some(known) => known.shown = known.shown.max(shown),
                    None => found.push(StatedLow { channel: name, unit, stated, shown }),
                }
            }
        }
        start += log.rows();
    }
    found
}

fn residual_law(input: &VerbInput, diagnosis: &Diagnosis) -> Option<LawReport> {
    let found = diagnosis.residual_law.as_ref()?;
    let (site, on, law) = input.problem.law(found)?;
    let word = format!("{on:?}").to_lowercase();
    let toml = format!("[[effects]]\neffect = \"formula\"\nsite = \"{site}\"\non = \"{word}\"\nlaw = \"{law}\"\n");
    let effects = diagnosis.effects.iter().filter(|_| found.beside_effects);
    let beside = effects.map(|found| format!("{}@{}", found.effect, found.site)).collect();
    Some(LawReport { law, site, on, explains: found.explains, beside, toml })
}

/// Merges findings of one effect at several sites.
fn grouped(found: &[MissingEffect]) -> Vec<EffectReport> {
    let mut reports: Vec<EffectReport> = Vec::new();
    for one in found.iter().filter(|one| one.kind == CandidateKind::Effect) {
        match reports.iter_mut().find(|report| report.effect == one.effect) {
            Some(report) => report.join(one),
            None => reports.push(EffectReport {
                effect: one.effect.clone(),
                site: EffectSite::One(one.site.clone()),
                alike: one.alike.clone(),
                probability: one.probability,
                delta_bic: one.delta_bic,
                share: one.evidence.share,
                logs_better: [one.evidence.logs_better, one.evidence.logs],
                established: one.evidence.established,
                parameters: one.parameters.clone(),
            }),
        }
    }
    reports
}

/// The findings that are values, with what the model states.
fn wrong_values(input: &VerbInput, found: &[MissingEffect]) -> Vec<ValueReport> {
    let parameters = input.problem.parameters();
    let corrected = |estimate: &Estimate| {
        let in_model = parameters.iter().find(|parameter| parameter.name == estimate.name);
        Some(CorrectedValue { estimate: estimate.clone(), in_model: in_model?.origin })
    };
    let report = |one: &MissingEffect| ValueReport {
        value: one.effect.clone(),
        site: one.site.clone(),
        alike: one.alike.clone(),
        probability: one.probability,
        delta_bic: one.delta_bic,
        share: one.evidence.share,
        logs_better: [one.evidence.logs_better, one.evidence.logs],
        established: one.evidence.established,
        parameters: one.parameters.iter().filter_map(corrected).collect(),
    };
    found.iter().filter(|one| one.kind == CandidateKind::Value).map(report).collect()
}

impl EffectReport {
    fn join(&mut self, other: &MissingEffect) {
        let mut sites = match &self.site {
            EffectSite::One(site) => vec![site.clone()],
            EffectSite::Several(sites) => sites.clone(),
        };
        sites.push(other.site.clone());
        self.site = EffectSite::Several(sites);
        self.alike.extend(other.alike.iter().cloned());
        self.probability = self.probability.min(other.probability);
        self.delta_bic += other.delta_bic;
        self.share += other.evidence.share;
        self.logs_better[0] = self.logs_better[0].min(other.evidence.logs_better);
        self.established &= other.evidence.established;
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
