//! Noise floors of the torques of joints whose motion is prescribed.
//!
//! Two noises meet there: that of the torque sensor, and that of the positions, which differentiating them twice turns
//! into torque, by the inertia that each joint feels. The second is what the model's required torques change by when
//! the positions get as much noise once more. Both torques are smoothed alike before they are compared; the floor is
//! what is left of both noises then. Where a velocity nearly stays at zero, noise changes its sign, and dry friction
//! with it: those samples have larger floors.

use btr_core::log::{Log, interpolate};
use btr_core::random::stream;
use btr_core::signal::noise::NoiseEstimate;
use btr_core::signal::smooth;
use btr_core::signal::stats::robust_std;
use btr_core::world::{Simulator, WorldError};
use btr_physics::drive::{Drive, Replay};
use btr_physics::model::{Model, ModelRequest, Scenario};
use btr_physics::robot::{Joint, Robot};
use btr_physics::sensor::add_noise;
use indexmap::IndexMap;
use rayon::prelude::*;
use std::sync::Arc;

/// Most samples of a log from which noise is estimated.
const ENOUGH: usize = 20_000;
/// How often a log gets as much noise again: with fewer draws, too few of the signs that are uncertain change.
const DRAWS: usize = 8;
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
    let enough = enough(&logs[longest]);
    let noise = MotionNoise::of(model, &enough, means_of);
    let s = model.simulations().nominal();
    let simulate = |scenario: &Scenario| model.simulate(ModelRequest::new(&s, scenario));
    // A log that cannot be simulated is reported where it is needed.
    let moved = noise.in_torques(model, &model.scenarios[longest], 1, &simulate).unwrap_or_default();
    let left = left_by_smoothing(&enough);
    let floor = |joint: &Joint| {
        let name = joint.compared();
        let squares: Vec<f64> = sensors.iter().filter_map(|log| Some(log.get(&name)?.powi(2))).collect();
        let estimated = (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
        let stated = model.setup.noise.stated(&name).map(|sigma| sigma / (means_of as f64).sqrt());
        let sensor = stated.unwrap_or(estimated);
        let motion = moved.get(&name).map_or(0.0, |changes| changes.deviation);
        (!squares.is_empty()).then(|| (name, (left * sensor).hypot(motion)))
    };
    joints.into_iter().filter_map(floor).collect()
}

/// What the noise of the positions becomes in a model.
pub(crate) struct MotionNoise<'a> {
    log: &'a Log,
    /// Names of the positions, and their noise.
    positions: Vec<(String, f64)>,
}

/// What the noise of the positions changes of a required torque.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TorqueChanges {
    /// Standard deviation.
    pub deviation: f64,
    /// For each sample of the log that is compared, the root mean square where it is much larger than around; else 0.
    pub outstanding: Vec<f64>,
}

impl<'a> MotionNoise<'a> {
    /// In a log whose samples are means of so many recorded ones.
    pub(crate) fn of(model: &Model, log: &'a Log, means_of: usize) -> Self {
        let position = |joint: &Joint| {
            let name = format!("q_{}", joint.name);
            let values = &log.channel(&name)?.values;
            let sigma = stated(model, &name, values, means_of).or_else(|| shown(values))?;
            Some((name, sigma))
        };
        MotionNoise { log, positions: model.robot.prescribed().filter_map(position).collect() }
    }

    /// The log with as much noise again.
    fn noisier(&self, draw: usize) -> Log {
        let mut log = self.log.clone();
        for (k, (name, sigma)) in self.positions.iter().enumerate() {
            if let Some(values) = log.values_mut(name) {
                add_noise(values, *sigma, 0.0, &mut stream(draw as u64, &[k as u64]));
            }
        }
        log
    }

    /// The noise that the positions show, and no more than is stated of them.
    pub(crate) fn that_shows(model: &Model, log: &'a Log, means_of: usize) -> Self {
        let position = |joint: &Joint| {
            let name = format!("q_{}", joint.name);
            let values = &log.channel(&name)?.values;
            let shown = NoiseEstimate::of(values).map_or(0.0, |estimate| without_assumption(&estimate));
            Some((name.clone(), stated(model, &name, values, means_of).map_or(shown, |stated| stated.min(shown))))
        };
        MotionNoise { log, positions: model.robot.prescribed().filter_map(position).collect() }
    }

    /// A scenario of the log with as much noise again, by other draws than those that tell noise floors.
    pub(crate) fn again(&self, model: &Model, scenario: &Scenario, draw: usize) -> Scenario {
        Scenario { replay: followed(model, scenario, &self.noisier(DRAWS + draw)), ..scenario.clone() }
    }

