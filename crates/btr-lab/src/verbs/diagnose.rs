//! `diagnose`: which physical effect is missing.

use super::next_experiment::NextExperiment;
use crate::identification::{Doubt, NoiseFloor, VerbInput};
use btr_core::signal::noise::NoiseEstimate;
use btr_core::signal::stats;
use btr_core::world::WorldError;
use btr_identify::LadderStep;
use btr_identify::diagnose::{DiagnoseOptions, Diagnosis, MissingEffect, RankedCandidate, Verdict};
use btr_identify::fit::{Estimate, NOISE, Objective};
use btr_identify::residual_model::ResidualModel;
use btr_physics::effects::FormulaTarget;
use serde::Serialize;
use std::time::Instant;

/// Where an effect sits.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum EffectSite {
    /// On one joint or link, or on `base` or `*`.
    One(String),
    /// On several.
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
    /// Where it sits.
    pub site: EffectSite,
    /// `effect@site` of what these logs cannot tell from it.
    pub alike: Vec<String>,
    /// How much of the belief it has among all that was fitted beside it.
    pub probability: f64,
    /// By how much it lowers the information criterion.
    pub delta_bic: f64,
    /// What it takes.
    pub parameters: Vec<Estimate>,
}

/// What an error looks like that no effect explains: a law that can be added to the model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LawReport {
    /// The law as a formula.
    pub law: String,
    /// The joint.
    pub site: String,
    /// What it is on.
    pub on: FormulaTarget,
    /// The share of the squared error above the noise that it explains on held-out logs.
    pub explains: f64,
    /// `effect@site` of the effects it was fitted beside; none where it takes the place of all.
    pub beside: Vec<String>,
    /// What to paste into the model.
    pub toml: String,
}

/// A channel whose readings are rougher than the model says.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StatedLow {
    /// The channel.
    pub channel: String,
    /// Its unit.
    pub unit: String,
    /// Standard deviation of its readings' errors as the model has it.
    pub stated: f64,
    /// The same as the readings show it.
    pub shown: f64,
}

/// The answer, with the keys of `--json`.
#[derive(Clone, Debug, Serialize)]
pub struct DiagnoseReport {
    /// Always true: failures are another document.
    pub ok: bool,
    /// The answer in a word.
    pub verdict: Verdict,
    /// What is missing; with the verdict `unexplained`, what helps and does not explain.
    pub effects: Vec<EffectReport>,
    /// How the error fell, in multiples of the noise floor.
    pub error_ladder: Vec<LadderStep>,
    /// Everything that was fitted, round by round, best first.
    pub ranking: Vec<Vec<RankedCandidate>>,
    /// The noise floors.
    pub noise_floor: Vec<NoiseFloor>,
    /// The share of the squared error that remains and is not noise.
    pub unexplained_share: f64,
    /// Where nothing explains the error and it may be the sensors' own: channels whose noise is stated too low, it
    /// seems.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub noise_stated_low: Vec<StatedLow>,
    /// What the error looks like where nothing known explains it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub residual_law: Option<LawReport>,
    /// What to do on the robot to tell apart what these logs cannot.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub next_experiment: Option<NextExperiment>,
    /// The integrator's own error in multiples of the noise floor.
    pub integrator_error: f64,
    /// The time step that it was diagnosed with, in s; finer than the model's own where that would err too much.
    pub time_step_s: f64,
    /// What makes the answer doubtful: the same checks as `check` makes.
    pub doubts: Vec<Doubt>,
    /// Joints of which nothing is measured: the answer is not about them.
    pub not_judged: Vec<String>,
    /// Parameters in doubt that ended at a bound: their bounds may be to blame for what remains.
    pub at_bound: Vec<String>,
    /// Simulated logs.
    pub rollouts: usize,
    /// Wall time.
    pub seconds: f64,
}

/// Finds out what is missing; `on_step` hears every step of the ladder.
/// `residual_model` is the problem's own, or the same served by others.
///
/// # Errors
/// The reason why the model cannot be simulated at its current values.
pub fn diagnose(
    input: &VerbInput,
    residual_model: &dyn ResidualModel,
    question: DiagnoseOptions,
    on_step: &dyn Fn(&LadderStep),
) -> Result<(DiagnoseReport, Diagnosis), WorldError> {
    let began = Instant::now();
    let mut objective = Objective::new(residual_model);
    let diagnosis = btr_identify::diagnose::diagnose(&mut objective, question, on_step)?;
    let report = DiagnoseReport {
        ok: true,
        verdict: diagnosis.verdict,
        effects: grouped(&diagnosis.effects),
        ranking: diagnosis.rounds.clone(),
        error_ladder: diagnosis.ladder.clone(),
        noise_floor: input.floors(),
        unexplained_share: diagnosis.unexplained_share,
        noise_stated_low: match diagnosis.verdict {
            Verdict::Unexplained => stated_low(input, &diagnosis),
            Verdict::EffectMissing | Verdict::NothingMissing => Vec::new(),
        },
        residual_law: residual_law(input, &diagnosis),
        next_experiment: input.next_experiment(&diagnosis.rivals),
        integrator_error: diagnosis.integrator_error,
        time_step_s: input.time_step_s(objective.step()),
        doubts: input.doubts.clone(),
        not_judged: input.not_judged.clone(),
        at_bound: diagnosis.at_bound.clone(),
        rollouts: diagnosis.rollouts,
        seconds: began.elapsed().as_secs_f64(),
    };
    Ok((report, diagnosis))
}

impl DiagnoseReport {
    /// Where what is left may be the sensors' own noise: to say so.
    pub fn shows_noise(&self) -> Option<String> {
        let told = |low: &StatedLow| {
            format!("{} shows {:.2e} {}, {:.2e} is stated", low.channel, low.shown, low.unit, low.stated)
        };
        let all: Vec<String> = self.noise_stated_low.iter().map(told).collect();
        (!all.is_empty()).then(|| {
            format!(
                "what is left is white, as noise is, and above what [noise] states: {}; is that too low? Raise it, or leave it \
                 out and it is taken from the logs",
                all.join("; ")
            )
        })
    }

    /// Where the logs to learn from are explained and those to judge on are not: what to make of that.
    pub fn shows_where_judged(&self) -> Option<String> {
        let last = self.error_ladder.last()?;
        let explained = last.train <= NOISE && self.verdict == Verdict::Unexplained;
        explained.then(|| {
            format!(
                "what is learnt from is explained ({:.2} noise floors): what remains shows in the held-out logs alone, so learn \
                 from one of these and hold out another",
                last.train
            )
        })
    }
}

/// What is left of a channel is as large as its own readings' noise within this factor.
const AS_LARGE: f64 = 1.15;
/// Samples that tell as much as one, where an error is noise.
const NEARLY_WHITE: f64 = 2.0;

/// Channels in which what is left is white, above the noise that the model states, and what their readings show of
/// noise.
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
            // Floors that are not the sensors' alone hold what nobody states.
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

/// One effect on several sites is one effect.
fn grouped(found: &[MissingEffect]) -> Vec<EffectReport> {
    let mut reports: Vec<EffectReport> = Vec::new();
    for one in found {
        match reports.iter_mut().find(|report| report.effect == one.effect) {
            Some(report) => report.join(one),
            None => reports.push(EffectReport {
                effect: one.effect.clone(),
                site: EffectSite::One(one.site.clone()),
                alike: one.alike.clone(),
                probability: one.probability,
                delta_bic: one.delta_bic,
                parameters: one.parameters.clone(),
            }),
        }
    }
    reports
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
