//! A policy: sensor feedback corrects the references of another drive at every controller tick.

use super::Drive;
use crate::engine::Dynamics;
use crate::robot::site;
use crate::robot::{Joint, Robot};
use btr_core::space::Dim;
use nalgebra::Vector3;

/// Sensors of a policy: the name in experiment files, and the description.
pub const SENSES: &[(&str, &str)] = &[
    ("tilt", "x and y of the upward direction in the root's axes"),
    ("gyro", "the root's angular velocity in its own axes, in rad/s"),
    ("positions", "position of every joint relative to its start, in rad (m)"),
    ("velocities", "velocity of every joint, in rad/s (m/s)"),
    ("feet", "1 for a foot in contact, 0 otherwise"),
    ("clock", "sine and cosine of omega_rad_s times the time"),
];

/// Bound of a weight onto a joint: largest change of its reference per unit of input, in the unit of its command.
const PER_UNIT: f64 = 0.6;
/// The same bound per rad/s or m/s.
const PER_SPEED: f64 = 0.06;
/// Bound of a weight onto a hidden unit; it is larger, so that the unit can saturate.
const HIDDEN: f64 = 5.0;

/// An input of a policy.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Input {
    /// Always 1.
    One,
    TiltX,
    TiltY,
    Gyro(usize),
    Position(usize),
    Velocity(usize),
    Foot(usize),
    Sine,
    Cosine,
}

impl Input {
    /// Bound of a weight from this input to a joint.
    fn bound(self) -> f64 {
        if matches!(self, Input::Gyro(_) | Input::Velocity(_)) { PER_SPEED } else { PER_UNIT }
    }

    fn read(self, policy: &Policy, time_s: f64, engine: &dyn Dynamics) -> f64 {
        let into_root = |world: Vector3<f64>| engine.base().pose.rotation.inverse() * world;
        match self {
            Input::One => 1.0,
            Input::TiltX => into_root(Vector3::z()).x,
            Input::TiltY => into_root(Vector3::z()).y,
            Input::Gyro(axis) => into_root(engine.base().angular_rad_s)[axis],
            Input::Position(joint) => engine.positions()[joint] - policy.starts[joint],
            Input::Velocity(joint) => engine.velocities()[joint],
            Input::Foot(foot) => f64::from(engine.foot_force_n(foot) > 0.0),
            Input::Sine => (policy.plan.omega_rad_s * time_s).sin(),
            Input::Cosine => (policy.plan.omega_rad_s * time_s).cos(),
        }
    }
}

/// Inputs, outputs and structure of a policy.
#[derive(Clone, Debug, PartialEq)]
pub struct PolicyPlan {
    /// Names from [`SENSES`].
    pub sensors: Vec<String>,
    /// Pattern of the joints that it corrects.
    pub joints: String,
    /// Number of hidden units (tanh); without them the policy is linear.
    pub hidden: usize,
    /// Angular frequency of the clock input.
    pub omega_rad_s: f64,
}

impl PolicyPlan {
    /// Inputs by name, the constant first.
    fn inputs(&self, robot: &Robot) -> Vec<(String, Input)> {
        let joints: Vec<&Joint> = robot.movable().map(|(_, link)| &link.joint).collect();
        let feet: Vec<&str> = robot.links.iter().filter(|link| link.foot).map(|link| link.name.as_str()).collect();
        let each = |prefix: &str, names: &[&str], input: fn(usize) -> Input| -> Vec<(String, Input)> {
            names.iter().enumerate().map(|(i, name)| (format!("{prefix}_{name}"), input(i))).collect()
        };
        let names: Vec<&str> = joints.iter().map(|joint| joint.name.as_str()).collect();
        let mut inputs = vec![("offset".to_owned(), Input::One)];
        for sensor in &self.sensors {
            inputs.extend(match sensor.as_str() {
                "tilt" => vec![("tilt_x".to_owned(), Input::TiltX), ("tilt_y".to_owned(), Input::TiltY)],
                "gyro" => each("gyro", &["x", "y", "z"], Input::Gyro),
                "positions" => each("q", &names, Input::Position),
                "velocities" => each("dq", &names, Input::Velocity),
                "feet" => each("foot", &feet, Input::Foot),
                "clock" => vec![("sine".to_owned(), Input::Sine), ("cosine".to_owned(), Input::Cosine)],
                _ => Vec::new(),
            });
        }
        inputs
    }

