//! `compare`: the errors of a model in multiples of the sensors' noise, and where they occur.

mod joint;
mod overlay;
mod telling;
mod verdict;
mod words;

pub use joint::{Cause, CauseKind, JointVerdict};
pub use verdict::CompareVerdict;

use crate::experiment::{Replays, Source};
use crate::identification::{ProblemError, seen_starts};
use btr_core::log::Log;
use btr_core::world::{Simulator, WorldError};
use btr_identify::compare;
use btr_identify::compare::{ChannelError, Comparison, LogPair, RegimeCell};
use btr_identify::fit::{extrapolation, finer_step};
use btr_identify::residual_model::TimeStep;
use btr_physics::model::Model;
use btr_physics::robot::Base;
use indexmap::IndexMap;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The result of `compare`, with its model and logs.
pub struct CompareReport {
    /// The model file's name.
    pub model: String,
    /// The model and the logs.
    pub replays: Replays,
    /// Names of the logs.
    pub names: Vec<String>,
    /// The errors of the model.
    pub comparison: Comparison,
    /// The simulation of each log.
    pub simulated: Vec<Log>,
    /// Discretisation error of each simulated channel, in noise floors.
    pub integrator: IndexMap<String, f64>,
    /// Time step of the simulations.
    pub step: TimeStep,
}

/// Simulates every log, once more with half the time step, and compares; refines the steps if they are too coarse.
/// `on_log` is called with the name of each log that is simulated, and with how many were before it.
///
/// # Errors
/// A simulation that diverged; logs without any simulated channel.
pub fn compare(
    source: &Source,
    mut replays: Replays,
    on_log: &(dyn Fn(usize, &str) + Sync),
) -> Result<CompareReport, ProblemError> {
    // Uncertainty of a log's initial state is not an error of the model.
    if let Some(seen) = seen_starts(&replays.model, &replays.logs) {
        replays.model.scenarios = seen;
    }
    let model = &replays.model;
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let simulate = |step: TimeStep| -> Result<Vec<Log>, WorldError> {
        let (logs, begun) = ((0..replays.logs.len()).into_par_iter(), AtomicUsize::new(0));
        let simulate = |k: usize| {
            on_log(begun.fetch_add(1, Ordering::Relaxed), &model.scenarios[k].name);
            model.simulate(model.request(&s, k).controller(&c).time_step(step))
        };
        logs.map(simulate).collect()
    };
    let beyond = extrapolation(model.order());
    let (mut step, mut simulated) = (TimeStep::USUAL, simulate(TimeStep::USUAL)?);
    loop {
        let halved = simulate(step.halved())?;
        let comparison = comparison(&replays, &simulated);
        if comparison.channels.is_empty() {
            return Err(ProblemError::Nothing);
        }
        let error = |c: &ChannelError| (c.name.clone(), integrator_error(c, beyond, &simulated, &halved));
        let integrator: IndexMap<String, f64> = comparison.channels.iter().map(error).collect();
        if let Some(finer) = finer_step(step, integrator.values().copied()).filter(|_| !model.has_contact()) {
            (step, simulated) = (finer, halved);
            continue;
        }
        let names = model.scenarios.iter().map(|scenario| scenario.name.clone()).collect();
        let model = source.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        return Ok(CompareReport { model, replays, names, comparison, simulated, integrator, step });
    }
}

fn comparison(replays: &Replays, simulated: &[Log]) -> Comparison {
    let scenarios = replays.model.scenarios.iter().zip(&replays.logs).zip(simulated);
    let pairs: Vec<LogPair> =
        scenarios.map(|((scenario, real), simulated)| LogPair { name: &scenario.name, real, simulated }).collect();
    compare_pairs(&replays.model, &pairs)
}

/// The errors of simulations of a model's robot, with the noise floors of its sensors.
pub fn compare_pairs(model: &Model, pairs: &[LogPair]) -> Comparison {
    // A joint whose motion is prescribed is where it was measured, but for smoothing.
    let given = |channel: &str| {
        let motion = channel.strip_prefix("q_").or_else(|| channel.strip_prefix("dq_"));
        model.robot.prescribed().any(|joint| motion == Some(&joint.name))
    };
    let floor = |channel: &str, readings: &[f64], simulated: &[f64]| match model.robot.base {
        _ if given(channel) => None,
        Base::Fixed => model.setup.noise.floor_beside(channel, readings, simulated),
        Base::Floating => model.setup.noise.floor(channel, readings),
    };
    compare::compare(pairs, floor)
}

