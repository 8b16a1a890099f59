//! Sizes of effects on commands that the error shows: what such an effect makes of a log's commands is known without a
//! simulation.

use crate::identification::problem::IdentificationProblem;
use btr_core::signal::size::{ErrorOfCommand, sizes};
use btr_core::signal::stats::mean;
use btr_identify::fit::NOISE;
use btr_physics::effects::{commanded, find};
use btr_physics::robot::site::matches;

/// Number of sizes per candidate.
const SIZES: usize = 2;
/// The logs with the largest errors are searched until they have this many samples.
const SAMPLES: usize = 2000;
/// Least size, in noise floors: smaller steps leave less than noise.
const LEAST: f64 = 2.0;

/// A joint in a log: its commands, and the errors of its position in noise floors.
struct JointInLog<'a> {
    command: &'a [f64],
    error: &'a [f64],
    step_s: f64,
    sigma: f64,
}

impl JointInLog<'_> {
    /// Mean square of the error; 0 where nothing is known.
    fn mean_square(&self) -> f64 {
        let known: Vec<f64> = self.error.iter().filter(|x| x.is_finite()).map(|x| x * x).collect();
        if known.is_empty() { 0.0 } else { mean(&known) }
    }
}

impl IdentificationProblem {
    /// See [`ResidualModel::sizes`](btr_identify::residual_model::ResidualModel::sizes).
    pub(super) fn command_sizes(&self, parameter: usize, residuals: &[(usize, &[f64])]) -> Vec<(f64, f64)> {
        let parameter = &self.parameters[parameter];
        let named = parameter.name.split_once('.').and_then(|(name, rest)| Some((find(name)?, rest)));
        let Some((effect, rest)) = named else { return Vec::new() };
        let at = rest.split_once('@').map_or("*", |(_, at)| at);
        let joints = self.model.robot.movable().map(|(_, link)| &*link.joint.name).filter(|name| matches(at, name));
        let in_logs = |name| residuals.iter().filter_map(move |of_log| self.joint_in_log(name, of_log));
        let mut all: Vec<JointInLog> = joints.flat_map(in_logs).collect();
        all.retain(|joint| joint.mean_square() > NOISE * NOISE);
        all.sort_by(|a, b| b.mean_square().total_cmp(&a.mean_square()));
        let mut samples = 0;
        all.retain(|joint| {
            let room = samples < SAMPLES;
            samples += joint.command.len();
            room
        });
        let of_command = all
            .into_iter()
            .filter_map(|joint| Some((ErrorOfCommand::new(joint.error, joint.command, joint.step_s)?, joint)));
        let (errors, joints): (Vec<ErrorOfCommand>, Vec<JointInLog>) = of_command.unzip();
        let least = LEAST * joints.iter().map(|joint| joint.sigma).fold(f64::INFINITY, f64::min);
        let change = |size: f64, index: usize| {
            let JointInLog { command, sigma, step_s, .. } = joints[index];
            let seen = commanded(effect, &[size], command, step_s);
            seen.iter().zip(command).map(|(seen, command)| (seen - command) / sigma).collect()
        };
        let coordinate = |(size, explained): (f64, f64)| (parameter.clamp(parameter.coordinate(size)), explained);
        sizes(&errors, least, SIZES, change).into_iter().map(coordinate).collect()
    }

    /// A joint in a log, if its position and its command are known there.
    fn joint_in_log<'a>(&'a self, name: &str, (log, residual): &(usize, &'a [f64])) -> Option<JointInLog<'a>> {
        let channel = self.logs[*log].channels.iter().find(|channel| channel.name == format!("q_{name}"))?;
        let recorded = &self.recorded[self.parts[*log].scenario];
        let command = &recorded.channel(&format!("cmd_{name}"))?.values;
        let (error, step_s) = (residual.get(channel.samples.clone())?, recorded.usual_step_s()?);
        Some(JointInLog { command, error, step_s, sigma: channel.sigma })
    }
}
