//! Noise floors of the torques that a prescribed motion requires, from the model at a point: those of each log, and
//! those of single samples at which noise decides the sign of dry friction.

use super::problem::IdentificationProblem;
use crate::log_quality::torque_noise::{MotionNoise, TorqueChanges, draws, enough};
use btr_core::log::Log;
use btr_identify::residual_model::{ResidualModel, ResidualRequest, TimeStep};
use btr_physics::model::Scenario;
use indexmap::IndexMap;
use rayon::prelude::*;
use std::collections::HashMap;

/// Smallest change of a noise floor that counts, as a share of it.
const CHANGED: f64 = 0.03;
/// Largest error, in largest errors that count as noise, of a model that tells which torques are uncertain. Where more
/// is unexplained, they are needed to find out why.
const NEARLY: f64 = 2.0;

impl IdentificationProblem {
    /// The problem with the noise floors that the model as it stands has in each log.
    pub(crate) fn with_floors_of_each_log(self) -> Self {
        let origin = vec![0.0; self.parameters.len()];
        self.with_torque_floors_at(&origin).unwrap_or(self)
    }

    /// The problem with the noise floors of the torques that a prescribed motion requires of the model at `u`; where
    /// the model explains nearly all, also those of single samples, once. `None` where they stay about the same.
    pub(super) fn with_torque_floors_at(&self, u: &[f64]) -> Option<Self> {
        if !self.model.robot.is_prescribed() {
            return None;
        }
        let asks_samples = self.uncertain.iter().all(HashMap::is_empty);
        let sensors = self.torque_sensors(u.len())?;
        let (mut other, mut differs) = (self.clone(), false);
        let mut uncertain = self.uncertain.clone();
        for (scenario, log) in self.recorded.iter().enumerate() {
            let count = if asks_samples { draws(log) } else { 1 };
            let changes = self.changed_torques(u, (scenario, log), count).unwrap_or_default();
            for (name, TorqueChanges { deviation, outstanding }) in changes {
                let Some(floor) = sensors.get(&name).map(|sensor| sensor.hypot(deviation)) else { continue };
                let readings = self.recorded[scenario].channel(&name);
                let used = readings.and_then(|readings| self.floor(scenario, &name, &readings.values));
                differs |= used.is_some_and(|used| (floor / used - 1.0).abs() > CHANGED);
                if outstanding.iter().any(|change| *change > floor) {
                    uncertain[scenario].insert(name.clone(), outstanding.into());
                }
                other.floors_of_model[scenario].insert(name, floor);
            }
        }
        let has_samples = asks_samples && uncertain.iter().any(|names| !names.is_empty());
        let weighted = has_samples.then(|| IdentificationProblem { uncertain, ..other.clone() });
        let weighted = weighted.and_then(IdentificationProblem::measured_anew);
        let weighted = weighted.filter(|weighted| weighted.error(u) <= NEARLY * weighted.noise_bound());
        weighted.or_else(|| differs.then(|| other.measured_anew()).flatten())
    }

    /// The problem with as much noise of the motion again. `None` where no joint follows a measured motion.
    pub(super) fn with_noisier_motion(&self, draw: usize) -> Option<Self> {
        if !self.model.robot.is_prescribed() {
            return None;
        }
        let scenarios = self.recorded.len();
        let noisier = |(scenario, log): (usize, &Log)| {
            let noise = MotionNoise::that_shows(&self.model, log, self.means_of);
            noise.again(&self.model, &self.situations[scenario], draw * scenarios + scenario)
        };
        let situations = self.recorded.par_iter().enumerate().map(noisier).collect();
        Some(IdentificationProblem { situations, ..self.clone() })
    }

    fn measured_anew(mut self) -> Option<Self> {
        self.measure().ok()?;
        Some(self)
    }

    /// What smoothing leaves of the torque sensors' noise: the noise floors without the part of the motion, by which
    /// they were estimated in the longest training log.
    fn torque_sensors(&self, parameters: usize) -> Option<IndexMap<String, f64>> {
        let longest = (0..self.model.learn.min(self.recorded.len())).max_by_key(|k| self.recorded[*k].len())?;
        let log = enough(&self.recorded[longest]);
        let changes = self.changed_torques(&vec![0.0; parameters], (longest, &log), 1)?;
        let sensor = |(name, changes): (String, TorqueChanges)| {
            let readings = &self.recorded[longest].channel(&name)?.values;
            let floor = self.model.setup.noise.floor(&name, readings)?;
            Some((name, (floor.powi(2) - changes.deviation.powi(2)).max(0.0).sqrt()))
        };
        Some(changes.into_iter().filter_map(sensor).collect())
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

    /// The error at a point on the training or the held-out logs, whichever is larger; infinite if a simulation
    /// diverges.
    fn error(&self, u: &[f64]) -> f64 {
        let requests: Vec<ResidualRequest> =
            (0..self.logs.len()).map(|log| ResidualRequest { u, log, moved: &[] }).collect();
        let squares = |residual: &Vec<f64>| residual.iter().filter(|r| r.is_finite()).map(|r| r * r).sum::<f64>();
        let residuals = self.residuals(&requests, TimeStep::USUAL).into_iter();
        let of_logs: Vec<f64> = residuals.map(|residual| residual.as_ref().map_or(f64::INFINITY, squares)).collect();
        let of = |held_out: bool| {
            let logs = self.logs.iter().zip(&of_logs).filter(|(log, _)| log.held_out == held_out);
            let (squares, present) =
                logs.fold((0.0, 0), |(sum, present), (log, here)| (sum + here, present + log.present));
            (squares / present.max(1) as f64).sqrt()
        };
        of(false).max(of(true))
    }
}
