//! Residuals of the identification problem: measured minus simulated, at any point and from any start state.

mod joint_laws;
mod limbs;

use crate::identification::contact::noise_floor;
use crate::identification::problem::IdentificationProblem;
use crate::identification::simulated::ModelPoint;
use crate::identification::start::moved::OPEN;
use crate::identification::start::windows;
use btr_core::log::{Log, interpolate};
use btr_core::signal::repeats::{largest_ratio, ratio_deviation};
use btr_core::world::{Simulator, WorldError};
use btr_identify::fit::NOISE;
use btr_identify::residual_model::{
    Derivation, EffectCandidate, FitParameter, LogStart, MeasuredChannel, ModelDescription, RecordedLog, ResidualModel,
    ResidualRequest, StartNumber, TimeStep,
};
use btr_physics::model::{ModelRequest, Scenario};
use btr_physics::robot::{Actuator, Base, Link};
use btr_physics::sensor::RunNoise;
use std::borrow::Cow;

/// Share of a log that counts as its beginning.
const BEGINNING: f64 = 0.3;

impl ResidualModel for IdentificationProblem {
    fn description(&self) -> ModelDescription {
        let clock = |log: usize| self.clocks_s[self.parts[log].scenario].clone();
        ModelDescription {
            free: self.free.clone(),
            candidates: self.candidates.clone(),
            candidate_channels: self.near.clone(),
            limb_parameters: self.limb_parameters(),
            joining: self.joining(),
            joint_laws: self.joint_laws(),
            inertial: self.inertial(),
            inertial_unless: self.inertial_unless(),
            law_terms: self.features.clone(),
            clocks_s: (0..self.logs.len()).map(clock).collect(),
            measured: (0..self.logs.len()).map(|log| self.measured_values(log)).collect(),
            glitches: self.glitches_of_logs(),
            starts: (0..self.logs.len()).map(|log| self.start(log)).collect(),
            // For a floating robot, one nudge is one standard deviation of the initial state.
            start_spread: if self.model.robot.base == Base::Fixed { f64::INFINITY } else { 1.0 },
            batch_size: self.model.side_by_side(),
            order: self.model.order(),
            has_contact: self.model.has_contact(),
            is_chaotic: self.is_chaotic(),
            is_decoupled: self.model.robot.is_prescribed(),
            has_runs: self.logs.iter().flat_map(|log| &log.channels).any(MeasuredChannel::is_of_runs),
            noise_bound: self.noise_bound(),
            ..ModelDescription::new(self.parameters.clone(), self.logs.clone())
        }
    }

    fn residuals(&self, requests: &[ResidualRequest], step: TimeStep) -> Vec<Result<Vec<f64>, WorldError>> {
        let point = |of: &ResidualRequest| (self.at(of.u), self.begun_from(of.log, of.moved));
        let points: Vec<(ModelPoint, Cow<Scenario>)> = requests.iter().map(point).collect();
        let points: Vec<ModelRequest> =
            points.iter().map(|(point, scenario)| point.request(scenario).time_step(step)).collect();
        let simulated = self.model.simulate_all(points);
        requests.iter().zip(simulated).map(|(of, simulated)| self.against(of.log, &simulated?)).collect()
    }

    fn joint_parts(&self, requests: &[ResidualRequest], step: TimeStep) -> Vec<Result<Vec<f64>, WorldError>> {
        let part = |of: &ResidualRequest| {
            let scenario = self.begun_from(of.log, of.moved);
            let torques = self.model.joint_torques(&self.at(of.u).request(&scenario).time_step(step))?;
            Ok(self.contributed(of.log, &torques))
        };
        requests.iter().map(part).collect()
    }

    fn inertias(&self, u: &[f64], log: usize) -> Option<Vec<f64>> {
        let scenario = self.begun_from(log, &[]);
        self.model.inertias(&self.at(u).request(&scenario)).ok()
    }

    fn sizes(&self, parameter: usize, residuals: &[(usize, &[f64])]) -> Vec<(f64, f64)> {
        self.searched_sizes(parameter, residuals)
    }

    fn derive(&self, derivation: &Derivation) -> Option<Box<dyn ResidualModel>> {
        let derived = match derivation {
            Derivation::Beginnings => self.beginnings()?,
            Derivation::WithStartsAt(u) => self.with_starts_at(u)?,
            Derivation::WithInitialState(moved) => self.with_initial_states(moved),
            Derivation::InWindows => self.in_windows()?,
            Derivation::WithoutGlitchesAt(u) => self.without_glitches_at(u)?,
            Derivation::WithTorqueFloorsAt(u) => self.with_torque_floors_at(u)?,
            Derivation::WithNoisierMotion(draw) => self.with_noisier_motion(*draw)?,
        };
        Some(Box::new(derived))
    }
}

