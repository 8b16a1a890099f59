//! A walk for the Nao: ZMP targets become targets of the centre of mass, and these become joint angles.
//!
//! The paper's robot walks with its maker's controller, whose main idea is that transformation (4.2.2); this is an own
//! controller on the same idea. The ZMP rests under the supporting foot and wanders to the next one while both feet
//! stand; [`com_for_zmp`] gives the centre of mass, [`Posture`] the legs. No sensor is used.

use super::Drive;
use super::cart_table::com_for_zmp;
use super::posture::{Posture, Stance};
use super::reference::References;
use crate::kinematics::LegError;
use crate::nao::{CONTROL_S, STEPS_PER_CONTROL};
use crate::robot::Robot;
use btr_core::space::{Dim, Space, SpaceError};
use nalgebra::{Point3, Vector3};
use std::f64::consts::FRAC_PI_2;

/// The robot stands this long before its weight begins to shift, in s.
const STAND_S: f64 = 0.5;
/// The ZMP is planned this far beyond the end, in s; what comes later no longer matters.
const FORESIGHT_S: f64 = 1.5;
/// Steps in which the step length grows to its full value.
const RAMP_STEPS: usize = 4;
/// Time between two samples of the ZMP's plan, in s.
const PLAN_S: f64 = CONTROL_S / STEPS_PER_CONTROL as f64;

