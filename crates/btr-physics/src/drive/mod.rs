//! Drives: joint references over time.
//!
//! References depend on the controller alone and are computed for the robot at its nominal values, whatever is
//! simulated: a controller must not know what is being identified.

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
pub use plan::{DRIVES, DriveError, DriveKind, DrivePlan, SearchStart};
pub use policy::{PolicyPlan, SENSES};
pub use replay::Replay;
pub use sine::Sine;

use crate::engine::Dynamics;
use crate::robot::Robot;
use btr_core::signal::smooth::Motion;

/// A source of joint references.
pub trait Drive: Send + Sync {
    /// Writes the reference of every driven joint at `time_s` into `command`, in the order of the robot's
    /// [`movable`](crate::robot::Robot::movable) joints: rad for hinges, m for slides, N·m for torque actuators, V for
    /// voltage. NaN means "not driven" (torque off).
    fn command(&self, time_s: f64, command: &mut [f64]);

    /// The mean reference from `start_s` to `end_s`, for drives whose references change at times other than controller
    /// ticks.
    fn over(&self, start_s: f64, end_s: f64, command: &mut [f64]) {
        let _ = end_s;
        self.command(start_s, command);
    }

    /// Writes the prescribed motions of some joints (counted as in `command`) at `time_s`, each in its joint's place;
    /// `None` where only references are known.
    fn motions(&self, time_s: f64, joints: &[usize], motions: &mut [Option<Motion>]) {
        let _ = time_s;
        joints.iter().for_each(|&joint| motions[joint] = None);
    }

    /// Over how long the readings of prescribed motions are means, in s; 0 where each is of one instant.
    fn mean_s(&self) -> f64 {
        0.0
    }

    /// Sets the robot's start state, for drives that define one.
    fn place(&self, robot: &mut Robot) {
        let _ = robot;
    }

    /// Whether sensor readings change the references.
    fn senses(&self) -> bool {
        false
    }

    /// Corrects the references for `time_s` by the present sensor readings, one tick earlier; only called if the drive
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

    fn motions(&self, time_s: f64, joints: &[usize], motions: &mut [Option<Motion>]) {
        (**self).motions(time_s, joints, motions);
    }

    fn mean_s(&self) -> f64 {
        (**self).mean_s()
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
