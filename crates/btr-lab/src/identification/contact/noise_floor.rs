//! Noise floor of a model with contact. With contact, windows do not fit to the sensors' noise even if no effect is
//! missing: the state at a window's start is only roughly known, and a foot that touches down a sample later ends at
//! another place. So the floor is measured on the model itself: it is simulated with other, equally plausible free
//! parameters, measured with noise, and compared at its true parameters in the same way as a robot's log. The remaining
//! error is the floor.

use crate::identification::problem::IdentificationProblem;
use btr_core::log::Log;
use btr_core::random::{derive, stream};
use btr_core::world::{TimeStep, WorldError};
use btr_identify::fit::{Objective, squares};
use btr_physics::sensor::SensorNoise;
use indexmap::IndexMap;
use rand::RngExt;
use std::sync::Arc;

/// Seed of the random streams for the free parameters and the noise.
const SEED: u64 = 0xF100;
/// Number of simulated motions: each is one sample of a chaotic motion.
const DRAWS: u64 = 4;
/// Distance of those parameters from the model's, in standard deviations.
const OFF: f64 = 0.7;

/// A sum of squares and its number of samples.
#[derive(Clone, Copy, Default)]
struct RemainingSquares(f64, usize);

impl RemainingSquares {
    fn add(&mut self, squares: f64, samples: usize) {
        *self = RemainingSquares(self.0 + squares, self.1 + samples);
    }

    fn rms(self) -> f64 {
        (self.0 / self.1.max(1) as f64).sqrt()
    }
}

/// Remaining squares of every channel, by scenario.
type RemainingErrors = Vec<(usize, IndexMap<String, RemainingSquares>)>;

/// Raises the floors of all logs to the remaining error of the model at `u` in each channel and scenario; none falls
/// below the sensors' noise. A channel's floor is estimated over all logs and then scaled for each log as a whole: a
/// single channel of a short log has too few samples.
pub(crate) fn raise(problem: &mut IdentificationProblem, u: &[f64]) -> Result<(), WorldError> {
    let mut remaining: Vec<RemainingErrors> = Vec::new();
    for draw in 0..DRAWS {
        remaining.push(of_logs(problem, u, &plausible(problem, u, draw), draw)?);
    }
    let all = || remaining.iter().flatten();
    let mut channels: IndexMap<String, RemainingSquares> = IndexMap::new();
    for (name, squares_of_channel) in all().flat_map(|(_, log)| log) {
        channels.entry(name.clone()).or_default().add(squares_of_channel.0, squares_of_channel.1);
    }
    let excess: IndexMap<String, f64> =
        channels.into_iter().map(|(name, remaining)| (name, remaining.rms().max(1.0))).collect();
    let of_scenario = |scenario: usize| {
        let mut share = RemainingSquares::default();
        for (name, squares_of_channel) in all().filter(|(of, _)| *of == scenario).flat_map(|(_, log)| log) {
            share.add(squares_of_channel.0 / excess[name].powi(2), squares_of_channel.1);
        }
        if share.1 == 0 { 1.0 } else { share.rms() }
    };
    let shares: Vec<f64> = (0..problem.logs().len()).map(|log| of_scenario(problem.scenario(log))).collect();
    for (log, share) in problem.floors().zip(shares) {
        for channel in &mut log.channels {
            let raised = excess.get(&channel.name).map_or(1.0, |excess| (excess * share).max(1.0));
            channel.sigma *= raised;
            channel.sensor *= raised;
        }
    }
    Ok(())
}

/// The noise floor of a channel's sensor.
fn noise_of(problem: &IdentificationProblem, scenario: usize, name: &str) -> f64 {
    let values = problem.recorded()[scenario].channel(name).map_or(&[][..], |channel| &channel.values);
    problem.model().setup.noise.floor(name, values).unwrap_or(1.0)
}

/// The point with other, equally plausible parameters of the model.
fn plausible(problem: &IdentificationProblem, u: &[f64], draw: u64) -> Vec<f64> {
    let mut truth = u.to_vec();
    let mut rng = stream(SEED, &[draw]);
    for k in problem.own() {
        let sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
        truth[k] = problem.parameters()[k].clamp(u[k] + sign * OFF * problem.parameters()[k].spread.min(1.0));
    }
    truth
}

/// Remaining squares of each channel by scenario, in multiples of the sensors' noise, if reality is the model at
/// `truth`; initial states are estimated by the model at `u`.
fn of_logs(
    problem: &IdentificationProblem,
    u: &[f64],
    truth: &[f64],
    draw: u64,
) -> Result<RemainingErrors, WorldError> {
    let mut model = problem.model().in_situations(problem.model().scenarios.clone());
    model.setup.noise = noise(problem);
    let truly = problem.at(truth);
    let record = |(scenario, recorded): (usize, &Log)| {
        // With a finer step, so that the discretisation error remains as well.
        let seed = derive(SEED, &[draw + 1, scenario as u64]);
        let step = TimeStep::USUAL.halved().halved().halved();
        let request = truly.request(&model.scenarios[scenario]).time_step(step).noise_seed(seed);
        recorded_channels(&model.simulate(request)?, recorded)
    };
    let logs: Vec<Log> = problem.recorded().iter().enumerate().map(record).collect::<Result<_, WorldError>>()?;
    let twin = problem.with_logs(Arc::new(model), logs, u)?;
    let objective = Objective::at(&twin, truth);
    let mut remaining = Vec::new();
    for (index, log) in twin.logs().iter().enumerate() {
        let residual = objective.residuals_of(&[truth.to_vec()], &[index]).pop().and_then(Result::ok);
        let Some(residual) = residual else { continue };
        let samples = log.present / log.channels.len();
        let squares_of_channel = |channel: &btr_identify::residual_model::MeasuredChannel| {
            (channel.name.clone(), RemainingSquares(squares(&residual[channel.samples.clone()]), samples))
        };
        remaining.push((twin.scenario(index), log.channels.iter().map(squares_of_channel).collect()));
    }
    Ok(remaining)
}

/// Sensor noise of the logs.
fn noise(problem: &IdentificationProblem) -> SensorNoise {
    let largest = |begin: &str| {
        let channels =
            problem.logs().iter().enumerate().flat_map(|(i, log)| log.channels.iter().map(move |c| (i, &c.name)));
        let matching = channels.filter(|(_, name)| name.starts_with(begin));
        matching.map(|(log, name)| noise_of(problem, problem.scenario(log), name)).fold(0.0, f64::max)
    };
    let noise = problem.model().setup.noise.clone();
    let or = |given: f64, estimated: f64| if given > 0.0 { given } else { estimated };
    // A floor contains the encoders' step, which is added by itself.
    let white = (largest("q_").powi(2) - noise.position_quantum.powi(2) / 12.0).max(0.0).sqrt();
    let position = or(noise.position, white);
    SensorNoise { position, gyro_rad_s: or(noise.gyro_rad_s, largest("imu_gyro_")), ..noise }
}

/// The channels of a simulation that a recording has as well.
fn recorded_channels(simulated: &Log, recorded: &Log) -> Result<Log, WorldError> {
    let mut log = Log::new(simulated.clock_s().to_vec())?;
    for (name, channel) in simulated.channels().filter(|(name, _)| recorded.channel(name).is_some()) {
        log.insert(name, channel.unit.clone(), channel.role, channel.values.clone())?;
    }
    Ok(log)
}
