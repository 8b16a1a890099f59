//! Drive that replays the commands of a log.

use super::Drive;
use crate::robot::{Actuator, Link, Robot};
use btr_core::log::{Log, interpolate};
use btr_core::signal::missing;
use btr_core::signal::smooth::{Motion, Smoother, finely};

/// Time stamps that are off by less than this fraction of the usual sample time count as rounded.
const ROUNDED: f64 = 1e-3;

/// The commands of a log, each held until the next one.
///
/// A step that spans several stamps receives the mean of the commands held during it. Commands that are missing (NaN)
/// for longer than a lost message ([`missing::held`]) switch the torque off, as does a channel `torque_on` that is
/// below one half or missing. A joint without a `cmd_<joint>` channel is never driven. A prescribed joint follows its
/// measured `q_<joint>`, smoothed.
#[derive(Clone, Debug, PartialEq)]
pub struct Replay {
    clock_s: Vec<f64>,
    /// Tolerance of the time stamps for rounding, in s.
    rounded_s: f64,
    /// Mean rate of the clock; 0 without any.
    rate_hz: f64,
    commands: Vec<Option<Vec<f64>>>,
    torque_on: Option<Vec<f64>>,
    /// Smoothed measured motions of the prescribed joints.
    motions: Vec<Option<Vec<Motion>>>,
    /// Smooths the torques that these motions require.
    smoother: Option<Smoother>,
    /// Over how long each sample is a mean, in s.
    mean_s: f64,
}

impl Replay {
    /// The drive that repeats the commands of `robot` in `log`. Time counts from the log's first sample.
    pub fn new(log: &Log, robot: &Robot) -> Self {
        let values = |name: &str| log.channel(name).map(|channel| channel.values.clone());
        let commands = |name: &str| log.channel(name).map(|channel| missing::held(log, &channel.values));
        let followed = |link: &Link| {
            let prescribed = link.joint.actuator == Actuator::Prescribed;
            let measured = log.channel(&format!("q_{}", link.joint.name)).filter(|_| prescribed)?;
            complete(log.clock_s(), finely(log.clock_s(), &measured.values))
        };
        let start_s = log.clock_s().first().copied().unwrap_or(0.0);
        let motions: Vec<_> = robot.movable().map(|(_, link)| followed(link)).collect();
        let clock_s: Vec<f64> = log.clock_s().iter().map(|t| t - start_s).collect();
        let long_s = clock_s.last().copied().unwrap_or(0.0);
        Replay {
            rate_hz: if long_s > 0.0 { clock_s.len().saturating_sub(1) as f64 / long_s } else { 0.0 },
            smoother: motions.iter().any(Option::is_some).then(|| Smoother::new(&clock_s)),
            clock_s,
            rounded_s: ROUNDED * log.usual_step_s().unwrap_or(0.0),
            commands: robot.movable().map(|(_, link)| commands(&format!("cmd_{}", link.joint.name))).collect(),
            torque_on: values("torque_on"),
            motions,
            mean_s: 0.0,
        }
    }

    /// The same for samples that are means over this long, in s.
    #[must_use]
    pub fn of_means(self, mean_s: f64) -> Self {
        Replay { mean_s, ..self }
    }
}

impl Replay {
    /// The log's clock from its first sample, in s.
    pub fn clock_s(&self) -> &[f64] {
        &self.clock_s
    }

    /// Whether a joint follows its measured motion.
    pub fn follows(&self, joint: usize) -> bool {
        self.motions.get(joint).is_some_and(Option::is_some)
    }

    /// Torques on the log's clock, smoothed as measured ones are where joints follow measured motions.
    pub(crate) fn smoothed(&self, torques: &[f64]) -> Vec<f64> {
        self.smoother.as_ref().map_or_else(|| torques.to_vec(), |smoother| smoother.smoothed(torques))
    }

    /// Index of the sample that is held at a time. On an even clock it is the expected one, or the one before.
    fn held(&self, time_s: f64) -> usize {
        let time_s = time_s + self.rounded_s;
        let is_held = |&i: &usize| {
            let until = |&next_s: &f64| time_s < next_s;
            self.clock_s.get(i).is_some_and(|&since_s| since_s <= time_s) && self.clock_s.get(i + 1).is_none_or(until)
        };
        let expected = (time_s * self.rate_hz) as usize;
        let near = [expected, expected.wrapping_sub(1)].into_iter().find(is_held);
        near.unwrap_or_else(|| self.clock_s.partition_point(|&t| t <= time_s).saturating_sub(1))
    }

