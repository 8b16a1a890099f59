//! How often a prescribed motion is followed.

use btr_core::log::{Log, Role, interpolate};
use btr_core::random::{normal, stream};
use btr_core::signal::noise::NoiseEstimate;
use btr_core::signal::smooth::{finely, in_place};
use btr_core::signal::standstill::standing;
use btr_core::signal::stats::{robust_std, std};
use btr_physics::robot::{Joint, Robot};

/// Period in s at which a prescribed motion is followed, unless the model states its `control_s`, ...
const FOLLOWED_S: f64 = 0.005;
/// ... or twice as long, where that loses no more than this share of the accelerations, ...
const MOST_LOST: f64 = 0.005;
/// ... nor, as the same share of the torques, more than this part of the noise that smoothing leaves in them, ...
const BESIDE_NOISE: f64 = 0.5;
/// ... and of the torques no more than their sensor's noise, but for this factor.
const AS_NOISE: f64 = 1.25;
/// Only in long logs, with more torques than this at the shorter period: fast reversals of friction are a little later
/// or earlier in a velocity that is smoothed over a longer time, and only long logs need the time that it saves.
const LONG: f64 = 30_000.0;
/// Most samples by which this is judged.
const ENOUGH: usize = 100_000;
/// A channel of white noise beside the recorded ones.
const WHITE: &str = "white noise";

/// The period in s at which the motion of a log is followed: twice as long for long logs where that loses nothing. Both
/// motion and torque are smoothed over four samples to each side, so that less noise is left at the longer period,
/// and all work takes half the time. Friction's jumps are few: what differs there does not count.
pub(super) fn followed_s(log: &Log, robot: &Robot, step_s: f64) -> f64 {
    let counts = [FOLLOWED_S, 2.0 * FOLLOWED_S].map(|period_s| within(period_s, step_s));
    let is_long = log.duration_s() / FOLLOWED_S * robot.prescribed().count() as f64 > LONG;
    let twice = is_fast(step_s) && is_long && keeps(log, robot, counts).unwrap_or(false);
    if twice { 2.0 * FOLLOWED_S } else { FOLLOWED_S }
}

/// Whether a log is recorded at more than twice the rate at which fast motions are followed. Others keep their samples.
pub(super) fn is_fast(step_s: f64) -> bool {
    within(FOLLOWED_S, step_s) >= 2
}

/// How many steps of a clock a period holds; in many logs they are rounded to microseconds.
pub(super) fn within(period_s: f64, step_s: f64) -> usize {
    (period_s / step_s * (1.0 + 1e-3)).floor() as usize
}

/// Whether means of more samples lose nothing; `None` where a channel is missing or shows no noise. A joint that stands
/// has nothing to lose.
fn keeps(log: &Log, robot: &Robot, [finer, coarser]: [usize; 2]) -> Option<bool> {
    let mut log = log.part(0..log.len().min(ENOUGH));
    let mut rng = stream(2, &[]);
    let noise = (0..log.len()).map(|_| normal(&mut rng)).collect();
    log.insert(WHITE, "1", Role::Measured, noise).ok()?;
    let rates = Rates { finer: log.means(finer), coarser: log.means(coarser) };
    let everywhere = vec![true; rates.coarser.len()];
    let unit = rates.lost(WHITE, &everywhere)?;
    let left = rates.smoothed_std(WHITE, &everywhere)?;
    let keeps = |joint: &Joint| {
        let (position, torque) = (format!("q_{}", joint.name), joint.compared());
        let stands = standing(rates.coarser.clock_s(), &rates.coarser.channel(&position)?.values);
        let moves: Vec<bool> = stands.into_iter().map(|stands| !stands).collect();
        if !moves.contains(&true) {
            return Some(true);
        }
        let sensor = NoiseEstimate::of(&log.channel(&torque)?.values)?.sigma();
        let lost = rates.lost_acceleration(&position, &moves)?;
        let is_little = lost * rates.smoothed_std(&torque, &moves)? <= BESIDE_NOISE * sensor * left;
        Some(lost <= MOST_LOST && is_little && rates.lost(&torque, &moves)? <= AS_NOISE * sensor * unit)
    };
    robot.prescribed().map(keeps).try_fold(true, |all, keeps| Some(all && keeps?))
}

/// A log at two rates.
struct Rates {
    finer: Log,
    coarser: Log,
}

impl Rates {
    /// How much a smoothed series differs between both, as a standard deviation, where a joint moves.
    fn lost(&self, name: &str, moves: &[bool]) -> Option<f64> {
        let smoothed = |log: &Log| {
            let mut values = log.channel(name)?.values.clone();
            in_place(log.clock_s(), &mut values);
            Some(values)
        };
        let pairs = self.pairs(&smoothed(&self.finer)?, smoothed(&self.coarser)?, moves);
        robust_std(pairs.into_iter().map(|(a, b)| a - b))
    }

