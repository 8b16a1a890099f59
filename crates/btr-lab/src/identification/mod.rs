//! A model beside recorded logs, as a [`ResidualModel`](btr_identify::residual_model::ResidualModel): what is in doubt, and every effect of the library at every site
//! where it could sit.

mod candidates;
mod contact_probes;
pub(crate) mod excitation;
mod law_terms;
mod log_parts;
pub(crate) mod noise_floor;
mod parameters;
mod residuals;
pub(crate) mod scales;
mod sites;
mod start;

use btr_core::log::{Channel, Log, Role};
use btr_core::world::WorldError;
use btr_identify::diagnose::ResidualLaw;
use btr_identify::residual_model::{EffectCandidate, FitParameter, LawTerm, MeasuredChannel, RecordedLog, TimeStep};
use btr_physics::effects::{Effect, FormulaTarget, Param, PlacedEffect};
use btr_physics::model::{Model, ModelRequest, Scenario};
use btr_physics::robot::Base;
use law_terms::TermDefinition;
use log_parts::{LogPart, parts, whole};
use parameters::free_parameter;
use scales::RobotScales;
use sites::limbs;
pub(crate) use sites::sites;
pub(crate) use start::moved::seen_starts;
use start::windows::Windows;
use std::ops::Range;
use std::sync::Arc;

/// A model, the logs it is compared with, and all that may be varied.
#[derive(Clone)]
pub struct IdentificationProblem {
    model: Arc<Model>,
    recorded: Vec<Log>,
    /// The model's scenarios, with the restarts that the logs call for.
    situations: Vec<Scenario>,
    /// Whether it is a free robot that rests before every log.
    rests: bool,
    /// The logs' clocks, as laws count time.
    clocks_s: Vec<Vec<f64>>,
    parts: Vec<LogPart>,
    parameters: Vec<FitParameter>,
    free: Vec<usize>,
    candidates: Vec<EffectCandidate>,
    logs: Vec<RecordedLog>,
    scales: RobotScales,
    /// With windows: for each joint, the channels of the joints of its limb.
    limbs: Vec<Vec<String>>,
    /// The channels in which each candidate is felt first; none where it is felt everywhere.
    near: Vec<Vec<String>>,
    /// What stands behind each candidate.
    effects: Vec<&'static dyn Effect>,
    features: Vec<LawTerm>,
    /// What stands behind each feature.
    terms: Vec<(TermDefinition, &'static dyn Effect)>,
}

impl IdentificationProblem {
    /// Puts a model beside its logs: `recorded` in the order of the model's scenarios. `without` names effects that are not to
    /// be considered.
    ///
    /// # Errors
    /// A log without any measured channel that the model has; a model that blows up as it stands.
    pub fn new(model: Arc<Model>, recorded: Vec<Log>, without: &[&str]) -> Result<Self, WorldError> {
        let parts = parts(&model, &recorded);
        Self::in_parts(model, recorded, without, parts)
    }

    /// The same with every log to learn from, whole.
    ///
    /// # Errors
    /// See [`new`](Self::new).
    pub fn to_learn(model: Arc<Model>, recorded: Vec<Log>) -> Result<Self, WorldError> {
        let parts = whole(&recorded);
        Self::in_parts(model, recorded, &[], parts)
    }

    /// The same family beside other logs of the same scenarios, none held out, with the sensors' noise alone for a floor; their
    /// starts as the model at `u` sees them.
    pub(crate) fn beside_others(&self, model: Arc<Model>, recorded: Vec<Log>, u: &[f64]) -> Result<Self, WorldError> {
        let parts = whole(&recorded);
        let other = Self::without_effects(model, recorded, parts)?;
        let (parameters, candidates, features) =
            (self.parameters.clone(), self.candidates.clone(), self.features.clone());
        let (effects, terms) = (self.effects.clone(), self.terms.clone());
        let mut other = IdentificationProblem {
            parameters,
            candidates,
            features,
            effects,
            terms,
            near: self.near.clone(),
            ..other
        };
        other.begin(u)?;
        Ok(other)
    }

