//! What a model leaves of its own motion on the ground. With contact, windows do not fit to the sensors' noise even where nothing
//! is missing: the state at a window's start is known roughly, and a foot that touches down a sample later ends elsewhere. So
//! the model is asked to explain itself: it moves with other numbers in doubt than its own, as plausible as those, is measured
//! with noise, and is compared at its true numbers as a robot's log would be. What remains is the floor of each channel.

use crate::beside::Beside;
use crate::model::{Model, Scenario};
use crate::sensor::Noise;
use btr_core::family::{Family, Step};
use btr_core::fit::Bench;
use btr_core::log::Log;
use btr_core::random::{derive, stream};
use btr_core::world::WorldError;
use indexmap::IndexMap;
use rand::RngExt;
use std::sync::Arc;

/// The most logs that are repeated.
const LOGS: usize = 3;
/// Stream of the numbers in doubt, and of the noise.
const SEED: u64 = 0xF100;
/// How far those numbers are from the model's own, in standard deviations.
const OFF: f64 = 0.7;

/// By how much what remains of each channel is larger than its noise; never less than 1.
pub(crate) fn excess(beside: &Beside, learnt: &[usize]) -> Result<IndexMap<String, f64>, WorldError> {
    let mut truth = vec![0.0; beside.knobs().len()];
    let mut rng = stream(SEED, &[0]);
    for &k in beside.doubtful() {
        let sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
        truth[k] = beside.knobs()[k].clamp(sign * OFF * beside.knobs()[k].spread.min(1.0));
    }
    let scenarios: Vec<usize> = learnt.iter().copied().take(LOGS).collect();
    let situations = scenarios.iter().map(|&scenario| beside.model().scenarios[scenario].clone()).collect();
    let model = itself(beside, situations);
    let own = model.drive.space().nominal();
    let values = beside.inner(&truth);
    let record = |(k, &scenario): (usize, &usize)| {
        // With a finer step: the integrator's own error remains as well.
        let log = model.simulate_in_steps(&values, &own, k, Some(derive(SEED, &[1, k as u64])), Step::Halved)?;
        seen(&log, &beside.recorded()[scenario])
    };
    let logs: Vec<Log> = scenarios.iter().enumerate().map(record).collect::<Result<_, WorldError>>()?;
    let twin = Beside::bare(Arc::new(model), logs)?;
    let bench = Bench::new(&twin);
    let mut point = vec![0.0; twin.knobs().len()];
    twin.doubtful().iter().zip(beside.doubtful()).for_each(|(&own, &k)| point[own] = truth[k]);
    let mut squares: IndexMap<String, (f64, usize)> = IndexMap::new();
    for (index, log) in twin.logs().iter().enumerate() {
        let residual = bench.residuals_of(std::slice::from_ref(&point), &[index], Step::Usual).pop().flatten();
        let Some(residual) = residual else { continue };
        for channel in &log.channels {
            let sum = squares.entry(channel.name.clone()).or_default();
            sum.0 += residual[channel.samples.clone()].iter().map(|r| r * r).sum::<f64>();
            sum.1 += log.present / log.channels.len();
        }
    }
    Ok(squares.into_iter().map(|(name, (sum, n))| (name, (sum / n.max(1) as f64).sqrt().max(1.0))).collect())
}

/// The model with sensors as noisy as those of the logs.
fn itself(beside: &Beside, situations: Vec<Scenario>) -> Model {
    let largest = |begin: &str| {
        let channels = beside.logs().iter().flat_map(|log| &log.channels);
        channels.filter(|channel| channel.name.starts_with(begin)).map(|channel| channel.sigma).fold(0.0, f64::max)
    };
    let mut model = beside.model().in_situations(situations);
    let noise = model.setup.noise;
    let or = |given: f64, estimated: f64| if given > 0.0 { given } else { estimated };
    let position = if noise.position_quantum > 0.0 { noise.position } else { or(noise.position, largest("q_")) };
    model.setup.noise = Noise { position, gyro_rad_s: or(noise.gyro_rad_s, largest("imu_gyro_")), ..noise };
    model
}

/// The channels of a simulation that a recording has as well.
fn seen(simulated: &Log, recorded: &Log) -> Result<Log, WorldError> {
    let mut log = Log::new(simulated.clock_s().to_vec())?;
    for (name, channel) in simulated.channels().filter(|(name, _)| recorded.channel(name).is_some()) {
        log.insert(name, channel.unit.clone(), channel.role, channel.values.clone())?;
    }
    Ok(log)
}