    /// Joints that it corrects, with their indices among the movable ones.
    fn outputs<'r>(&self, robot: &'r Robot) -> Vec<(usize, &'r Joint)> {
        let joints = robot.movable().map(|(_, link)| &link.joint).enumerate();
        joints.filter(|(_, joint)| site::matches(&self.joints, &joint.name)).collect()
    }

    /// Every weight, `INPUT@OUTPUT`: for each hidden unit those of all inputs, then those of all joints; without hidden
    /// units, for each input those of all joints. All are initially 0, which leaves the references unchanged.
    pub(super) fn dims(&self, robot: &Robot) -> Vec<Dim> {
        let (inputs, outputs) = (self.inputs(robot), self.outputs(robot));
        let dim = |from: &str, to: &str, unit: &str, most: f64| {
            let mut dim = Dim::new(format!("{from}@{to}"), unit, -most, most);
            dim.nominal = Some(0.0);
            dim
        };
        let to_joints = |from: &str, most: f64| {
            let to_joint = |(_, joint): &(usize, &Joint)| dim(from, &joint.name, joint.command_unit(), most);
            outputs.iter().map(to_joint).collect::<Vec<_>>()
        };
        if self.hidden == 0 {
            return inputs.iter().flat_map(|(name, input)| to_joints(name, input.bound())).collect();
        }
        let unit = |number: usize| {
            let hidden = format!("hidden_{number}");
            let into = inputs.iter().map(|(name, input)| dim(name, &hidden, "1", HIDDEN * input.bound() / PER_UNIT));
            into.chain(to_joints(&hidden, PER_UNIT)).collect::<Vec<_>>()
        };
        (1..=self.hidden).flat_map(unit).collect()
    }
}

/// Another drive's references, corrected at every tick. The readings at a tick change the reference of the next one,
/// which is the delay of a controller with this period. The readings are free of noise.
pub(super) struct Policy {
    around: Box<dyn Drive>,
    plan: PolicyPlan,
    inputs: Vec<Input>,
    outputs: Vec<usize>,
    /// Start position of every joint, and the range of its references.
    starts: Vec<f64>,
    limits: Vec<(f64, f64)>,
    /// In the order of [`PolicyPlan::dims`].
    weights: Vec<f64>,
}

impl Policy {
    pub(super) fn new(plan: &PolicyPlan, around: Box<dyn Drive>, robot: &Robot, weights: &[f64]) -> Self {
        let joints = || robot.movable().map(|(_, link)| &link.joint);
        Policy {
            around,
            inputs: plan.inputs(robot).into_iter().map(|(_, input)| input).collect(),
            outputs: plan.outputs(robot).into_iter().map(|(joint, _)| joint).collect(),
            starts: joints().map(|joint| joint.start).collect(),
            limits: joints().map(|joint| joint.limits).collect(),
            weights: weights.to_vec(),
            plan: plan.clone(),
        }
    }

    /// Adds a unit's output, weighted, to all joints.
    fn add(&self, value: f64, weights: &[f64], command: &mut [f64]) {
        self.outputs.iter().zip(weights).for_each(|(&joint, weight)| command[joint] += weight * value);
    }
}

impl Drive for Policy {
    /// References of the other drive, before any correction.
    fn command(&self, time_s: f64, command: &mut [f64]) {
        self.around.command(time_s, command);
    }

    fn over(&self, start_s: f64, end_s: f64, command: &mut [f64]) {
        self.around.over(start_s, end_s, command);
    }

    fn place(&self, robot: &mut Robot) {
        self.around.place(robot);
    }

    fn senses(&self) -> bool {
        true
    }