    /// The standard deviation of a smoothed series at the coarser rate, where a joint moves.
    fn smoothed_std(&self, name: &str, moves: &[bool]) -> Option<f64> {
        let mut values = self.coarser.channel(name)?.values.clone();
        in_place(self.coarser.clock_s(), &mut values);
        let there = values.into_iter().zip(moves).filter(|(value, moves)| **moves && value.is_finite());
        let there: Vec<f64> = there.map(|(value, _)| value).collect();
        (!there.is_empty()).then(|| std(&there))
    }

    /// By what share the accelerations of a position are smaller at the coarser rate. Noise, which is as large in both
    /// products on average, hardly counts where there are accelerations.
    fn lost_acceleration(&self, name: &str, moves: &[bool]) -> Option<f64> {
        let accelerations = |log: &Log| {
            let motion = finely(log.clock_s(), &log.channel(name)?.values);
            Some(motion.iter().map(|motion| motion.acceleration).collect::<Vec<f64>>())
        };
        let pairs = self.pairs(&accelerations(&self.finer)?, accelerations(&self.coarser)?, moves);
        let sums = |(both, own): (f64, f64), (a, b): &(f64, f64)| (both + a * b, own + b * b);
        let (both, own) = pairs.iter().fold((0.0, 0.0), sums);
        (own > 0.0).then(|| both / own - 1.0)
    }

    /// Values at both rates, at the instants of the coarser one, where a joint moves.
    fn pairs(&self, finer: &[f64], coarser: Vec<f64>, moves: &[bool]) -> Vec<(f64, f64)> {
        let finer = interpolate(self.finer.clock_s(), finer, self.coarser.clock_s());
        let pairs = finer.into_iter().zip(coarser).zip(moves).filter(|(_, moves)| **moves).map(|(pair, _)| pair);
        pairs.filter(|(a, b)| a.is_finite() && b.is_finite()).collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use btr_physics::presets::pendulum::pendulum;
    use btr_physics::robot::Actuator;

    /// A joint that swings `hz` times a second and has a ripple of torque, at 1 kHz with noise.
    fn recorded(hz: f64, ripple: f64) -> Log {
        let mut rng = stream(5, &[]);
        let clock_s: Vec<f64> = (0..160_000).map(|i| f64::from(i) * 0.001).collect();
        let mut noisy = |size: f64, of: &dyn Fn(f64) -> f64| -> Vec<f64> {
            clock_s.iter().map(|t| of(*t) + size * normal(&mut rng)).collect()
        };
        let w = std::f64::consts::TAU * hz;
        let positions = noisy(1e-5, &|t| 0.5 * (w * t).sin());
        let torques = noisy(0.1, &|t| {
            let friction = 2.0 * (w * t).cos().signum();
            friction - 0.5 * w * w * (w * t).sin() + ripple * (std::f64::consts::TAU * 23.0 * t).sin()
        });
        let mut log = Log::new(clock_s.clone()).unwrap();
        log.insert("q_hip", "rad", Role::Measured, positions).unwrap();
        log.insert("tau_hip", "N·m", Role::Measured, torques).unwrap();
        log
    }

    fn robot() -> Robot {
        let mut robot = pendulum(1.0, 0.5, Actuator::Prescribed);
        robot.links.iter_mut().for_each(|link| link.joint.name = "hip".to_owned());
        robot
    }

    fn followed(hz: f64, ripple: f64) -> f64 {
        followed_s(&recorded(hz, ripple), &robot(), 0.001)
    }

    #[test]
    fn a_slow_motion_is_followed_half_as_often_in_a_long_log() {
        assert!((followed(0.5, 0.0) - 0.01).abs() < 1e-9);
        let short = recorded(0.5, 0.0).part(0..10_000);
        assert!((followed_s(&short, &robot(), 0.001) - 0.005).abs() < 1e-9);
    }

    #[test]
    fn a_quiet_torque_sensor_shows_what_accelerations_lose() {
        let mut log = recorded(0.5, 0.0);
        // The same noise beside ten times the torque.
        let heavy = |t: f64| -50.0 * (std::f64::consts::PI * t).sin();
        let times = log.clock_s().to_vec();
        let torques = log.values_mut("tau_hip").unwrap();
        torques.iter_mut().zip(times).for_each(|(torque, t)| *torque += heavy(t));
        assert!((followed_s(&log, &robot(), 0.001) - 0.005).abs() < 1e-9);
    }

    #[test]
    fn a_fast_motion_and_a_ripple_are_followed_closely() {
        assert!((followed(4.0, 0.0) - 0.005).abs() < 1e-9);
        assert!((followed(0.5, 0.2) - 0.005).abs() < 1e-9);
    }
}
