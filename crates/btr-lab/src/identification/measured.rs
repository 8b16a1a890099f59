//! Which channels and samples of the logs are compared.

use super::log_parts::LogPart;
use super::problem::IdentificationProblem;
use super::start;
use super::start::windows::Windows;
use crate::log_quality::torque_noise::{MotionNoise, TorqueChanges, draws, enough};
use btr_core::log::{Channel, Log, Role, interpolate};
use btr_core::world::WorldError;
use btr_identify::residual_model::{MeasuredChannel, RecordedLog, ResidualModel, ResidualRequest, TimeStep};
use btr_physics::model::{Model, Scenario};
use btr_physics::robot::Base;
use indexmap::IndexMap;
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;

/// Smallest change of a noise floor that counts, as a share of it.
const CHANGED: f64 = 0.03;
/// Largest error, in largest errors that count as noise, of a model that tells which torques are uncertain. Where more
/// is unexplained, they are needed to find out why.
const NEARLY: f64 = 2.0;

impl IdentificationProblem {
    /// Sets the compared channels of the logs, and their initial states as estimated by the model at `u`. A floating
    /// robot that rests first is simulated from a standing start if possible; otherwise by multiple shooting.
    pub(super) fn begin(&mut self, u: &[f64]) -> Result<(), WorldError> {
        if self.model.robot.base == Base::Floating && !self.rest(u)? {
            self.cut(u)?;
        }
        self.measure()
    }

    /// Sets the compared channels of the logs.
    pub(super) fn measure(&mut self) -> Result<(), WorldError> {
        self.logs = self.parts.iter().map(|part| self.measured(part)).collect::<Result<_, _>>()?;
        Ok(())
    }

    /// Drops the samples after a share of every log.
    pub(super) fn shorten(&mut self, share: f64) -> Result<(), WorldError> {
        for (scenario, log) in self.recorded.iter().enumerate() {
            let last = (share * log.len() as f64) as usize;
            let parts = self.parts.iter_mut().filter(|part| part.scenario == scenario);
            parts.for_each(|part| part.samples = part.samples.start.min(last)..part.samples.end.min(last));
            let situation = &mut self.situations[scenario];
            // One sample beyond the last compared one: clocks may be read late.
            situation.duration_s = situation.duration_s.min(log.clock_s()[last.min(log.len() - 1)] - log.clock_s()[0]);
        }
        self.measure()
    }