    /// The logs' channels, to change their floors.
    pub(crate) fn floors(&mut self) -> impl Iterator<Item = &mut RecordedLog> {
        self.logs.iter_mut()
    }

    /// The scenario of a log.
    pub(crate) fn scenario(&self, log: usize) -> usize {
        self.parts[log].scenario
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
        if problem.is_chaotic() {
            noise_floor::raise(&mut problem, &origin)?;
        }
        problem.offer_effects(without);
        if problem.is_chaotic() {
            contact_probes::enlarge(&mut problem)?;
        }
        problem.offer_terms()?;
        Ok(problem)
    }

    fn without_effects(model: Arc<Model>, recorded: Vec<Log>, parts: Vec<LogPart>) -> Result<Self, WorldError> {
        let scales = RobotScales::of(&model, &recorded)?;
        Ok(IdentificationProblem {
            parameters: model.simulations.dims().iter().map(|dim| free_parameter(dim, &scales)).collect(),
            free: (0..model.simulations.len()).collect(),
            candidates: Vec::new(),
            logs: Vec::new(),
            effects: Vec::new(),
            features: Vec::new(),
            terms: Vec::new(),
            limbs: limbs(&model.robot),
            near: Vec::new(),
            scales,
            parts,
            situations: model.scenarios.clone(),
            rests: false,
            clocks_s: model.scenarios.iter().zip(&recorded).map(by_laws).collect(),
            model,
            recorded,
        })
    }

    /// Says what is compared of the logs, and where that begins as the model at `u` sees it. A free robot that rests first is
    /// simulated from there, if it can be; else it is found in its log, window by window.
    fn begin(&mut self, u: &[f64]) -> Result<(), WorldError> {
        if self.model.robot.base == Base::Floating && !self.rest(u)? {
            self.cut(u)?;
        }
        self.measure()
    }

    /// Says which channels of the logs are compared.
    fn measure(&mut self) -> Result<(), WorldError> {
        self.logs = self.parts.iter().map(|part| self.measured(part)).collect::<Result<_, _>>()?;
        Ok(())
    }

    /// Forgets what comes after a share of every log.
    fn shorten(&mut self, share: f64) -> Result<(), WorldError> {
        for (scenario, log) in self.recorded.iter().enumerate() {
            let last = (share * log.len() as f64) as usize;
            let own = self.parts.iter_mut().filter(|part| part.scenario == scenario);
            own.for_each(|part| part.samples = part.samples.start.min(last)..part.samples.end.min(last));
            let situation = &mut self.situations[scenario];
            // A sample further than the last one that counts: clocks may be read late.
            situation.duration_s = situation.duration_s.min(log.clock_s()[last.min(log.len() - 1)] - log.clock_s()[0]);
        }
        self.measure()
    }

    /// Cuts the logs into windows.
    fn cut(&mut self, u: &[f64]) -> Result<(), WorldError> {
        let (own, placed) = (self.inner(u), self.placed(u));
        for (scenario, log) in self.recorded.iter().enumerate() {
            let situation = &self.model.scenarios[scenario];
            let Windows { restarts, samples } = start::windows::cut(&self.model, &own, &placed, situation, log)?;
            self.situations[scenario].restarts = restarts.into();
            let noise: Vec<f64> =
                self.model.robot.movable().map(|(_, link)| self.noise(log, &link.joint.name)).collect();
            for part in self.parts.iter_mut().filter(|part| part.scenario == scenario) {
                let within =
                    |window: &Range<usize>| window.start.max(part.samples.start)..window.end.min(part.samples.end);
                part.noise.clone_from(&noise);
                part.windows = samples.iter().map(within).filter(|window| !window.is_empty()).collect();
            }
        }
        Ok(())
    }