/// Root mean square discretisation error of a simulated channel, in noise floors: the change by halving the step times
/// `beyond`, see [`extrapolation`].
fn integrator_error(channel: &ChannelError, beyond: f64, simulated: &[Log], halved: &[Log]) -> f64 {
    let pairs = simulated.iter().zip(halved).filter_map(|(usual, halved)| {
        Some((&usual.channel(&channel.name)?.values, &halved.channel(&channel.name)?.values))
    });
    let (sum, n) = pairs.flat_map(|(usual, halved)| usual.iter().zip(halved)).fold((0.0, 0.0), |(sum, n), (a, b)| {
        let error = beyond * (b - a);
        if error.is_finite() { (sum + error * error, n + 1.0) } else { (sum, n) }
    });
    if n > 0.0 { f64::sqrt(sum / n) / channel.noise_floor } else { 0.0 }
}

impl CompareReport {
    /// The largest discretisation error of all channels.
    pub fn integrator_error(&self) -> f64 {
        self.integrator.values().copied().fold(0.0, f64::max)
    }

    /// The time step of the simulations, in s.
    pub fn time_step_s(&self) -> f64 {
        self.replays.model.setup.dt_s / f64::from(self.step.divides_by())
    }

    /// Standard deviation of a run of a channel from what the robot does on average, where runs of the same command
    /// show that it is more than the sensor's noise, or the model states it.
    pub fn repeatability(&self, channel: &str) -> Option<f64> {
        let floor = self.comparison.channels.iter().find(|c| c.name == channel)?.noise_floor;
        Some(self.replays.model.setup.noise.unpredictable.beside(channel, floor)).filter(|spread| *spread > floor)
    }

    /// What it says first.
    pub fn verdict(&self) -> CompareVerdict {
        let repeatability = |channel: &str| self.repeatability(channel);
        let logs = &self.replays.logs;
        verdict::verdict(&joint::Compared { comparison: &self.comparison, logs, repeatability: &repeatability })
    }

    /// The most telling regimes of each joint that fails somewhere, the worst joint first: regimes of different kinds,
    /// as those of one kind overlap.
    pub fn most_telling(&self, most: usize) -> Vec<&RegimeCell> {
        telling::most_telling(&self.comparison, &self.verdict().joints, most)
    }

    /// The result with the keys of `--json`.
    pub fn document(&self) -> Value {
        let channel = |c: &ChannelError| {
            json!({
                "name": c.name,
                "unit": c.unit,
                "samples": c.samples,
                "rmse": c.rmse,
                "error_percent": c.error_percent,
                "fit_percent": c.fit_percent,
                "bias": c.bias,
                "lag_s": c.lag_s,
                "noise_floor": c.noise_floor,
                "chi": c.chi,
                "repeatability": self.repeatability(&c.name),
                "x_repeatability": self.repeatability(&c.name).map(|spread| c.rmse / spread),
                "white": c.white,
                "independent": c.independent,
                "integrator_error": self.integrator.get(&c.name),
            })
        };
        let failure = |cell: &&RegimeCell| {
            json!({
                "joint": cell.joint,
                "regime": cell.regime.name(),
                "log": cell.log,
                "t0": cell.t0_s,
                "t1": cell.t1_s,
                "rmse": cell.rmse,
                "chi": cell.chi,
                "share": cell.share,
                "follows": cell.clue.map(|found| found.clue),
                "hint": cell.hint,
            })
        };
        let mut document = json!({
            "ok": true,
            "verdict": self.verdict(),
            "channels": self.comparison.channels.iter().map(channel).collect::<Vec<_>>(),
            "failures": self.comparison.failures().iter().map(failure).collect::<Vec<_>>(),
            "integrator_error": self.integrator_error(),
            "time_step_s": self.time_step_s(),
            "not_judged": self.replays.not_judged(),
            "warnings": self.replays.warnings,
        });
        if !self.replays.left_out.is_empty() {
            document["left_out"] = json!(self.replays.left_out);
        }
        document
    }
}