    /// What this noise changes of the torques that a point requires in a scenario, in so many draws of it.
    ///
    /// # Errors
    /// A motion that cannot be simulated.
    pub(crate) fn in_torques(
        &self,
        model: &Model,
        scenario: &Scenario,
        draws: usize,
        simulate: &(dyn Fn(&Scenario) -> Result<Log, WorldError> + Sync),
    ) -> Result<IndexMap<String, TorqueChanges>, WorldError> {
        let required = |log: &Log| {
            let replay = followed(model, scenario, log);
            simulate(&Scenario { replay, duration_s: log.duration_s(), ..scenario.clone() })
        };
        let as_measured = required(self.log)?;
        let noisier =
            (0..draws).into_par_iter().map(|draw| required(&self.noisier(draw))).collect::<Result<Vec<Log>, _>>()?;
        let changes = |joint: &Joint| {
            let name = joint.compared();
            let measured = &self.log.channel(&name)?.values;
            // A simulation has an even clock of its own.
            let on_clock =
                |log: &Log| Some(interpolate(log.clock_s(), &log.channel(&name)?.values, self.log.clock_s()));
            let before = on_clock(&as_measured)?;
            let change = |log: &Log| Some(on_clock(log)?.iter().zip(&before).map(|(a, b)| a - b).collect::<Vec<f64>>());
            let drawn: Vec<Vec<f64>> = noisier.iter().map(change).collect::<Option<_>>()?;
            // What is not compared does not count: of a joint that stands, noise makes friction that changes its sign.
            let compared = |changes: &Vec<f64>| {
                let pairs = changes.iter().zip(measured).filter(|(_, measured)| measured.is_finite());
                deviation(&pairs.map(|(change, _)| *change).collect::<Vec<f64>>())
            };
            let first = drawn.first()?;
            // A joint of which this log holds no torque may have some in another one.
            let deviation = compared(first).or_else(|| deviation(first))?;
            let mut outstanding = outstanding(&drawn);
            outstanding.iter_mut().zip(measured).filter(|(_, x)| !x.is_finite()).for_each(|(change, _)| *change = 0.0);
            Some((name, TorqueChanges { deviation, outstanding }))
        };
        Ok(model.robot.prescribed().filter_map(changes).collect())
    }
}

/// The motion of a log that a scenario's joints follow.
fn followed(model: &Model, scenario: &Scenario, log: &Log) -> Option<Arc<Replay>> {
    let mean_s = scenario.replay.as_ref().map_or(0.0, |replay| replay.mean_s());
    Some(Arc::new(Replay::new(log, &model.robot).of_means(mean_s)))
}

/// As much of a log as tells its noise.
pub(crate) fn enough(log: &Log) -> Log {
    log.part(0..log.len().min(ENOUGH))
}

/// How many draws tell which torques of a log are uncertain: fewer of a long log, whose samples take their time.
pub(crate) fn draws(log: &Log) -> usize {
    (DRAWS * ENOUGH / log.len().max(1)).clamp(1, DRAWS)
}

/// For each sample, the root mean square of its changes in all draws where it is large beside those around it; else 0.
fn outstanding(drawn: &[Vec<f64>]) -> Vec<f64> {
    let mut all = Vec::new();
    let samples = drawn.first().map_or(0, Vec::len);
    for from in (0..samples).step_by(STRETCH) {
        let stretch = from..(from + STRETCH).min(samples);
        let usual = robust_std(drawn.iter().flat_map(|changes| changes[stretch.clone()].iter().copied()));
        let most = MOST * usual.unwrap_or(f64::INFINITY);
        all.extend(stretch.map(|i| {
            let square = drawn.iter().map(|changes| changes[i].powi(2)).sum::<f64>() / drawn.len() as f64;
            if square.sqrt() > most { square.sqrt() } else { 0.0 }
        }));
    }
    all
}

/// The noise that the model states of a channel, in means of so many recorded samples.
fn stated(model: &Model, name: &str, values: &[f64], means_of: usize) -> Option<f64> {
    model.setup.noise.stated(name)?;
    Some(model.setup.noise.floor(name, values)? / (means_of as f64).sqrt())
}

/// The noise that readings show, or, where they show none, that which is assumed of them: differentiated twice, even
/// the finest encoder's noise is the larger part of a torque's.
fn shown(readings: &[f64]) -> Option<f64> {
    let estimate = NoiseEstimate::of(readings)?;
    let shown = without_assumption(&estimate);
    Some(if shown > VISIBLE * estimate.floor() { shown } else { estimate.floor() })
}

/// White noise and quantisation, as far as the readings show them.
fn without_assumption(estimate: &NoiseEstimate) -> f64 {
    estimate.white.hypot(estimate.quantum / 12.0_f64.sqrt())
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
    fn what_some_draws_change_much_more_than_around_stands_out() {
        let mut rng = stream(4, &[]);
        let mut draw =
            || (0..1000).map(|_| (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0).collect::<Vec<f64>>();
        let mut drawn: Vec<Vec<f64>> = (0..8).map(|_| draw()).collect();
        assert!(outstanding(&drawn).iter().all(|change| *change == 0.0));
        // Two of eight draws change the sign of a friction at two samples.
        for changes in &mut drawn[..2] {
            changes[500..502].fill(40.0);
        }
        let stand_out = outstanding(&drawn);
        assert!(stand_out[500..502].iter().all(|change| (change / 20.0 - 1.0).abs() < 0.05));
        assert_eq!(stand_out.iter().filter(|change| **change > 0.0).count(), 2);
        assert!(outstanding(&[]).is_empty());
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
