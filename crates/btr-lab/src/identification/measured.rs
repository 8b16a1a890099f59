//! Which channels and samples of the logs are compared.

use super::log_parts::LogPart;
use super::problem::IdentificationProblem;
use super::start;
use super::start::windows::Windows;
use btr_core::log::{Channel, Log, Role, interpolate};
use btr_core::world::WorldError;
use btr_identify::residual_model::{MeasuredChannel, RecordedLog, TimeStep};
use btr_physics::model::Model;
use btr_physics::robot::Base;
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;

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

    /// The noise floor of a channel of a scenario's log.
    pub(super) fn floor(&self, scenario: usize, name: &str, readings: &[f64]) -> Option<f64> {
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
            let beside = self.uncertain[part.scenario].get(&name).cloned().unwrap_or_default();
            channels.push(MeasuredChannel {
                name,
                unit,
                sigma,
                sensor,
                beside,
                offset_differs,
                samples,
                present: here,
            });
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