    /// Command of a joint at a sample; NaN while torque is off.
    fn command_at(&self, joint: usize, sample: usize) -> f64 {
        let on = self.torque_on.as_ref().is_none_or(|on| on.get(sample).is_some_and(|&on| on >= 0.5));
        let values = self.commands.get(joint).and_then(Option::as_ref);
        values.and_then(|values| values.get(sample)).copied().filter(|_| on).unwrap_or(f64::NAN)
    }
}

/// Fills the gaps of a smoothed motion: linear across gaps, constant beyond the ends. `None` if every sample is
/// missing.
fn complete(clock_s: &[f64], motion: Vec<Motion>) -> Option<Vec<Motion>> {
    let present: Vec<usize> = (0..motion.len()).filter(|&i| motion[i].value.is_finite()).collect();
    if present.is_empty() || present.len() == motion.len() {
        return (!present.is_empty()).then_some(motion);
    }
    let known_s: Vec<f64> = present.iter().map(|&i| clock_s[i]).collect();
    let filled = |of: fn(&Motion) -> f64| {
        interpolate(&known_s, &present.iter().map(|&i| of(&motion[i])).collect::<Vec<_>>(), clock_s)
    };
    let parts = filled(|m| m.value).into_iter().zip(filled(|m| m.velocity)).zip(filled(|m| m.acceleration));
    Some(parts.map(|((value, velocity), acceleration)| Motion { value, velocity, acceleration }).collect())
}

/// A motion after a time, at constant acceleration.
fn extrapolated(motion: &Motion, time_s: f64) -> Motion {
    let Motion { value, velocity, acceleration } = *motion;
    let velocity = velocity + time_s * acceleration;
    Motion { value: value + time_s * (velocity - 0.5 * time_s * acceleration), velocity, acceleration }
}

/// The motion between two samples, each with its distance in time: their extrapolations are blended.
fn blended((before, since_s): (&Motion, f64), (after, until_s): (&Motion, f64)) -> Motion {
    let (a, b) = (extrapolated(before, since_s), extrapolated(after, -until_s));
    let share = since_s / (since_s + until_s);
    let between = |a: f64, b: f64| a + share * (b - a);
    Motion {
        value: between(a.value, b.value),
        velocity: between(a.velocity, b.velocity),
        acceleration: between(a.acceleration, b.acceleration),
    }
}

impl Drive for Replay {
    fn mean_s(&self) -> f64 {
        self.mean_s
    }

    fn motions(&self, time_s: f64, joints: &[usize], motions: &mut [Option<Motion>]) {
        let i = self.held(time_s);
        let since_s = time_s - self.clock_s[i];
        let until_s = self.clock_s.get(i + 1).map(|next_s| next_s - time_s);
        let at = |motion: &Vec<Motion>| match (until_s, motion.get(i + 1)) {
            (Some(until_s), Some(next)) if since_s.abs() > self.rounded_s => {
                blended((&motion[i], since_s), (next, until_s))
            }
            _ => motion[i],
        };
        for &joint in joints {
            motions[joint] = self.motions.get(joint).and_then(Option::as_ref).map(at);
        }
    }

    fn command(&self, time_s: f64, command: &mut [f64]) {
        let sample = self.held(time_s);
        command.iter_mut().enumerate().for_each(|(joint, command)| *command = self.command_at(joint, sample));
    }

    fn over(&self, start_s: f64, end_s: f64, command: &mut [f64]) {
        if self.commands.iter().all(Option::is_none) {
            return command.fill(f64::NAN);
        }
        let (first, last) = (self.held(start_s), self.held(end_s - 2.0 * self.rounded_s));
        if last <= first {
            return self.command(start_s, command);
        }
        for (joint, command) in command.iter_mut().enumerate() {
            let (mut sum, mut driven_s) = (0.0, 0.0);
            for sample in first..=last {
                let begins = if sample == first { start_s } else { self.clock_s[sample] };
                let ends = if sample == last { end_s } else { self.clock_s[sample + 1] };
                let value = self.command_at(joint, sample);
                if !value.is_nan() {
                    sum += (ends - begins) * value;
                    driven_s += ends - begins;
                }
            }
            // Torque is on in a step if it is on for at least half of it.
            *command = if 2.0 * driven_s >= end_s - start_s { sum / driven_s } else { f64::NAN };
        }
    }
}