impl IdentificationProblem {
    /// Everything that may be varied.
    pub fn parameters(&self) -> &[FitParameter] {
        &self.parameters
    }

    /// Indices of the parameters that are fitted from the beginning.
    pub fn free(&self) -> &[usize] {
        &self.free
    }

    /// Effects that may be missing.
    pub fn candidates(&self) -> &[EffectCandidate] {
        &self.candidates
    }

    /// The logs; training logs first.
    pub fn logs(&self) -> &[RecordedLog] {
        &self.logs
    }

    /// Whether small errors grow: the logs are compared in windows.
    pub fn is_chaotic(&self) -> bool {
        self.parts.iter().any(|part| !part.windows.is_empty())
    }

    /// The residual of one request; see [`ResidualModel::residuals`].
    ///
    /// # Errors
    /// A simulation that diverges or cannot be set up.
    pub fn residual(&self, request: ResidualRequest, step: TimeStep) -> Result<Vec<f64>, WorldError> {
        (self as &dyn ResidualModel).residual(request, step)
    }

    /// The largest error of a model without a fault, in the units of residuals. How far runs differ is the less certain
    /// the fewer of them there are, the longer what differs lasts, and the more channels share it.
    pub(super) fn noise_bound(&self) -> f64 {
        let runs = &self.model.setup.noise.unpredictable.channels;
        let deviation = |held_out: bool| {
            let logs = self.logs.iter().filter(|log| log.held_out == held_out);
            let channels: Vec<&MeasuredChannel> = logs.flat_map(|log| &log.channels).collect();
            let samples: usize = channels.iter().map(|channel| channel.samples.len()).sum();
            let share = |name: &str| {
                let of_channel = channels.iter().filter(|channel| channel.name == name && channel.is_of_runs());
                of_channel.map(|channel| channel.samples.len() as f64).sum::<f64>()
            };
            let of_channel = |(name, noise): (&String, &RunNoise)| {
                let count = share(name);
                count / samples.max(1) as f64 * ratio_deviation(count / noise.memory, noise.freedom)
            };
            let deviations: Vec<f64> = runs.iter().map(of_channel).collect();
            let row = |(a, noise): (&f64, &RunNoise)| {
                noise.shared.iter().zip(&deviations).map(|(shared, b)| shared * a * b).sum::<f64>()
            };
            deviations.iter().zip(runs.values()).map(row).sum::<f64>().sqrt()
        };
        NOISE.max(largest_ratio(deviation(false).max(deviation(true))))
    }

    /// The measured values of a log's compared channels, in the rows of its residual.
    fn measured_values(&self, log: usize) -> Vec<f64> {
        let recorded = &self.recorded[self.parts[log].scenario];
        let values = |name: &str| recorded.channel(name).map_or(&[][..], |channel| &channel.values);
        self.logs[log].channels.iter().flat_map(|channel| values(&channel.name)).copied().collect()
    }

    /// Description of a log's initial state.
    fn start(&self, log: usize) -> LogStart {
        let number = |number: usize| StartNumber {
            channels: self.start_channels(log, number),
            // The start of a floating robot is estimated differently.
            search_sd: (self.model.robot.base == Base::Fixed).then(|| OPEN[number % 2]),
        };
        let same = |other: &usize| self.parts[*other].scenario == self.parts[log].scenario;
        LogStart {
            numbers: (0..self.start_numbers(log)).map(number).collect(),
            windows: self.parts[log].windows.clone(),
            begins_with: (0..self.parts.len()).find(same).unwrap_or(log),
        }
    }

    /// Number of uncertain coordinates of a log's initial state.
    fn start_numbers(&self, log: usize) -> usize {
        match (self.model.robot.base, self.parts[log].windows.len()) {
            (Base::Fixed, 0) => 2 * self.nudged(log).count(),
            // The windows' numbers count all joints, also those without readings, whose nudges have no size.
            (Base::Fixed, _) => 2 * self.model.robot.movable().count(),
            (Base::Floating, 0) if self.rests => self.nudged(log).count(),
            // A log too short for a window has no estimated initial state.
            (Base::Floating, 0) => 0,
            (Base::Floating, _) => windows::nudges(self.model.robot.movable().count()),
        }
    }

