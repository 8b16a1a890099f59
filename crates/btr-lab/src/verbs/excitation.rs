//! Candidate drives for distinguishing rival explanations: each joint alone and all together, within the range of the
//! logs.

use btr_core::log::{Log, LogError, Role};
use btr_physics::robot::{Actuator, Joint, Robot};
use std::f64::consts::TAU;

/// Time in which the joints move from their start to the middle of their ranges, in s.
const EASE_S: f64 = 1.0;

/// A kind of motion.
struct MotionKind {
    name: &'static str,
    /// Description for a sentence.
    description: &'static str,
    /// Share of the range that it uses.
    share: f64,
    /// Value between -1 and 1 as a function of time in s and of the elapsed share; NaN switches the torque off.
    wave: fn(f64, f64) -> f64,
}

const KINDS: [MotionKind; 8] = [
    MotionKind {
        name: "creep",
        description: "ramps that creep through zero velocity",
        share: 0.06,
        wave: |t, _| ramp(t / 4.0),
    },
    MotionKind {
        name: "slow_ramps",
        description: "slow ramps to and fro through zero velocity",
        share: 0.15,
        wave: |t, _| ramp(t / 3.0),
    },
    MotionKind { name: "ramps", description: "ramps to and fro", share: 0.7, wave: |t, _| ramp(t / 2.5) },
    MotionKind {
        name: "steps",
        description: "steps",
        share: 0.8,
        wave: |t, _| LEVELS[(t / 0.8) as usize % LEVELS.len()],
    },
    MotionKind { name: "multisine", description: "a sum of sines", share: 0.8, wave: |t, _| multisine(t) },
    MotionKind { name: "chirp", description: "a sine that grows faster", share: 0.3, wave: |t, share| chirp(t, share) },
    MotionKind {
        name: "poses",
        description: "poses held across the range",
        share: 1.0,
        wave: |_, share| POSES[(share * 5.0) as usize % 5],
    },
    MotionKind {
        name: "free_swing",
        description: "torque off from a held pose, and a free swing",
        share: 0.7,
        wave: |_, share| free(share),
    },
];

const LEVELS: [f64; 7] = [1.0, -0.5, 0.3, -1.0, 0.6, -0.2, 0.9];
const POSES: [f64; 5] = [-1.0, -0.5, 0.0, 0.5, 1.0];

/// A triangle that begins in the middle.
fn ramp(turns: f64) -> f64 {
    4.0 * ((turns - 0.25).rem_euclid(1.0) - 0.5).abs() - 1.0
}

fn multisine(t: f64) -> f64 {
    (0..5).map(f64::from).map(|k| (TAU * (0.3 + 0.55 * k) * t + 2.4 * k * k).sin()).sum::<f64>() / 5.0
}

/// From 0.2 Hz to 5 Hz.
fn chirp(t: f64, share: f64) -> f64 {
    (TAU * (0.2 + 2.4 * share) * t).sin()
}

fn free(share: f64) -> f64 {
    if share < 0.25 { 1.0 } else { f64::NAN }
}

/// Range of a joint's commands in the logs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CommandRange {
    /// Least and greatest command.
    range: (f64, f64),
    /// Largest rate of change, per s.
    rate: f64,
}

impl CommandRange {
    /// `None` if the joint's command never changes.
    pub(crate) fn of(joint: &str, logs: &[Log]) -> Option<CommandRange> {
        let name = format!("cmd_{joint}");
        let mut commands = CommandRange { range: (f64::INFINITY, f64::NEG_INFINITY), rate: 0.0 };
        for log in logs {
            let Some(channel) = log.channel(&name) else { continue };
            let samples: Vec<(f64, f64)> = log
                .clock_s()
                .iter()
                .copied()
                .zip(channel.values.iter().copied())
                .filter(|(_, x)| x.is_finite())
                .collect();
            for (_, x) in &samples {
                commands.range = (commands.range.0.min(*x), commands.range.1.max(*x));
            }
            let rates = samples.windows(2).map(|pair| ((pair[1].1 - pair[0].1) / (pair[1].0 - pair[0].0)).abs());
            commands.rate = rates.fold(commands.rate, f64::max);
        }
        (commands.range.0 < commands.range.1).then_some(commands)
    }
}

/// Commands for all joints.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Excitation {
    /// The kind of motion.
    pub kind: &'static str,
    /// Its description for a sentence.
    pub description: &'static str,
    /// The joints that move.
    pub joints: Vec<String>,
    /// The commands.
    pub commands: Log,
}

/// Every kind of motion for every joint alone, and for all at once. A joint that never moved in the logs is held.
pub(crate) fn excitations(
    robot: &Robot,
    logs: &[Log],
    tick_s: f64,
    duration_s: f64,
) -> Result<Vec<Excitation>, LogError> {
    let joints: Vec<(&Joint, Option<CommandRange>)> =
        robot.movable().map(|(_, link)| (&link.joint, CommandRange::of(&link.joint.name, logs))).collect();
    let moving: Vec<usize> = (0..joints.len()).filter(|&i| joints[i].1.is_some()).collect();
    let mut groups: Vec<Vec<usize>> = moving.iter().map(|&i| vec![i]).collect();
    if moving.len() > 1 {
        groups.push(moving);
    }
    let clock: Vec<f64> = (0..=(duration_s / tick_s).round() as usize).map(|i| i as f64 * tick_s).collect();
    let mut all = Vec::new();
    for group in &groups {
        for kind in &KINDS {
            let mut commands = Log::new(clock.clone())?;
            for (i, (joint, range)) in joints.iter().enumerate() {
                let kind = group.contains(&i).then_some(kind);
                commands.insert(
                    format!("cmd_{}", joint.name),
                    joint.command_unit(),
                    Role::Command,
                    row(&clock, joint, *range, kind),
                )?;
            }
            let names = group.iter().map(|&i| joints[i].0.name.clone()).collect();
            all.push(Excitation { kind: kind.name, description: kind.description, joints: names, commands });
        }
    }
    Ok(all)
}

/// The commands of a joint: to the middle of its range, then the motion, never faster than in the logs.
fn row(clock: &[f64], joint: &Joint, range: Option<CommandRange>, kind: Option<&MotionKind>) -> Vec<f64> {
    let rest = match joint.actuator {
        Actuator::Torque { .. } | Actuator::Voltage { servo: None, .. } => 0.0,
        _ => joint.start,
    };
    let Some(CommandRange { range: (low, high), rate }) = range else { return vec![rest; clock.len()] };
    let (middle, reach) = (0.5 * (low + high), 0.5 * (high - low));
    let last_s = clock.last().copied().unwrap_or(0.0);
    let mut before: Option<(f64, f64)> = None;
    let command = |&t: &f64| {
        let eased = (t / EASE_S).min(1.0);
        let moving_s = (t - EASE_S).max(0.0);
        let wave =
            kind.map_or(0.0, |kind| kind.share * (kind.wave)(moving_s, moving_s / (last_s - EASE_S).max(EASE_S)));
        let requested = rest + eased * (middle - rest) + if t < EASE_S { 0.0 } else { reach * wave };
        let limited = match before {
            Some((then, was)) if requested.is_finite() => {
                was + (requested - was).clamp(-rate * (t - then), rate * (t - then))
            }
            _ => requested,
        };
        before = Some((t, limited)).filter(|_| limited.is_finite());
        limited
    };
    clock.iter().map(command).collect()
}
