//! The control path of a rollout: from the drive's references through commands, their effects, motors and their effects
//! to the joint-level forces.

use super::joint_control::{JointControl, joint_controls};
use super::neighbours::NeighbourTracker;
use crate::actuation::{JointInput, TorqueBound};
use crate::drive::Drive;
use crate::effects::{PlacedEffect, SiteKind};
use crate::engine::{Affine, Dynamics, PrescribedMotion};
use crate::robot::{Link, Robot};
use crate::setup::Setup;
use btr_core::signal::smooth::Motion;
use btr_core::world::WorldError;

/// The control path of a rollout.
pub(crate) struct Control<'a> {
    reference: ReferenceTracker<'a>,
    joints: Vec<JointControl>,
    dt_s: f64,
    /// Start time on the clock of time-dependent laws.
    begins_s: f64,
    /// Whether any effect acts on all joints at once; only then the load is computed.
    coupled: bool,
    /// Sum of the absolute values of all motors' torques in the last step.
    load: f64,
    /// Torques that prescribed motions require; empty if there are none.
    prescribed_torques: Vec<f64>,
    /// Positions and velocities of the joints at the beginning of the step.
    states: Vec<(f64, f64)>,
    /// The motions of prescribed joints over the step.
    motions: Vec<Option<PrescribedMotion>>,
    /// The prescribed joints.
    prescribed: Vec<usize>,
    /// Their motions at the beginning and at the end of the step, in their places among all joints.
    ends: [Vec<Option<Motion>>; 2],
    neighbours: NeighbourTracker,
}

/// The drive's references at the previous and the next tick.
struct ReferenceTracker<'a> {
    drive: &'a dyn Drive,
    control_s: f64,
    /// Index of the previous tick; `usize::MAX` before the first.
    tick: usize,
    last: Vec<f64>,
    next: Vec<f64>,
}

impl<'a> Control<'a> {
    /// Allocates all memory of the rollout.
    pub(crate) fn new(
        robot: &Robot,
        effects: &[PlacedEffect],
        setup: &Setup,
        drive: &'a dyn Drive,
    ) -> Result<Self, WorldError> {
        let joints = joint_controls(robot, effects, setup)?;
        let reference = ReferenceTracker::new(drive, setup.control_s, joints.len());
        let coupled = effects.iter().any(|placed| placed.effect.spec().site == SiteKind::Robot);
        let prescribed: Vec<usize> = (0..joints.len()).filter(|&joint| joints[joint].motor.is_prescribed()).collect();
        let prescribed_torques = if prescribed.is_empty() { Vec::new() } else { vec![f64::NAN; joints.len()] };
        let (dt_s, begins_s) = (setup.dt_s, setup.begins_s);
        let (states, motions) = (Vec::with_capacity(joints.len()), vec![None; joints.len()]);
        let ends = [vec![None; joints.len()], vec![None; joints.len()]];
        let neighbours = NeighbourTracker::new(robot, effects)?;
        Ok(Control {
            reference,
            joints,
            dt_s,
            begins_s,
            coupled,
            load: 0.0,
            prescribed_torques,
            states,
            motions,
            prescribed,
            ends,
            neighbours,
        })
    }

    /// Updates the commands to the references at the present time `time_s`.
    pub(crate) fn update_references(&mut self, time_s: f64, engine: &dyn Dynamics) {
        self.reference.advance(time_s, engine);
        let fraction = self.reference.fraction(time_s);
        for (i, joint) in self.joints.iter_mut().enumerate() {
            joint.command =
                if joint.interpolated { self.reference.interpolated(i, fraction) } else { self.reference.last[i] };
        }
    }

    /// Sets the joint-level forces for the step that begins at `time_s`.
    pub(crate) fn act(&mut self, time_s: f64, engine: &mut dyn Dynamics) {
        self.follow(time_s, engine);
        if self.coupled {
            let states = self.joints.iter().zip(&self.states);
            self.load = states.map(|(joint, &(q, dq))| joint.torque(q, dq).abs()).sum();
        }
        // Before any joint acts, so that their order does not matter.
        let acceleration = |joint: usize, dq: f64| match &self.motions[joint] {
            Some(motion) => motion.from.acceleration,
            None => self.joints[joint].before.map_or(0.0, |before| (dq - before) / self.dt_s),
        };
        self.neighbours.update(&self.states, |joint, (q, dq)| self.joints[joint].torque(q, dq), acceleration);
        let (midpoint, supports_prescribed, enforces_bounds) =
            (engine.midpoint(), engine.supports_prescribed(), engine.enforces_bounds());
        let (in_the_middle, at_the_end) =
            (self.reference.fraction(time_s + 0.5 * self.dt_s), self.reference.fraction(time_s + self.dt_s));
        for (i, (joint, &(q, dq))) in self.joints.iter_mut().zip(&self.states).enumerate() {
            let prescribed = self.motions[i];
            // A prescribed joint must be at its reference when the step ends.
            let command = match prescribed {
                Some(prescribed) => prescribed.to.value,
                None if joint.motor.is_prescribed() => self.reference.interpolated(i, at_the_end),
                // An engine that solves for the step's middle gets the reference there; a digital servo samples at its
                // own instants.
                None if joint.interpolated && midpoint && !joint.motor.is_sampled() => {
                    self.reference.interpolated(i, in_the_middle)
                }
                None => joint.command,
            };
            let (inertia, dt_s, load) = (joint.inertia, self.dt_s, self.load);
            // Only effects use these.
            let before = joint.before.filter(|_| !joint.instances.is_empty());
            let acceleration = before.map_or(0.0, |before| (dq - before) / dt_s);
            let torque = if joint.instances.is_empty() { 0.0 } else { joint.torque(q, dq) };
            joint.before = Some(dq);
            let state = JointInput {
                time_s: self.begins_s + time_s,
                dt_s,
                q,
                dq,
                acceleration,
                midpoint,
                inertia,
                torque,
                load,
                command,
                mean_s: prescribed.map_or(0.0, |motion| motion.mean_s),
                neighbours: self.neighbours.of(i),
            };
            let dof = match prescribed.filter(|_| supports_prescribed) {
                Some(prescribed) => joint.follow_prescribed(prescribed, &state),
                None => joint.act(&state, enforces_bounds),
            };
            engine.set_joint(i, &dof);
        }
        if !self.prescribed_torques.is_empty() {
            self.read_prescribed_torques(engine);
        }
    }