    /// Cuts the logs into windows for multiple shooting.
    pub(super) fn cut(&mut self, u: &[f64]) -> Result<(), WorldError> {
        let (values, placed) = (self.inner(u), self.placed(u));
        for (scenario, log) in self.recorded.iter().enumerate() {
            let situation = &self.model.scenarios[scenario];
            let Windows { restarts, samples } = start::windows::cut(&self.model, &values, &placed, situation, log)?;
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

    /// Lowers the noise floors of fast motion to those beside the model at `u`. A floating robot's motion departs too
    /// much from its model's.
    pub(super) fn lower_floors(&mut self, u: &[f64]) -> Result<(), WorldError> {
        let noise = &self.model.setup.noise;
        let known = compared(&self.model).all(|name| noise.states_white(&name));
        // Floors of the torques of a prescribed motion are not estimated from readings.
        if known || self.model.robot.base == Base::Floating || self.model.robot.is_prescribed() {
            return Ok(());
        }
        let scenarios = (0..self.recorded.len()).into_par_iter();
        self.floors_of_model = scenarios.map(|scenario| self.floors_beside_model(u, scenario)).collect();
        self.measure()
    }

    /// The noise floors of a scenario's log that are lower beside the model.
    fn floors_beside_model(&self, u: &[f64], scenario: usize) -> HashMap<String, f64> {
        // A log that cannot be simulated is reported where it is needed.
        let Ok(simulated) = self.simulate(u, scenario, TimeStep::USUAL) else { return HashMap::new() };
        let (log, noise) = (&self.recorded[scenario], &self.model.setup.noise);
        let lower = |name: String| {
            let readings = &log.channel(&name)?.values;
            let model = interpolate(simulated.clock_s(), simulated.values(&name).ok()?, log.clock_s());
            let floor = noise.floor_beside(&name, readings, &model)?;
            (floor < noise.floor(&name, readings)?).then_some((name, floor))
        };
        compared(&self.model).filter_map(lower).collect()
    }

    /// The problem with the noise floors of the torques that a prescribed motion requires of the model at `u`; where
    /// the model explains nearly all, also those of single samples at which dry friction may have either sign. `None`
    /// where they stay about the same.
    pub(super) fn with_torque_floors_at(&self, u: &[f64]) -> Option<Self> {
        if !self.model.robot.is_prescribed() {
            return None;
        }
        let longest = (0..self.model.learn.min(self.recorded.len())).max_by_key(|k| self.recorded[*k].len())?;
        let stood = self.changed_torques(&vec![0.0; u.len()], (longest, &enough(&self.recorded[longest])), 1)?;
        let is_first = self.uncertain.iter().all(HashMap::is_empty);
        let mut other = self.clone();
        let mut uncertain = self.uncertain.clone();
        let mut differs = false;
        for (scenario, log) in self.recorded.iter().enumerate() {
            let count = if is_first { draws(log) } else { 1 };
            let Some(stands) = self.changed_torques(u, (scenario, log), count) else { continue };
            for (name, TorqueChanges { deviation, outstanding }) in stands {
                let readings = |scenario: usize| self.recorded[scenario].channel(&name).map(|channel| &channel.values);
                let noise = |readings: &Vec<f64>| self.model.setup.noise.floor(&name, readings);
                let before = readings(longest).and_then(noise);
                let (Some(before), Some(stood)) = (before, stood.get(&name)) else { continue };
                // What is left without the motion's part is the sensor's noise.
                let floor = (before.powi(2) - stood.deviation.powi(2)).max(0.0).sqrt().hypot(deviation);
                let used = readings(scenario).and_then(|readings| self.floor(scenario, &name, readings));
                differs |= used.is_some_and(|used| (floor / used - 1.0).abs() > CHANGED);
                other.floors_of_model[scenario].insert(name.clone(), floor);
                if outstanding.iter().any(|change| *change > floor) {
                    uncertain[scenario].insert(name, outstanding.into());
                }
            }
        }
        other.measure().ok()?;
        let is_some = is_first && uncertain.iter().any(|names| !names.is_empty());
        let weighted = is_some.then(|| IdentificationProblem { uncertain, ..other.clone() });
        let weighted = weighted.filter(|weighted| weighted.error(u) <= NEARLY * weighted.noise_bound());
        weighted.or_else(|| differs.then_some(other))
    }

    /// The error at a point on the training or the held-out logs, whichever is larger; infinite if a simulation
    /// diverges.
    fn error(&self, u: &[f64]) -> f64 {
        let requests: Vec<ResidualRequest> =
            (0..self.logs.len()).map(|log| ResidualRequest { u, log, moved: &[] }).collect();
        let residuals = self.residuals(&requests, TimeStep::USUAL);
        let of = |held_out: bool| {
            let logs = self.logs.iter().zip(&residuals).filter(|(log, _)| log.held_out == held_out);
            let (squares, present) = logs.fold((0.0, 0), |(squares, present), (log, residual)| {
                let here = residual
                    .as_ref()
                    .map_or(f64::INFINITY, |r| r.iter().filter(|r| r.is_finite()).map(|r| r * r).sum());
                (squares + here, present + log.present)
            });
            (squares / present.max(1) as f64).sqrt()
        };
        of(false).max(of(true))
    }

    /// What the noise of a log's motion changes of the torques that the model at `u` requires, in so many draws; the
    /// log is that of a scenario, or its beginning.
    fn changed_torques(
        &self,
        u: &[f64],
        (scenario, log): (usize, &Log),
        draws: usize,
    ) -> Option<IndexMap<String, TorqueChanges>> {
        let motion = MotionNoise::of(&self.model, log, self.means_of);
        let simulate = |situation: &Scenario| self.simulate_in(u, situation, TimeStep::USUAL);
        motion.in_torques(&self.model, &self.situations[scenario], draws, &simulate).ok()
    }

    /// The noise floor of a channel of a scenario's log.
    fn floor(&self, scenario: usize, name: &str, readings: &[f64]) -> Option<f64> {
        let of_model = self.floors_of_model[scenario].get(name).copied();
        of_model.or_else(|| self.model.setup.noise.floor(name, readings))
    }

    /// The noise of a joint's reading; 0 if there is none.
    pub(super) fn noise(&self, log: &Log, joint: &str) -> f64 {
        let name = format!("q_{joint}");
        let channel = log.channel(&name);
        channel.and_then(|channel| self.model.setup.noise.floor(&name, &channel.values)).unwrap_or(0.0)
    }

    /// The compared channels of a log: positions, torques of joints with prescribed motion, and the angular velocity of
    /// a floating base.
    fn measured(&self, part: &LogPart) -> Result<RecordedLog, WorldError> {
        let recorded = &self.recorded[part.scenario];
        let (mut channels, mut present) = (Vec::new(), 0);
        let mut start = 0;
        for name in compared(&self.model) {
            let present_channel = |c: &&Channel| c.role == Role::Measured && c.values.iter().any(|x| x.is_finite());
            let Some(channel) = recorded.channel(&name).filter(present_channel) else { continue };
            let Some(sensor) = self.floor(part.scenario, &name, &channel.values) else { continue };
            let samples = start..start + recorded.len();
            start = samples.end;
            let here = channel.values.iter().enumerate().filter(|(i, x)| part.has(*i) && x.is_finite()).count();
            present += here;
            let unpredictable = self.model.setup.noise.unpredictable.beside(&name, sensor);
            // Where small errors grow, starts are estimated and floors raised window by window.
            let sigma = if self.model.robot.base == Base::Fixed { unpredictable } else { sensor };
            let offset_differs = self.model.setup.noise.unpredictable.has_offsets(&name);
            let unit = channel.unit.clone();
            channels.push(MeasuredChannel { name, unit, sigma, sensor, offset_differs, samples, present: here });
        }
        if channels.is_empty() {
            let what =
                format!("the log `{}` contains no channel of the model", self.model.scenarios[part.scenario].name);
            return Err(WorldError::Setup { what });
        }
        let name = self.model.scenarios[part.scenario].name.clone();
        Ok(RecordedLog { name, held_out: part.held_out, channels, present })
    }
}

/// Names of the channels that are compared.
fn compared(model: &Model) -> impl Iterator<Item = String> {
    let joints = model.robot.movable().map(|(_, link)| link.joint.compared());
    let floating = model.robot.base == Base::Floating && model.setup.sensors.imu;
    joints.chain(["x", "y", "z"].into_iter().filter(move |_| floating).map(|axis| format!("imu_gyro_{axis}")))
}
