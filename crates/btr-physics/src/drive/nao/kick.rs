//! A kick for the Nao: the weight shifts over the left foot, the right foot swings back, forward, and returns.

use super::reference::References;
use super::zmp_motion::{Carriage, MotionError, ZmpPlan, references, smooth};
use crate::drive::Drive;
use crate::robot::Robot;
use btr_core::space::{Dim, Space, SpaceError};
use nalgebra::Vector3;

/// Time before the weight begins to shift, in s.
const STAND_S: f64 = 0.3;
/// Time for the weight to shift over the supporting foot, and back at the end, in s.
const SHIFT_S: f64 = 0.6;
/// Time for the foot to move up and back, in s.
const LIFT_S: f64 = 0.5;
/// Time for the foot to return, in s.
const HOME_S: f64 = 0.6;

/// A precomputed kick with the right foot, which begins and ends standing.
#[derive(Clone, Debug, PartialEq)]
pub struct NaoKick {
    references: References,
}

impl NaoKick {
    /// The kick's parameters.
    ///
    /// # Errors
    /// None with the bounds given here.
    pub fn space() -> Result<Space, SpaceError> {
        Space::new(vec![
            // Distance by which the foot moves back before the swing.
            Dim::new("backswing", "m", 0.0, 0.08).nominal(0.04),
            // Distance in front of its standing position at which the swing ends.
            Dim::new("follow_through", "m", 0.0, 0.1).nominal(0.06),
            // Duration of the swing from back to front.
            Dim::new("swing_time", "s", 0.08, 0.6).nominal(0.2),
            Dim::new("lift", "m", 0.005, 0.05).nominal(0.02),
            // ZMP's shift to the left; the foot's middle is at 0.06.
            Dim::new("sway", "m", 0.02, 0.08).nominal(0.055),
            Dim::new("com_height", "m", 0.2, 0.27).nominal(0.24),
            // ZMP's distance in front of the middle of the soles.
            Dim::new("zmp_forward", "m", -0.03, 0.03).nominal(0.0),
            // Pitch of the torso.
            Dim::new("lean", "rad", -0.2, 0.3).nominal(0.0),
            // Fraction of the servos' deflection under load for which the references compensate.
            Dim::new("stiffening", "1", 0.0, 1.5).nominal(1.0),
        ])
    }

    /// The kick of `robot` with `values` in the order of [`NaoKick::space`]; it ends in its start pose. The masses and
    /// servos of `robot` are the controller's assumptions; the robot it drives may have others.
    ///
    /// # Errors
    /// Values outside their bounds, or a robot without a Nao's legs.
    pub fn new(robot: &Robot, values: &[f64]) -> Result<Self, MotionError> {
        let plan = KickPlan::new(values)?;
        Ok(NaoKick { references: references(robot, &plan, plan.phase_ends_s()[4] + SHIFT_S)? })
    }

    /// The references, with the start pose of the kick.
    pub fn references(&self) -> &References {
        &self.references
    }
}

impl Drive for NaoKick {
    fn command(&self, time_s: f64, command: &mut [f64]) {
        self.references.command(time_s, command);
    }

    fn place(&self, robot: &mut Robot) {
        self.references.place(robot);
    }
}

/// The kick's parameters; each is explained in [`NaoKick::space`].
struct KickPlan {
    backswing_m: f64,
    follow_through_m: f64,
    swing_time_s: f64,
    lift_m: f64,
    sway_m: f64,
    zmp_forward_m: f64,
    carriage: Carriage,
}

impl KickPlan {
    fn new(values: &[f64]) -> Result<Self, SpaceError> {
        let space = NaoKick::space()?;
        space.check(values)?;
        let value = |name: &str| space.index_of(name).map_or(f64::NAN, |i| values[i]);
        Ok(KickPlan {
            backswing_m: value("backswing"),
            follow_through_m: value("follow_through"),
            swing_time_s: value("swing_time"),
            lift_m: value("lift"),
            sway_m: value("sway"),
            zmp_forward_m: value("zmp_forward"),
            carriage: Carriage {
                com_height_m: value("com_height"),
                lean_rad: value("lean"),
                stiffening: value("stiffening"),
            },
        })
    }

    /// End times of the phases: weight over the left foot, right foot up and back, in front, returned, weight centred.
    fn phase_ends_s(&self) -> [f64; 5] {
        let shifted = STAND_S + SHIFT_S;
        let back = shifted + LIFT_S;
        let front = back + self.swing_time_s;
        let home = front + HOME_S;
        [shifted, back, front, home, home + SHIFT_S]
    }
}

impl ZmpPlan for KickPlan {
    fn carriage(&self) -> Carriage {
        self.carriage
    }

    fn zmp(&self, time_s: f64) -> [f64; 2] {
        let [shifted, _, _, home, _] = self.phase_ends_s();
        let shifted_share = smooth((time_s - shifted + SHIFT_S) / SHIFT_S);
        let back = smooth((time_s - home) / SHIFT_S);
        [self.zmp_forward_m, self.sway_m * (shifted_share - back)]
    }

    fn feet(&self, time_s: f64) -> [Vector3<f64>; 2] {
        let [shifted, back, front, home, _] = self.phase_ends_s();
        let lifted = smooth((time_s - shifted) / (back - shifted));
        let swung = smooth((time_s - back) / (front - back));
        let returned = smooth((time_s - front) / (home - front));
        let reach = self.backswing_m + self.follow_through_m;
        let forward = -self.backswing_m * lifted + reach * swung - self.follow_through_m * returned;
        [Vector3::zeros(), Vector3::new(forward, 0.0, self.lift_m * (lifted - returned))]
    }
}