    /// Updates the joints' states: those of prescribed joints are their motion's, also in the first step, whose start
    /// velocity is not exactly theirs.
    fn follow(&mut self, time_s: f64, engine: &dyn Dynamics) {
        if self.has_prescribed() {
            self.follow_motions(time_s);
        }
        let exactly = engine.supports_prescribed();
        let states = engine.positions().iter().copied().zip(engine.velocities().iter().copied());
        let state = |(state, motion): ((f64, f64), &Option<PrescribedMotion>)| {
            motion.filter(|_| exactly).map_or(state, |motion| (motion.from.value, motion.from.velocity))
        };
        self.states.clear();
        self.states.extend(states.zip(&self.motions).map(state));
    }

    /// Updates the motions of prescribed joints.
    fn follow_motions(&mut self, time_s: f64) {
        let drive = self.reference.drive;
        let [from, to] = &mut self.ends;
        drive.motions(time_s, &self.prescribed, from);
        drive.motions(time_s + self.dt_s, &self.prescribed, to);
        let mean_s = drive.mean_s();
        for &joint in &self.prescribed {
            let ends = from[joint].zip(to[joint]);
            self.motions[joint] = ends.map(|(from, to)| PrescribedMotion { from, to, mean_s });
        }
    }

    /// Reads the torques that prescribed motions require, which count as their motors' torques.
    fn read_prescribed_torques(&mut self, engine: &mut dyn Dynamics) {
        self.prescribed_torques.fill(f64::NAN);
        engine.prescribed_torques(&mut self.prescribed_torques);
        for (joint, &torque) in
            self.joints.iter_mut().zip(&self.prescribed_torques).filter(|(_, torque)| !torque.is_nan())
        {
            (joint.transmitted, joint.bound) = (Affine::constant(torque), TorqueBound::NONE);
            joint.known_torque = Some(torque);
        }
    }

    /// An error of an effect, if there is one.
    pub(crate) fn trouble(&self, robot: &Robot) -> Option<WorldError> {
        let of = |(joint, (_, link)): (&JointControl, (usize, &Link))| {
            let mut instances = joint.instances.iter();
            instances.find_map(|s| s.effect.trouble(&s.values, &s.memory, &link.joint.name))
        };
        self.joints.iter().zip(robot.movable()).find_map(of)
    }

    /// Whether any joint's motion is prescribed.
    pub(crate) fn has_prescribed(&self) -> bool {
        !self.prescribed_torques.is_empty()
    }

    /// Whether any motor's torque is known at the beginning of a step.
    pub(crate) fn knows_torques(&self) -> bool {
        self.joints.iter().any(|joint| joint.known_torque.is_some())
    }

    /// The torque of joint `i`'s motor at the beginning of the last prepared step, where it is known independently of
    /// the step.
    pub(crate) fn known_torque(&self, i: usize) -> Option<f64> {
        self.joints[i].known_torque
    }

    /// The command of joint `i`, before any effect; NaN when it is not driven.
    pub(crate) fn command(&self, i: usize) -> f64 {
        self.joints[i].command
    }

    /// The torque of joint `i`'s motor in the state at the end of the last step.
    pub(crate) fn torque(&self, i: usize, q: f64, dq: f64) -> f64 {
        self.joints[i].torque(q, dq)
    }
}

impl<'a> ReferenceTracker<'a> {
    fn new(drive: &'a dyn Drive, control_s: f64, joints: usize) -> Self {
        let undriven = vec![f64::NAN; joints];
        ReferenceTracker { drive, control_s, tick: usize::MAX, last: undriven.clone(), next: undriven }
    }

    /// Queries the drive when another reference is due.
    fn advance(&mut self, time_s: f64, engine: &dyn Dynamics) {
        // The offset absorbs rounding: a step's time is a multiple of dt, a reference's one of control_s.
        let tick = (time_s / self.control_s + 1e-6).floor() as usize;
        if tick == self.tick {
            return;
        }
        if self.tick.checked_add(1) == Some(tick) {
            std::mem::swap(&mut self.last, &mut self.next);
        } else {
            self.query(tick, engine);
            std::mem::swap(&mut self.last, &mut self.next);
        }
        self.query(tick + 1, engine);
        self.tick = tick;
    }

    /// Queries the reference from this tick to the next one, into `next`.
    fn query(&mut self, tick: usize, engine: &dyn Dynamics) {
        let (start_s, end_s) = (tick as f64 * self.control_s, (tick + 1) as f64 * self.control_s);
        self.drive.over(start_s, end_s, &mut self.next);
        if self.drive.senses() {
            self.drive.react(start_s, engine, &mut self.next);
        }
    }

    /// Fraction of the control period since the previous tick.
    fn fraction(&self, time_s: f64) -> f64 {
        // Before time zero the first reference is held.
        (time_s / self.control_s - self.tick as f64).max(0.0)
    }

    /// The reference of joint `i`, interpolated linearly.
    fn interpolated(&self, i: usize, fraction: f64) -> f64 {
        self.last[i] + fraction * (self.next[i] - self.last[i])
    }
}
