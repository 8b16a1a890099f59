//! Drives: what the joints are told, over time.

mod hold;
pub mod nao;
mod plan;
mod policy;
mod replay;
mod sine;

pub use hold::Hold;
pub use nao::cart_table::com_for_zmp;
pub use nao::kick::NaoKick;
pub use nao::posture::{Posture, Stance};
pub use nao::reference::{CONTROL_S, References, STEPS_PER_CONTROL};
pub use nao::walk::NaoWalk;
pub use nao::zmp_motion::MotionError;
pub use plan::{DRIVES, DriveError, DriveKind, DrivePlan};
pub use policy::{PolicyPlan, SENSES};
pub use replay::Replay;
pub use sine::Sine;

use crate::engine::Dynamics;
use crate::robot::Robot;
use btr_core::signal::smooth::Motion;

/// A source of joint references.
pub trait Drive: Send + Sync {
    /// Writes the reference of every driven joint at `time_s` into `command`, in the order of the robot's
    /// [`movable`](crate::robot::Robot::movable) joints: rad for hinges, m for slides, N·m for torque actuators, V for voltage.
    /// NaN means "not driven" (torque off).
    fn command(&self, time_s: f64, command: &mut [f64]);

    /// The mean reference from `start_s` to `end_s`, for those that change at times of their own. It is what a robot was told
    /// in a step whose beginning is no tick of its controller.
    fn over(&self, start_s: f64, end_s: f64, command: &mut [f64]) {
        let _ = end_s;
        self.command(start_s, command);
    }

    /// Where a joint (counted as in `command`) whose motion is prescribed is at `time_s`, and how it moves; `None` where only
    /// references are known.
    fn motion(&self, joint: usize, time_s: f64) -> Option<Motion> {
        let _ = (joint, time_s);
        None
    }

    /// Puts the robot where the motion begins, for drives that begin somewhere of their own.
    fn place(&self, robot: &mut Robot) {
        let _ = robot;
    }

    /// Whether what the robot senses changes what it is told.
    fn senses(&self) -> bool {
        false
    }

    /// Corrects the references for `time_s` by what the robot senses now, one tick before; only asked where it
    /// [`senses`](Self::senses).
    fn react(&self, time_s: f64, engine: &dyn Dynamics, command: &mut [f64]) {
        let _ = (time_s, engine, command);
    }
}

impl<D: Drive + ?Sized> Drive for std::sync::Arc<D> {
    fn command(&self, time_s: f64, command: &mut [f64]) {
        (**self).command(time_s, command);
    }

    fn over(&self, start_s: f64, end_s: f64, command: &mut [f64]) {
        (**self).over(start_s, end_s, command);
    }

    fn motion(&self, joint: usize, time_s: f64) -> Option<Motion> {
        (**self).motion(joint, time_s)
    }

    fn place(&self, robot: &mut Robot) {
        (**self).place(robot);
    }

    fn senses(&self) -> bool {
        (**self).senses()
    }

    fn react(&self, time_s: f64, engine: &dyn Dynamics, command: &mut [f64]) {
        (**self).react(time_s, engine, command);
    }
}