    /// Names of the channels in which a coordinate of a log's initial state shows; empty if it shows in all.
    fn start_channels(&self, log: usize, number: usize) -> Vec<String> {
        let windows = !self.parts[log].windows.is_empty();
        match self.model.robot.base {
            Base::Fixed if windows => Vec::new(),
            Base::Fixed => {
                let joint = self.nudged(log).nth(number / 2).map(|(joint, _)| joint);
                joint.map_or_else(Vec::new, |joint| self.channels_beside(joint))
            }
            Base::Floating if windows => windows::nudged_joint(number, self.model.robot.movable().count())
                .map_or_else(Vec::new, |joint| self.limbs[joint].clone()),
            Base::Floating => Vec::new(),
        }
    }

    /// The problem with only the beginnings of its logs.
    fn beginnings(&self) -> Option<Self> {
        if !self.model.has_contact() || self.is_chaotic() {
            return None;
        }
        let mut other = self.clone();
        other.shorten(BEGINNING).ok()?;
        Some(other)
    }

    /// The problem of a fixed robot with its logs cut into windows.
    fn in_windows(&self) -> Option<Self> {
        let prescribed = |(_, link): (usize, &Link)| link.joint.actuator == Actuator::Prescribed;
        let shows_no_more = self.model.robot.movable().any(prescribed) || self.is_chaotic();
        if self.model.robot.base == Base::Floating || self.model.has_contact() || shows_no_more {
            return None;
        }
        let mut other = self.clone();
        let origin = vec![0.0; self.parameters.len()];
        other.cut(&origin).and_then(|()| other.measure()).ok()?;
        other.is_chaotic().then_some(other)
    }

    /// The problem with starts and noise floors from the model at `u`.
    fn with_starts_at(&self, u: &[f64]) -> Option<Self> {
        if self.model.robot.base == Base::Fixed {
            return None;
        }
        let mut other = self.clone();
        let differs = if self.is_chaotic() {
            let cut = other.cut(u).and_then(|()| other.measure()).and_then(|()| noise_floor::raise(&mut other, u));
            cut.is_ok()
        } else {
            other.rest_from_another_past(u).unwrap_or(false)
        };
        differs.then_some(other)
    }

    /// Joints whose start is measured with noise, as indices in the scenario's start, with the noise.
    pub(in crate::identification) fn nudged(&self, log: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let joints = 0..self.model.scenarios[self.parts[log].scenario].start.len();
        joints.zip(self.model.robot.movable()).filter_map(move |(i, (_, link))| {
            let name = format!("q_{}", link.joint.name);
            Some((i, self.logs[log].channels.iter().find(|channel| channel.name == name)?.sensor))
        })
    }

    /// Measured minus simulated in a log, in multiples of the noise floor.
    pub(in crate::identification) fn against(&self, log: usize, simulated: &Log) -> Result<Vec<f64>, WorldError> {
        let part = &self.parts[log];
        let recorded = &self.recorded[part.scenario];
        let mut residual = Vec::with_capacity(self.logs[log].channels.len() * recorded.len());
        for channel in &self.logs[log].channels {
            let predicted = interpolate(simulated.clock_s(), simulated.values(&channel.name)?, recorded.clock_s());
            let pairs = recorded.values(&channel.name)?.iter().zip(predicted).enumerate();
            let error = |(i, (measured, predicted)): (usize, (&f64, f64))| {
                if part.has(i) { (measured - predicted) / channel.sigma_at(i) } else { f64::NAN }
            };
            residual.extend(pairs.map(error));
        }
        Ok(residual)
    }

    /// What torques at joints contribute to the residual of a log.
    fn contributed(&self, log: usize, torques: &Log) -> Vec<f64> {
        let recorded = &self.recorded[self.parts[log].scenario];
        let mut residual = Vec::with_capacity(self.logs[log].rows());
        for channel in &self.logs[log].channels {
            match torques.channel(&channel.name) {
                Some(torque) => {
                    let predicted = interpolate(torques.clock_s(), &torque.values, recorded.clock_s());
                    residual.extend(predicted.iter().enumerate().map(|(i, torque)| -torque / channel.sigma_at(i)));
                }
                None => residual.resize(residual.len() + channel.samples.len(), 0.0),
            }
        }
        residual
    }
}
