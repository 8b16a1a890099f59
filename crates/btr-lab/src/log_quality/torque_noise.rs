//! Noise floors of the torques of joints whose motion is prescribed.
//!
//! Two noises meet there: that of the torque sensor, and that of the positions, which differentiating them twice turns
//! into torque, by the inertia that each joint feels. The second is what the model's required torques change by when
//! the positions get as much noise once more. Both torques are smoothed alike before they are compared; the floor is
//! what is left of both noises then.

use btr_core::log::Log;
use btr_core::random::stream;
use btr_core::signal::noise::NoiseEstimate;
use btr_core::signal::smooth;
use btr_core::signal::stats::robust_std;
use btr_core::world::{Simulator, WorldError};
use btr_physics::drive::Replay;
use btr_physics::model::{Model, ModelRequest, Scenario};
use btr_physics::robot::{Joint, Robot};
use btr_physics::sensor::add_noise;
use indexmap::IndexMap;
use std::sync::Arc;

/// Most samples of a log from which noise is estimated.
const ENOUGH: usize = 20_000;

/// Estimates of the noise of torque sensors in a log as recorded.
pub(crate) fn of_sensors(log: &Log, robot: &Robot) -> IndexMap<String, f64> {
    let of_joint = |joint: &Joint| {
        let name = joint.compared();
        let sigma = NoiseEstimate::of(&log.channel(&name)?.values)?.sigma();
        Some((name, sigma))
    };
    robot.prescribed().filter_map(of_joint).collect()
}

/// The noise floor of each such torque; the model may state the noise of a recorded sample. `sensors` are the estimates
/// of the noise in each training log, whose samples are means of so many recorded ones; `logs` are those of the model's
/// scenarios.
pub(crate) fn floors(
    model: &Model,
    (sensors, means_of): (&[&IndexMap<String, f64>], usize),
    logs: &[Log],
) -> IndexMap<String, f64> {
    let joints: Vec<&Joint> = model.robot.prescribed().collect();
    let Some(longest) = (0..model.learn.min(logs.len())).max_by_key(|k| logs[*k].len()).filter(|_| !joints.is_empty())
    else {
        return IndexMap::new();
    };
    let log = logs[longest].part(0..logs[longest].len().min(ENOUGH));
    // A log that cannot be simulated is reported where it is needed.
    let moved = by_motion(model, &model.scenarios[longest], (&log, means_of), &joints).unwrap_or_default();
    let left = left_by_smoothing(&log);
    let floor = |joint: &Joint| {
        let name = joint.compared();
        let squares: Vec<f64> = sensors.iter().filter_map(|log| Some(log.get(&name)?.powi(2))).collect();
        let estimated = (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
        let stated = model.setup.noise.stated(&name).map(|sigma| sigma / (means_of as f64).sqrt());
        let sensor = stated.unwrap_or(estimated);
        let motion = moved.get(&name).copied().unwrap_or(0.0);
        (!squares.is_empty()).then(|| (name, (left * sensor).hypot(motion)))
    };
    joints.into_iter().filter_map(floor).collect()
}

/// Standard deviation of the required torques by the noise of the positions.
fn by_motion(
    model: &Model,
    scenario: &Scenario,
    (log, means_of): (&Log, usize),
    joints: &[&Joint],
) -> Result<IndexMap<String, f64>, WorldError> {
    let s = model.simulations().nominal();
    let required = |log: &Log| {
        let replay = Some(Arc::new(Replay::new(log, &model.robot)));
        let scenario = Scenario { replay, duration_s: log.duration_s(), ..scenario.clone() };
        model.simulate(ModelRequest::new(&s, &scenario))
    };
    let mut noisier = log.clone();
    for (k, joint) in joints.iter().enumerate() {
        let name = format!("q_{}", joint.name);
        if let Some(values) = noisier.values_mut(&name)
            && let Some(sigma) = model.setup.noise.floor(&name, values)
        {
            // What is stated is the noise of a recorded sample.
            let of = if model.setup.noise.stated(&name).is_some() { means_of } else { 1 };
            let sigma = sigma / (of as f64).sqrt();
            add_noise(values, sigma, 0.0, &mut stream(0, &[k as u64]));
        }
    }
    let (once, twice) = (required(log)?, required(&noisier)?);
    let deviation = |joint: &&Joint| {
        let name = joint.compared();
        let pairs = once.channel(&name)?.values.iter().zip(&twice.channel(&name)?.values);
        // Where noise changes the sign of a slow motion, friction changes its sign as well: those samples are outliers.
        Some((name, robust_std(pairs.map(|(a, b)| b - a))?))
    };
    Ok(joints.iter().filter_map(deviation).collect())
}

/// The share of white noise that smoothing on this log's clock leaves.
fn left_by_smoothing(log: &Log) -> f64 {
    let mut noise = vec![0.0; log.len()];
    add_noise(&mut noise, 1.0, 0.0, &mut stream(1, &[]));
    smooth::in_place(log.clock_s(), &mut noise);
    robust_std(noise.into_iter()).unwrap_or(1.0)
}
