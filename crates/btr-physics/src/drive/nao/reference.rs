//! Joint references at a fixed rate with linear interpolation, as the Nao's joint controller receives them.

use crate::drive::Drive;
use crate::robot::{JointKind, Robot};
use nalgebra::Isometry3;

/// Time between two references of the real robot's controller, in s (paper, 4.2.1).
pub const CONTROL_S: f64 = 0.055;
/// Physics steps between two references (paper, 4.2.1).
pub const STEPS_PER_CONTROL: usize = 7;

/// A precomputed motion: all joints every 55 ms, linear interpolation between, held at the end.
#[derive(Clone, Debug, PartialEq)]
pub struct References {
    joints: usize,
    /// One row of joints per reference.
    values: Vec<f64>,
    start_root: Isometry3<f64>,
    start_q: Vec<f64>,
    reached: bool,
}

impl References {
    /// Empty motion of `joints` joints that start at 0.
    pub(super) fn new(joints: usize) -> Self {
        let (start_root, start_q) = (Isometry3::identity(), vec![0.0; joints]);
        References { joints, values: Vec::new(), start_root, start_q, reached: true }
    }

    /// Sets the start state of the motion.
    pub(super) fn begin(&mut self, root: Isometry3<f64>, q: &[f64]) {
        self.start_root = root;
        self.start_q.copy_from_slice(q);
    }

    /// Appends a reference; `reached` is whether it attains its target.
    pub(super) fn push(&mut self, q: &[f64], reached: bool) {
        self.values.extend_from_slice(q);
        self.reached &= reached;
    }

    /// Clips the references to the joints' ranges and speed limits, as the robot's own motion layer does: a joint with
    /// a faster reference follows at its speed limit.
    pub(super) fn clip(&mut self, robot: &Robot) {
        let mut before = self.start_q.clone();
        for row in self.values.chunks_mut(self.joints.max(1)) {
            for ((q, before), (_, link)) in row.iter_mut().zip(&mut before).zip(robot.movable()) {
                let (limits, most) = (link.joint.limits, link.joint.speed_limit * CONTROL_S);
                *q = q.max(*before - most).min(*before + most).max(limits.0).min(limits.1);
                *before = *q;
            }
        }
    }

    /// The reference that was appended last.
    pub(super) fn last_mut(&mut self) -> &mut [f64] {
        let from = self.values.len().saturating_sub(self.joints);
        &mut self.values[from..]
    }

    /// Sets the robot's start state to that of the motion: the root's pose and the joint angles.
    pub fn place(&self, robot: &mut Robot) {
        robot.start = self.start_root;
        let movable = robot.links.iter_mut().skip(1).filter(|link| link.joint.kind != JointKind::Fixed);
        for (link, &angle) in movable.zip(&self.start_q) {
            link.joint.start = angle;
        }
    }

    /// Whether all references are within the legs' reach; otherwise the legs come as close as they can.
    pub fn reached(&self) -> bool {
        self.reached
    }

    fn row(&self, index: usize) -> &[f64] {
        let last = (self.values.len() / self.joints).saturating_sub(1);
        let from = index.min(last) * self.joints;
        &self.values[from..from + self.joints]
    }
}

impl Drive for References {
    fn command(&self, time_s: f64, command: &mut [f64]) {
        let at = (time_s / CONTROL_S).max(0.0);
        let index = at as usize;
        let share = at - index as f64;
        for ((c, a), b) in command.iter_mut().zip(self.row(index)).zip(self.row(index + 1)) {
            *c = a + share * (b - a);
        }
    }
}
