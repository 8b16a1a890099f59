//! A walk for the Nao: ZMP targets are converted to targets of the centre of mass, and these to joint angles.
//!
//! The paper's robot walks with its manufacturer's controller, which is based on that conversion (4.2.2); this is an
//! independent controller on the same principle. The ZMP rests under the supporting foot and moves to the next one
//! during double support. No sensor is used.

use super::reference::References;
use super::zmp_motion::{Carriage, MotionError, ZmpPlan, references, smooth};
use crate::drive::Drive;
use crate::robot::Robot;
use btr_core::space::{Dim, Space, SpaceError};
use nalgebra::Vector3;
use std::f64::consts::PI;

/// Time before the weight begins to shift, in s.
const STAND_S: f64 = 0.5;
/// Number of steps in which the step length grows to its full value, and in which it falls back to zero.
const RAMP_UP: usize = 4;
const RAMP_DOWN: usize = 2;
/// Time after the last step for the robot to come to rest, in s.
const STOP_S: f64 = 0.5;

/// A precomputed walk straight ahead, which begins and ends standing.
#[derive(Clone, Debug, PartialEq)]
pub struct NaoWalk {
    references: References,
}

impl NaoWalk {
    /// The walk's parameters: the controllers C of the Nao.
    ///
    /// # Errors
    /// None with the bounds given here.
    pub fn space() -> Result<Space, SpaceError> {
        Space::new(vec![
            // Distance by which each foot lands in front of the other.
            Dim::new("step_length", "m", 0.005, 0.08).nominal(0.04),
            // Time from one landing to the next.
            Dim::new("step_period", "s", 0.2, 1.0).nominal(0.45),
            // Fraction of the period in which both feet stand and the ZMP moves.
            Dim::new("double_support", "1", 0.05, 0.7).nominal(0.15),
            // ZMP's shift to each side; the feet's middles are at 0.06.
            Dim::new("sway", "m", 0.02, 0.08).nominal(0.055),
            Dim::new("step_height", "m", 0.005, 0.04).nominal(0.02),
            Dim::new("com_height", "m", 0.2, 0.27).nominal(0.24),
            // ZMP's distance in front of the middle of the supporting sole.
            Dim::new("zmp_forward", "m", -0.03, 0.03).nominal(0.0),
            // ZMP's offset to the left of the middle between the feet, which keeps a robot on course that is heavier on
            // one side.
            Dim::new("zmp_left", "m", -0.02, 0.02).nominal(0.0),
            // Pitch of the torso.
            Dim::new("lean", "rad", -0.2, 0.3).nominal(0.0),
            Dim::new("arm_swing", "rad", 0.0, 0.8).nominal(0.2),
            // Fraction of the servos' deflection under load for which the references compensate.
            Dim::new("stiffening", "1", 0.0, 1.5).nominal(1.0),
        ])
    }

    /// The walk of `robot` with `values` in the order of [`NaoWalk::space`], for `duration_s` seconds with the stands
    /// before and after it (then the pose is held). The masses and servos of `robot` are the controller's assumptions;
    /// the robot it drives may have others.
    ///
    /// # Errors
    /// Values outside their bounds, or a robot without a Nao's legs.
    pub fn new(robot: &Robot, values: &[f64], duration_s: f64) -> Result<Self, MotionError> {
        Ok(NaoWalk { references: references(robot, &WalkPlan::new(values, duration_s)?, duration_s)? })
    }

    /// The references, with the start pose of the walk.
    pub fn references(&self) -> &References {
        &self.references
    }
}

impl Drive for NaoWalk {
    fn command(&self, time_s: f64, command: &mut [f64]) {
        self.references.command(time_s, command);
    }

    fn place(&self, robot: &mut Robot) {
        self.references.place(robot);
    }
}

/// The walk's parameters, each explained in [`NaoWalk::space`], and its steps.
struct WalkPlan {
    step_length_m: f64,
    step_period_s: f64,
    double_support: f64,
    sway_m: f64,
    step_height_m: f64,
    zmp_forward_m: f64,
    zmp_left_m: f64,
    arm_swing_rad: f64,
    carriage: Carriage,
    /// Forward position of the foot that landed last, after each step; the first entry is the start.
    landings_m: Vec<f64>,
}

