//! What acts in the joints along a prescribed motion, without the links.

use super::joint_control::{JointControl, joint_controls};
use super::neighbours::NeighbourTracker;
use super::prepare::apply_static_effects;
use super::request::RolloutRequest;
use crate::actuation::JointInput;
use crate::drive::Drive;
use crate::effects;
use crate::engine::PrescribedMotion;
use crate::robot::Joint;
use crate::setup::Setup;
use btr_core::log::{Log, Role};
use btr_core::signal::smooth::Motion;
use btr_core::world::WorldError;

/// The torques in N·m (forces in N) that a prescribed motion requires of links that weigh nothing: friction, springs,
/// rotors and laws at the joints, as channels `tau_<joint>` on the clock of [`simulate`](super::simulate). Joints in
/// which nothing acts have no channel. Effects must depend on the motion alone; what they do to readings is left out.
///
/// This takes a fraction of the time of a simulation, whose torques are these and those of the links.
///
/// # Errors
/// As for [`simulate`](super::simulate).
pub fn joint_torques(request: RolloutRequest) -> Result<Log, WorldError> {
    let RolloutRequest { robot, drive, effects, setup, .. } = request;
    let (samples, steps_per_sample) = setup.samples(robot)?;
    let placed = effects::in_force(effects)?;
    let (robot, setup) = apply_static_effects(robot, &placed, setup)?;
    let joints = robot.movable().zip(joint_controls(&robot, &placed, &setup)?).enumerate();
    let acting = joints.filter(|(_, (_, control))| control.acts());
    let mut acting: Vec<ActingJoint> = acting
        .map(|(index, ((_, link), control))| ActingJoint {
            index,
            joint: &link.joint,
            control,
            torques: Vec::with_capacity(samples),
        })
        .collect();
    let mut neighbours = NeighbourTracker::new(&robot, &placed)?;
    let mut seen: Vec<usize> = acting.iter().map(|joint| joint.index).chain(neighbours.read()).collect();
    seen.sort_unstable();
    seen.dedup();
    let mut motions = MotionTracker::new(drive, &setup, robot.movable().count(), seen);
    let rest_steps = (setup.rest_s / setup.dt_s).round() as usize;
    for step in 0..=rest_steps + (samples - 1) * steps_per_sample {
        motions.advance((step as f64 - rest_steps as f64) * setup.dt_s);
        neighbours.update(&motions.states, |_, _| f64::NAN, |joint, _| motions.acceleration(joint));
        let is_sample = step >= rest_steps && (step - rest_steps).is_multiple_of(steps_per_sample);
        for joint in &mut acting {
            joint.act(&motions, &neighbours, is_sample);
        }
    }
    let sample_s = setup.dt_s * steps_per_sample as f64;
    let mut log = Log::new((0..samples).map(|i| i as f64 * sample_s).collect())?;
    for ActingJoint { joint, torques, .. } in acting.into_iter().filter(|acting| !acting.torques.is_empty()) {
        log.insert(format!("tau_{}", joint.name), joint.torque_unit(), Role::Measured, torques)?;
    }
    Ok(log)
}

/// A joint in which something acts, with its torque at each sample.
struct ActingJoint<'a> {
    index: usize,
    joint: &'a Joint,
    control: JointControl,
    torques: Vec<f64>,
}

impl ActingJoint<'_> {
    /// A step of its effects. A joint without a prescribed motion has no torque.
    fn act(&mut self, motions: &MotionTracker, neighbours: &NeighbourTracker, is_sample: bool) {
        let Some((motion, input)) = motions.of(self.index) else { return };
        let input = JointInput { inertia: self.control.inertia, neighbours: neighbours.of(self.index), ..input };
        let torque = self.control.follow_prescribed(motion, &input).required(&motion, 0.0);
        if is_sample {
            self.torques.push(torque);
        }
    }
}

/// The joints' motions, step by step.
struct MotionTracker<'a> {
    drive: &'a dyn Drive,
    /// Over how long each reading is a mean, in s.
    mean_s: f64,
    /// The joints whose motions are needed; those of the others stay unknown.
    seen: Vec<usize>,
    dt_s: f64,
    /// Start time on the clock of time-dependent laws.
    begins_s: f64,
    time_s: f64,
    motions: Vec<Option<Motion>>,
    /// Positions and velocities.
    states: Vec<(f64, f64)>,
    /// Mean accelerations over the last step.
    accelerations: Vec<f64>,
}

impl<'a> MotionTracker<'a> {
    fn new(drive: &'a dyn Drive, setup: &Setup, joints: usize, seen: Vec<usize>) -> Self {
        MotionTracker {
            drive,
            mean_s: drive.mean_s(),
            seen,
            dt_s: setup.dt_s,
            begins_s: setup.begins_s,
            time_s: 0.0,
            motions: vec![None; joints],
            states: vec![(0.0, f64::NAN); joints],
            accelerations: vec![0.0; joints],
        }
    }

    fn advance(&mut self, time_s: f64) {
        self.time_s = time_s;
        self.drive.motions(time_s, &self.seen, &mut self.motions);
        for &joint in &self.seen {
            let (to, velocity) = self.motions[joint].map_or((0.0, 0.0), |motion| (motion.value, motion.velocity));
            let before = self.states[joint].1;
            self.accelerations[joint] = if before.is_nan() { 0.0 } else { (velocity - before) / self.dt_s };
            self.states[joint] = (to, velocity);
        }
    }

    fn acceleration(&self, joint: usize) -> f64 {
        self.motions[joint].map_or(0.0, |motion| motion.acceleration)
    }

    /// The motion of a joint at the beginning of the coming step, and what effects on it read.
    fn of(&self, joint: usize) -> Option<(PrescribedMotion, JointInput<'static>)> {
        let (from, mean_s) = (self.motions[joint]?, self.mean_s);
        let input = JointInput {
            time_s: self.begins_s + self.time_s,
            dt_s: self.dt_s,
            q: from.value,
            dq: from.velocity,
            acceleration: self.accelerations[joint],
            midpoint: true,
            inertia: 0.0,
            torque: 0.0,
            load: 0.0,
            command: f64::NAN,
            mean_s,
            neighbours: None,
        };
        Some((PrescribedMotion { from, to: from, mean_s }, input))
    }
}