    /// The noise of a joint's reading; 0 where there is none.
    fn noise(&self, log: &Log, joint: &str) -> f64 {
        let name = format!("q_{joint}");
        let channel = log.channel(&name);
        channel.and_then(|channel| self.model.setup.noise.floor(&name, &channel.values)).unwrap_or(0.0)
    }

    /// Whether a channel's noise floor is a guess, in the first log that has the channel.
    pub(crate) fn is_assumed(&self, name: &str) -> bool {
        let first = self.recorded.iter().find_map(|log| log.channel(name));
        first.is_some_and(|channel| self.model.setup.noise.is_assumed(name, &channel.values))
    }

    /// The model as it stands.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// The logs, in the order of the model's scenarios.
    pub fn recorded(&self) -> &[Log] {
        &self.recorded
    }

    /// What is large and what is small for this robot.
    pub(crate) fn scales(&self) -> &RobotScales {
        &self.scales
    }

    /// What is simulated at a point beside the log of a scenario; with windows, from where the log has the robot at each start.
    ///
    /// # Errors
    /// A simulation that blew up.
    pub fn simulate(&self, u: &[f64], scenario: usize, step: TimeStep) -> Result<Log, WorldError> {
        self.simulate_in(u, &self.situations[scenario], step)
    }

    /// What is simulated at a point in a situation of its own.
    ///
    /// # Errors
    /// A simulation that blew up.
    pub fn simulate_in(&self, u: &[f64], scenario: &Scenario, step: TimeStep) -> Result<Log, WorldError> {
        self.model.simulate(ModelRequest::new(&self.inner(u), scenario).effects(&self.placed(u)).time_step(step))
    }

    /// The values of what is in doubt at a point.
    pub(crate) fn inner(&self, u: &[f64]) -> Vec<f64> {
        self.free.iter().map(|&k| self.inside(k, self.parameters[k].value(u[k]))).collect()
    }

    /// The scenarios of the logs that are learnt from.
    pub(crate) fn learnt(&self) -> Vec<usize> {
        self.parts.iter().filter(|part| !part.held_out).map(|part| part.scenario).collect()
    }

    /// Whether all joints stay where the logs had them, give or take a share of that range.
    pub(crate) fn is_within(&self, log: &Log, margin: f64) -> bool {
        let mut joints = self.model.robot.movable().map(|(_, link)| &link.joint.name);
        joints.all(|joint| {
            let (low, high) = self.range(joint);
            let margin = margin * (high - low);
            let values = log.channel(&format!("q_{joint}")).map_or(&[][..], |channel| &channel.values);
            values.iter().all(|x| *x >= low - margin && *x <= high + margin)
        })
    }

    /// The effects that are switched on at a point.
    pub fn placed(&self, u: &[f64]) -> Vec<PlacedEffect> {
        let on = |candidate: &&EffectCandidate| candidate.amplitudes.iter().any(|&k| u[k] != 0.0);
        let pairs = self.candidates.iter().zip(&self.effects);
        let effects =
            pairs.filter(|(candidate, _)| on(candidate)).map(|(candidate, effect)| self.place(candidate, *effect, u));
        let terms = self.features.iter().zip(&self.terms).filter(|(feature, _)| on(&&feature.term));
        let terms = terms.map(|(feature, (_, effect))| {
            let values = feature.term.parameters().map(|k| self.parameters[k].value(u[k])).collect();
            PlacedEffect { effect: *effect, site: feature.term.site.clone(), values }
        });
        effects.chain(terms).collect()
    }

    /// Where a law sits, what it is on, and its text.
    pub fn law(&self, law: &ResidualLaw) -> Option<(String, FormulaTarget, String)> {
        let first = *law.terms.first()?;
        let values = |&i: &usize| {
            let parameters = self.features[i].term.parameters();
            (&self.terms[i].0, parameters.map(|k| self.parameters[k].value(law.fit.u[k])).collect())
        };
        let on = self.terms[first].0.on;
        let terms: Vec<(&TermDefinition, Vec<f64>)> = law.terms.iter().map(values).collect();
        Some((self.features[first].term.site.clone(), on, law_terms::law(on, &terms)))
    }