impl WalkPlan {
    fn new(values: &[f64], duration_s: f64) -> Result<Self, SpaceError> {
        let space = NaoWalk::space()?;
        space.check(values)?;
        let value = |name: &str| space.index_of(name).map_or(f64::NAN, |i| values[i]);
        let (step_length_m, step_period_s) = (value("step_length"), value("step_period"));
        // A NaN duration also gives no steps.
        let steps = ((duration_s - STAND_S - STOP_S) / step_period_s).max(0.0) as usize;
        Ok(WalkPlan {
            step_length_m,
            step_period_s,
            double_support: value("double_support"),
            sway_m: value("sway"),
            step_height_m: value("step_height"),
            zmp_forward_m: value("zmp_forward"),
            zmp_left_m: value("zmp_left"),
            arm_swing_rad: value("arm_swing"),
            carriage: Carriage {
                com_height_m: value("com_height"),
                lean_rad: value("lean"),
                stiffening: value("stiffening"),
            },
            landings_m: landings_m(steps, step_length_m),
        })
    }

    /// The current step at `time_s` (None while standing) and its completed fraction. One extra step after the last one
    /// brings the ZMP back to the middle.
    fn step(&self, time_s: f64) -> Option<(usize, f64)> {
        let steps = (time_s - STAND_S) / self.step_period_s;
        let number = (steps.max(0.0) as usize).min(self.steps());
        (steps >= 0.0).then(|| (number, (steps - number as f64).min(1.0)))
    }

    fn steps(&self) -> usize {
        self.landings_m.len() - 1
    }

    /// Forward position at which the swinging foot lands in step `step`; the feet at the start have negative numbers.
    fn landing_m(&self, step: isize) -> f64 {
        let landed = usize::try_from(step + 1).unwrap_or(0);
        self.landings_m[landed.min(self.steps())]
    }

    /// Rest position of the ZMP in step `step`. Even steps swing the left foot and stand on the right one; after the
    /// last step the ZMP rests between the feet.
    fn support(&self, step: usize) -> [f64; 2] {
        let side = match step {
            step if step == self.steps() => 0.0,
            step if step.is_multiple_of(2) => -1.0,
            _ => 1.0,
        };
        [self.landing_m(step as isize - 1) + self.zmp_forward_m, side * self.sway_m + self.zmp_left_m]
    }
}

/// Positions at which the feet land: steps grow to `step_length_m`, and shrink until the last one brings both feet side
/// by side.
fn landings_m(steps: usize, step_length_m: f64) -> Vec<f64> {
    let share = |landed: usize| {
        let up = landed as f64 / RAMP_UP as f64;
        let down = (steps - landed) as f64 / RAMP_DOWN as f64;
        up.min(down).min(1.0)
    };
    let mut landings_m = vec![0.0];
    landings_m.extend((1..=steps).scan(0.0, |at_m, landed| {
        *at_m += step_length_m * share(landed);
        Some(*at_m)
    }));
    landings_m
}

impl ZmpPlan for WalkPlan {
    fn carriage(&self) -> Carriage {
        self.carriage
    }

    fn zmp(&self, time_s: f64) -> [f64; 2] {
        let standing = [self.zmp_forward_m, self.zmp_left_m];
        let Some((step, share)) = self.step(time_s) else { return standing };
        let from = step.checked_sub(1).map_or(standing, |before| self.support(before));
        let to = self.support(step);
        let shifted = (share / self.double_support).min(1.0);
        [0, 1].map(|i| from[i] + shifted * (to[i] - from[i]))
    }

    fn feet(&self, time_s: f64) -> [Vector3<f64>; 2] {
        let Some((step, share)) = self.step(time_s) else { return [Vector3::zeros(); 2] };
        let number = step as isize;
        let in_air = ((share - self.double_support) / (1.0 - self.double_support)).max(0.0);
        let (from, to) = (self.landing_m(number - 2), self.landing_m(number));
        let lift = self.step_height_m * (PI * in_air).sin().powi(2);
        let swinging = Vector3::new(from + (to - from) * smooth(in_air), 0.0, lift);
        let standing = Vector3::new(self.landing_m(number - 1), 0.0, 0.0);
        if step.is_multiple_of(2) { [swinging, standing] } else { [standing, swinging] }
    }

    /// Arms swing opposite to the legs.
    fn arms(&self, time_s: f64) -> [f64; 2] {
        let [left, right] = self.feet(time_s);
        let back = self.arm_swing_rad * (left.x - right.x) / self.step_length_m;
        [back, -back]
    }
}
