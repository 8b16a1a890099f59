//! Joint references at a fixed rate, joined by straight lines: how the Nao's joint controller is told what to do.

use super::Drive;
use crate::nao::CONTROL_S;
use crate::robot::Robot;
use nalgebra::Isometry3;

/// A motion worked out beforehand: all joints every 55 ms, straight lines between, held at the end.
#[derive(Clone, Debug, PartialEq)]
pub struct References {
    joints: usize,
    values: Vec<f64>,
    start: Isometry3<f64>,
}

impl References {
    /// A motion of `joints` joints that starts with the root at `start`; `values` holds one row of joints per 55 ms.
    pub(super) fn new(joints: usize, values: Vec<f64>, start: Isometry3<f64>) -> Self {
        References { joints, values, start }
    }

    /// Puts the robot where the motion begins: root pose and joint angles at the start.
    pub fn place(&self, robot: &mut Robot) {
        robot.start = self.start;
        let moving = robot.links.iter_mut().skip(1).filter(|link| link.joint.kind != crate::robot::JointKind::Fixed);
        for (link, &angle) in moving.zip(&self.values) {
            link.joint.start = angle;
        }
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