    fn place(&self, candidate: &EffectCandidate, effect: &'static dyn Effect, u: &[f64]) -> PlacedEffect {
        let (mut amplitudes, mut shapes) = (candidate.amplitudes.iter(), candidate.shapes.iter());
        let parameter = |param: &Param| if param.shape { shapes.next() } else { amplitudes.next() };
        let parameters: Vec<Option<&usize>> = effect.spec().params.iter().map(parameter).collect();
        // Rounding must not carry a value across the bound at which its sign would change.
        let least = |param: &Param| param.bounds.0.min(0.0);
        let value = |(parameter, param): (Option<&usize>, &Param)| {
            parameter.map_or(param.off, |&k| self.parameters[k].value(u[k]).max(least(param)))
        };
        let values = parameters.into_iter().zip(effect.spec().params).map(value).collect();
        PlacedEffect { effect, site: candidate.site.clone(), values }
    }

    /// Rounding must not carry a value across its bound.
    fn inside(&self, k: usize, value: f64) -> f64 {
        let dim = &self.model.simulations.dims()[k];
        value.clamp(dim.min, dim.max)
    }

    /// The channels of a log that are compared: positions, torques of joints whose motion is prescribed, and how a
    /// floating base turns.
    fn measured(&self, part: &LogPart) -> Result<RecordedLog, WorldError> {
        let recorded = &self.recorded[part.scenario];
        let (mut channels, mut present) = (Vec::new(), 0);
        let mut start = 0;
        for name in compared(&self.model) {
            let there = |c: &&Channel| c.role == Role::Measured && c.values.iter().any(|x| x.is_finite());
            let Some(channel) = recorded.channel(&name).filter(there) else { continue };
            let Some(sigma) = self.model.setup.noise.floor(&name, &channel.values) else { continue };
            let samples = start..start + recorded.len();
            start = samples.end;
            present += channel.values.iter().enumerate().filter(|(i, x)| part.has(*i) && x.is_finite()).count();
            channels.push(MeasuredChannel { name, unit: channel.unit.clone(), sigma, samples });
        }
        if channels.is_empty() {
            let what =
                format!("the log `{}` measures nothing that the model has", self.model.scenarios[part.scenario].name);
            return Err(WorldError::Setup { what });
        }
        let name = self.model.scenarios[part.scenario].name.clone();
        Ok(RecordedLog { name, held_out: part.held_out, channels, present })
    }

    /// Least and greatest position of a joint in all logs.
    fn range(&self, joint: &str) -> (f64, f64) {
        let name = format!("q_{joint}");
        let values = self.recorded.iter().filter_map(|log| log.channel(&name)).flat_map(|channel| &channel.values);
        let finite = values.copied().filter(|x| x.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        if low < high { (low, high) } else { (-1.0, 1.0) }
    }

    /// Length of the longest log.
    fn longest_s(&self) -> f64 {
        self.recorded.iter().map(Log::duration_s).fold(f64::MIN_POSITIVE, f64::max)
    }
}

/// The clock of a log, as laws count time.
fn by_laws((scenario, log): (&Scenario, &Log)) -> Vec<f64> {
    log.clock_s().iter().map(|t| scenario.begins_s + t).collect()
}

/// Names of the channels that are compared.
fn compared(model: &Model) -> impl Iterator<Item = String> {
    let joints = model.robot.movable().map(|(_, link)| link.joint.compared());
    let floating = model.robot.base == Base::Floating && model.setup.sensors.imu;
    joints.chain(["x", "y", "z"].into_iter().filter(move |_| floating).map(|axis| format!("imu_gyro_{axis}")))
}
