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
/// Smallest noise that counts as shown, as a share of the least that is assumed of a sensor.
const VISIBLE: f64 = 0.05;
/// Samples of a stretch in which the robot feels about the same inertia, ...
const STRETCH: usize = 64;
/// ... and largest change of a torque there, in standard deviations: where noise changes the sign of a slow motion,
/// friction changes its sign as well.
const MOST: f64 = 3.0;

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
    let noise = MotionNoise::of(model, &logs[longest], means_of);
    let s = model.simulations().nominal();
    let simulate = |scenario: &Scenario| model.simulate(ModelRequest::new(&s, scenario));
    // A log that cannot be simulated is reported where it is needed.
    let moved = noise.in_torques(model, &model.scenarios[longest], &simulate).unwrap_or_default();
    let left = left_by_smoothing(&noise.logs[0]);
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

/// What the noise of the positions becomes in a model.
pub(crate) struct MotionNoise {
    /// The part of a log from which it is estimated, and with as much noise again.
    logs: [Log; 2],
}

impl MotionNoise {
    /// In a log whose samples are means of so many recorded ones.
    pub(crate) fn of(model: &Model, log: &Log, means_of: usize) -> Self {
        let once = log.part(0..log.len().min(ENOUGH));
        let mut twice = once.clone();
        for (k, joint) in model.robot.prescribed().enumerate() {
            let name = format!("q_{}", joint.name);
            let Some(values) = twice.values_mut(&name) else { continue };
            // What is stated is the noise of a recorded sample.
            let sigma = match model.setup.noise.stated(&name) {
                Some(_) => model.setup.noise.floor(&name, values).map(|stated| stated / (means_of as f64).sqrt()),
                None => shown(values),
            };
            if let Some(sigma) = sigma {
                add_noise(values, sigma, 0.0, &mut stream(0, &[k as u64]));
            }
        }
        MotionNoise { logs: [once, twice] }
    }

    /// Standard deviation of the torques that a point requires in a scenario, by the noise of the positions.
    ///
    /// # Errors
    /// A motion that cannot be simulated.
    pub(crate) fn in_torques(
        &self,
        model: &Model,
        scenario: &Scenario,
        simulate: &dyn Fn(&Scenario) -> Result<Log, WorldError>,
    ) -> Result<IndexMap<String, f64>, WorldError> {
        let required = |log: &Log| {
            let replay = Some(Arc::new(Replay::new(log, &model.robot)));
            simulate(&Scenario { replay, duration_s: log.duration_s(), ..scenario.clone() })
        };
        let [log, noisier] = &self.logs;
        let (once, twice) = (required(log)?, required(noisier)?);
        let deviation = |joint: &Joint| {
            let name = joint.compared();
            let pairs = once.channel(&name)?.values.iter().zip(&twice.channel(&name)?.values);
            // What is not compared does not count: of a joint that stands, noise makes friction that changes its sign.
            let measured = &log.channel(&name)?.values;
            let all: Vec<(f64, bool)> = pairs.zip(measured).map(|((a, b), c)| (b - a, c.is_finite())).collect();
            let compared: Vec<f64> = all.iter().filter(|(_, is_compared)| *is_compared).map(|(by, _)| *by).collect();
            // A joint of which this log holds no torque may have some in another one.
            let of_all = || deviation(&all.iter().map(|(by, _)| *by).collect::<Vec<f64>>());
            Some((name, deviation(&compared).or_else(of_all)?))
        };
        Ok(model.robot.prescribed().filter_map(deviation).collect())
    }
}

/// The noise that readings show, or, where they show none, that which is assumed of them: differentiated twice, even
/// the finest encoder's noise is the larger part of a torque's.
fn shown(readings: &[f64]) -> Option<f64> {
    let estimate = NoiseEstimate::of(readings)?;
    let shown = estimate.white.hypot(estimate.quantum / 12.0_f64.sqrt());
    Some(if shown > VISIBLE * estimate.floor() { shown } else { estimate.floor() })
}

/// Root mean square of changes, whose size follows the robot's posture, without what is large beside its neighbours.
fn deviation(changes: &[f64]) -> Option<f64> {
    let (mut squares, mut count) = (0.0, 0usize);
    for stretch in changes.chunks(STRETCH) {
        let Some(most) = robust_std(stretch.iter().copied()).map(|deviation| MOST * deviation) else { continue };
        let finite = stretch.iter().filter(|change| change.is_finite());
        squares += finite.clone().map(|change| change.abs().min(most).powi(2)).sum::<f64>();
        count += finite.count();
    }
    (count > 0).then(|| (squares / count as f64).sqrt())
}

/// The share of white noise that smoothing on this log's clock leaves.
fn left_by_smoothing(log: &Log) -> f64 {
    let mut noise = vec![0.0; log.len()];
    add_noise(&mut noise, 1.0, 0.0, &mut stream(1, &[]));
    smooth::in_place(log.clock_s(), &mut noise);
    robust_std(noise.into_iter()).unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use rand::RngExt;

    #[test]
    fn changes_of_different_sizes_count_by_their_squares_and_outliers_do_not() {
        let mut rng = stream(2, &[]);
        let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        // In a tenth of the motion the arm is stretched, and feels ten times the inertia.
        let size = |i: usize| if (i / 200).is_multiple_of(10) { 10.0 } else { 1.0 };
        let mut changes: Vec<f64> = (0..20_000).map(|i| size(i) * normal()).collect();
        let truth = (0.1f64 * 100.0 + 0.9).sqrt();
        assert!((deviation(&changes).unwrap() / truth - 1.0).abs() < 0.1);
        assert!(robust_std(changes.iter().copied()).unwrap() < 0.5 * truth);
        changes.iter_mut().skip(50).step_by(150).for_each(|change| *change = 500.0);
        assert!((deviation(&changes).unwrap() / truth - 1.0).abs() < 0.15);
        assert_eq!(deviation(&[f64::NAN]), None);
    }

    #[test]
    fn noise_of_fine_encoders_counts_as_it_is_and_none_is_as_little_as_is_assumed() {
        let mut rng = stream(3, &[]);
        let motion: Vec<f64> = (0..4000).map(|i| (0.01 * f64::from(i)).sin()).collect();
        let mut fine = motion.clone();
        fine.iter_mut().for_each(|q| *q += 2e-6 * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0));
        assert!((shown(&fine).unwrap() / 2e-6 - 1.0).abs() < 0.1);
        assert_eq!(shown(&motion), NoiseEstimate::of(&motion).map(|estimate| estimate.floor()));
    }
}