    fn react(&self, time_s: f64, engine: &dyn Dynamics, command: &mut [f64]) {
        let (inputs, outputs) = (self.inputs.len(), self.outputs.len());
        if self.plan.hidden == 0 {
            for (input, weights) in self.inputs.iter().zip(self.weights.chunks_exact(outputs.max(1))) {
                self.add(input.read(self, time_s, engine), weights, command);
            }
        }
        for unit in self.weights.chunks_exact(inputs + outputs).take(self.plan.hidden) {
            let (into, out) = unit.split_at(inputs);
            let sum: f64 = self.inputs.iter().zip(into).map(|(input, w)| w * input.read(self, time_s, engine)).sum();
            self.add(sum.tanh(), out, command);
        }
        for &joint in &self.outputs {
            let (low, high) = self.limits[joint];
            command[joint] = command[joint].clamp(low, high);
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::drive::DriveKind;
    use crate::presets::ant::{OMEGA_RAD_S, ant};
    use crate::rollout::{RolloutRequest, simulate, simulate_all};
    use crate::setup::{EngineName, Sensors, Setup};
    use btr_core::log::Log;
    use proptest::prelude::*;

    const JOINTS: &str = "*_pitch";

    fn plan(hidden: usize) -> PolicyPlan {
        let sensors = SENSES.iter().map(|sense| sense.0.to_owned()).collect();
        PolicyPlan { sensors, joints: JOINTS.to_owned(), hidden, omega_rad_s: 7.0 }
    }

    /// The ant's tripod gait, corrected with these weights, repeated cyclically.
    fn policy(hidden: usize, weights: &[f64]) -> Policy {
        let (plan, robot) = (plan(hidden), ant());
        let all = plan.dims(&robot).len();
        Policy::new(
            &plan,
            Box::new(crate::presets::ant::tripod()),
            &robot,
            &weights.iter().copied().cycle().take(all).collect::<Vec<_>>(),
        )
    }

    /// References are held, so that the log contains them unchanged.
    fn setup(engine: EngineName) -> Setup {
        let sensors = Sensors { velocities: true, torques: false, imu: true, feet: true };
        Setup { dt_s: 0.005, duration_s: 0.4, control_s: 0.05, sensors, engine, ..Setup::default() }
    }

    /// Value of an input, from a log.
    fn logged(log: &Log, input: &str, row: usize, next_s: f64) -> f64 {
        let at = |channel: &str| log.channel(channel).unwrap().values[row];
        let (w, x, y, z) = (at("base_qw"), at("base_qx"), at("base_qy"), at("base_qz"));
        match input.split_once('_') {
            None if input == "offset" => 1.0,
            None if input == "sine" => (7.0 * next_s).sin(),
            None => (7.0 * next_s).cos(),
            // The third row of the rotation's matrix.
            Some(("tilt", "x")) => 2.0 * (x * z - w * y),
            Some(("tilt", _)) => 2.0 * (y * z + w * x),
            Some(("gyro", axis)) => at(&format!("imu_gyro_{axis}")),
            Some(("q", joint)) => {
                at(input) - ant().movable().find(|(_, l)| l.joint.name == joint).unwrap().1.joint.start
            }
            Some(("foot", _)) => f64::from(row > 0 && at(input) > 0.0),
            Some(_) => at(input),
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]

        #[test]
        fn readings_at_a_tick_correct_the_reference_of_the_next(
            weights in prop::collection::vec(-0.05..0.05, 7..23),
            hidden in 0usize..4,
            rapier: bool,
        ) {
            let engine = if rapier { EngineName::Rapier } else { EngineName::Auto };
            let (drive, robot) = (policy(hidden, &weights), ant());
            let log = simulate(RolloutRequest::new(&robot, &drive).setup(&setup(engine))).unwrap();
            let (inputs, outputs) = (drive.plan.inputs(&robot), drive.plan.outputs(&robot));
            let mut references = vec![0.0; robot.movable().count()];
            for tick in 1..8 {
                let (row, next_s) = (10 * tick, 0.05 * tick as f64);
                let x: Vec<f64> = inputs.iter().map(|(name, _)| logged(&log, name, row - 10, next_s)).collect();
                crate::presets::ant::tripod().command(next_s, &mut references);
                for (o, (joint, output)) in outputs.iter().enumerate() {
                    let correction: f64 = if hidden == 0 {
                        x.iter().zip(drive.weights[o..].iter().step_by(outputs.len())).map(|(x, w)| x * w).sum()
                    } else {
                        let unit = |w: &[f64]| x.iter().zip(w).map(|(x, w)| x * w).sum::<f64>().tanh() * w[x.len() + o];
                        drive.weights.chunks(x.len() + outputs.len()).map(unit).sum()
                    };
                    let (low, high) = output.limits;
                    let expected = (references[*joint] + correction).clamp(low, high);
                    let logged = log.channel(&format!("cmd_{}", output.name)).unwrap().values[row];
                    let name = &output.name;
                    prop_assert!((logged - expected).abs() < 1e-9, "{name} at {next_s}: {logged}, not {expected}");
                }
            }
        }

        #[test]
        fn drives_simulated_together_use_their_own_readings(weights in prop::collection::vec(-0.05..0.05, 7..23)) {
            let (robot, setup) = (ant(), setup(EngineName::Auto));
            let drives: Vec<Policy> = (0..5).map(|i| policy(i % 3, &weights[i..])).collect();
            let candidate = |drive| RolloutRequest::new(&robot, drive).setup(&setup);
            let together = simulate_all(drives.iter().map(|d| candidate(d as &dyn Drive)).collect());
            for (drive, log) in drives.iter().zip(together) {
                prop_assert_eq!(log, simulate(RolloutRequest::new(&robot, drive).setup(&setup)));
            }
        }
    }

    #[test]
    fn with_zero_weights_it_equals_the_drive_that_it_corrects() {
        let robot = ant();
        for hidden in [0, 2] {
            let log = simulate(RolloutRequest::new(&robot, &policy(hidden, &[0.0])).setup(&setup(EngineName::Auto)));
            assert_eq!(
                log,
                simulate(RolloutRequest::new(&robot, &crate::presets::ant::tripod()).setup(&setup(EngineName::Auto)))
            );
        }
    }

    #[test]
    fn weights_have_unique_names_and_start_at_zero() {
        let robot = ant();
        let kind = |hidden| DriveKind::Policy {
            around: Box::new(DriveKind::Sine { omega_rad_s: OMEGA_RAD_S }),
            policy: plan(hidden),
        };
        // 36 of the sine; 1 offset, 2 of tilt, 3 of gyro, 18 positions, 18 velocities, 6 feet, 2 of the clock; 6
        // joints.
        for (hidden, count) in [(0, 36 + 50 * 6), (3, 36 + 3 * (50 + 6))] {
            let dims = kind(hidden).dims(&robot).unwrap();
            assert_eq!(dims.len(), count);
            assert!(dims[36..].iter().all(|dim| dim.nominal == Some(0.0)));
            let names: std::collections::BTreeSet<&str> = dims.iter().map(|dim| dim.name.as_str()).collect();
            assert_eq!(names.len(), count);
        }
    }
}