/// Why there is no walk.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WalkError {
    /// The robot has other legs.
    #[error(transparent)]
    Leg(#[from] LegError),
    /// Parameters outside [`space`].
    #[error(transparent)]
    Space(#[from] SpaceError),
}

/// The walk's parameters: the controllers C of the Nao.
///
/// # Errors
/// None with the bounds given here.
pub fn space() -> Result<Space, SpaceError> {
    Space::new(vec![
        Dim::new("step_length", "m", 0.005, 0.08).nominal(0.04),
        Dim::new("step_period", "s", 0.3, 1.0).nominal(0.5),
        Dim::new("double_support", "1", 0.1, 0.7).nominal(0.3),
        Dim::new("sway", "m", 0.02, 0.08).nominal(0.06),
        Dim::new("step_height", "m", 0.005, 0.04).nominal(0.02),
        Dim::new("com_height", "m", 0.2, 0.27).nominal(0.25),
        Dim::new("zmp_forward", "m", -0.03, 0.03).nominal(0.0),
        Dim::new("lean", "rad", -0.2, 0.3).nominal(0.0),
        Dim::new("arm_swing", "rad", 0.0, 0.8).nominal(0.2),
        Dim::new("stiffening", "1", 0.0, 1.5).nominal(1.0),
    ])
}

/// A walk straight ahead, from a stand, worked out beforehand.
#[derive(Clone, Debug, PartialEq)]
pub struct NaoWalk {
    references: References,
    reached: bool,
}

impl NaoWalk {
    /// The walk of `robot` with `values` in the order of [`space`], for `duration_s` seconds (then the pose is held).
    /// The masses of `robot` are what the controller believes; the robot it drives may have others.
    ///
    /// # Errors
    /// Values outside their bounds, or a robot without a Nao's legs.
    pub fn new(robot: &Robot, values: &[f64], duration_s: f64) -> Result<Self, WalkError> {
        let plan = Plan::new(values, duration_s)?;
        let mut posture = Posture::new(robot)?;
        let soles = posture.soles_at_start();
        let com = plan.com();
        let mut q = vec![0.0; robot.movable().count()];
        let mut reference = q.clone();
        let mut rows = Vec::new();
        let mut start = None;
        let mut reached = true;
        for row in 0..=(duration_s / CONTROL_S).ceil() as usize {
            let [left, right] = plan.feet(row as f64 * CONTROL_S);
            plan.swing_arms(robot, left.x - right.x, &mut q);
            let [x, y] = com[row * STEPS_PER_CONTROL];
            let middle = Point3::from((soles[0].coords + soles[1].coords) / 2.0);
            let stance = Stance {
                com_m: middle + Vector3::new(x, y, plan.com_height_m),
                soles_m: [soles[0] + left, soles[1] + right],
                lean_rad: plan.lean_rad,
            };
            reached &= posture.solve(&stance, &mut q);
            start.get_or_insert(*posture.root());
            let [zmp_x, zmp_y] = plan.zmp(row as f64 * CONTROL_S);
            reference.copy_from_slice(&q);
            posture.stiffen(&stance, &(middle + Vector3::new(zmp_x, zmp_y, 0.0)), plan.stiffening, &mut reference);
            rows.extend_from_slice(&reference);
        }
        let references = References::new(q.len(), rows, start.unwrap_or(robot.start));
        Ok(NaoWalk { references, reached })
    }

    /// The references, which also know the pose in which the walk begins.
    pub fn references(&self) -> &References {
        &self.references
    }

    /// False when some reference is out of the legs' reach and they only came close.
    pub fn reached(&self) -> bool {
        self.reached
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

/// Where ZMP, feet and arms are to be at every time. Lengths in m from the middle between the soles at the start.
struct Plan {
    duration_s: f64,
    step_length_m: f64,
    step_period_s: f64,
    double_support: f64,
    sway_m: f64,
    step_height_m: f64,
    com_height_m: f64,
    zmp_forward_m: f64,
    lean_rad: f64,
    arm_swing_rad: f64,
    stiffening: f64,
}

impl Plan {
    fn new(values: &[f64], duration_s: f64) -> Result<Self, SpaceError> {
        let space = space()?;
        space.check(values)?;
        let value = |name: &str| space.index_of(name).map_or(f64::NAN, |i| values[i]);
        Ok(Plan {
            duration_s,
            step_length_m: value("step_length"),
            step_period_s: value("step_period"),
            double_support: value("double_support"),
            sway_m: value("sway"),
            step_height_m: value("step_height"),
            com_height_m: value("com_height"),
            zmp_forward_m: value("zmp_forward"),
            lean_rad: value("lean"),
            arm_swing_rad: value("arm_swing"),
            stiffening: value("stiffening"),
        })
    }

    /// The step that goes on at `time_s` (None while standing) and which share of it is over.
    fn step(&self, time_s: f64) -> Option<(usize, f64)> {
        let steps = (time_s - STAND_S) / self.step_period_s;
        (steps >= 0.0).then(|| (steps as usize, steps.fract()))
    }

    /// How far forward the foot that swings in step `step` lands; feet at the start have negative numbers.
    fn landing_m(&self, step: isize) -> f64 {
        let done = usize::try_from(step + 1).unwrap_or(0);
        let in_ramp = done.min(RAMP_STEPS) as f64;
        let ramp = RAMP_STEPS as f64;
        let ramped = in_ramp * (in_ramp + 1.0) / (2.0 * ramp);
        self.step_length_m * (ramped + done.saturating_sub(RAMP_STEPS) as f64)
    }

    /// Forward and to the left. Even steps swing the left foot and stand on the right one.
    fn support(&self, step: usize) -> [f64; 2] {
        let side = if step.is_multiple_of(2) { -1.0 } else { 1.0 };
        [self.landing_m(step as isize - 1) + self.zmp_forward_m, side * self.sway_m]
    }

    fn zmp(&self, time_s: f64) -> [f64; 2] {
        let standing = [self.zmp_forward_m, 0.0];
        let Some((step, share)) = self.step(time_s) else { return standing };
        let from = step.checked_sub(1).map_or(standing, |before| self.support(before));
        let to = self.support(step);
        let shifted = (share / self.double_support).min(1.0);
        [0, 1].map(|i| from[i] + shifted * (to[i] - from[i]))
    }

    /// Forward and left coordinate of the centre of mass, every [`PLAN_S`].
    fn com(&self) -> Vec<[f64; 2]> {
        let samples = ((self.duration_s + FORESIGHT_S) / PLAN_S).ceil() as usize;
        let zmp: Vec<[f64; 2]> = (0..samples).map(|i| self.zmp(i as f64 * PLAN_S)).collect();
        let [x, y] = [0, 1].map(|i| {
            let coordinate: Vec<f64> = zmp.iter().map(|p| p[i]).collect();
            com_for_zmp(&coordinate, self.com_height_m, PLAN_S)
        });
        x.into_iter().zip(y).map(|(x, y)| [x, y]).collect()
    }

    /// How far the soles, left and right, are from where they stood.
    fn feet(&self, time_s: f64) -> [Vector3<f64>; 2] {
        let Some((step, share)) = self.step(time_s) else { return [Vector3::zeros(); 2] };
        let number = step as isize;
        let in_air = ((share - self.double_support) / (1.0 - self.double_support)).max(0.0);
        let (from, to) = (self.landing_m(number - 2), self.landing_m(number));
        let swinging = Vector3::new(from + (to - from) * smooth(in_air), 0.0, self.step_height_m * bump(in_air));
        let standing = Vector3::new(self.landing_m(number - 1), 0.0, 0.0);
        if step.is_multiple_of(2) { [swinging, standing] } else { [standing, swinging] }
    }

    /// Arms hang and swing against the legs.
    fn swing_arms(&self, robot: &Robot, left_ahead_m: f64, q: &mut [f64]) {
        let swing = self.arm_swing_rad * left_ahead_m / self.step_length_m;
        for (i, (_, link)) in robot.movable().enumerate() {
            match link.joint.name.as_str() {
                "LShoulderPitch" => q[i] = FRAC_PI_2 + swing,
                "RShoulderPitch" => q[i] = FRAC_PI_2 - swing,
                _ => {}
            }
        }
    }
}

/// From 0 to 1 with no velocity and no acceleration at the ends (minimum jerk).
fn smooth(u: f64) -> f64 {
    u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
}

/// From 0 over 1 back to 0, softly at both ends.
fn bump(u: f64) -> f64 {
    (std::f64::consts::PI * u).sin().powi(2)
}
