//! Joint references from a plan for ZMP and feet.

use super::cart_table::com_for_zmp;
use super::leg::LegError;
use super::posture::{Posture, Stance};
use super::reference::{CONTROL_S, References, STEPS_PER_CONTROL};
use crate::robot::Robot;
use btr_core::space::SpaceError;
use nalgebra::Vector3;
use std::f64::consts::FRAC_PI_2;

/// Time by which the ZMP's plan extends beyond the end, in s; later values have no influence.
const FORESIGHT_S: f64 = 1.5;
/// Time between two samples of the ZMP's plan, in s.
const PLAN_S: f64 = CONTROL_S / STEPS_PER_CONTROL as f64;

/// Why a motion cannot be planned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MotionError {
    /// The robot's legs are not supported.
    #[error(transparent)]
    Leg(#[from] LegError),
    /// Parameters outside their bounds.
    #[error(transparent)]
    Space(#[from] SpaceError),
}

/// Posture of the body, independent of the feet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Carriage {
    /// Height of the centre of mass over the ground, in m.
    pub(super) com_height_m: f64,
    /// Pitch of the torso, in rad.
    pub(super) lean_rad: f64,
    /// Fraction of the servos' deflection under load for which the references compensate, 1 for all.
    pub(super) stiffening: f64,
}

/// Targets of ZMP and feet over time. Positions are relative to the middle between the soles at the start, or, for
/// feet, to the start position of each foot.
pub(super) trait ZmpPlan {
    /// Posture of the body.
    fn carriage(&self) -> Carriage;
    /// Forward and left coordinate of the ZMP, in m.
    fn zmp(&self, time_s: f64) -> [f64; 2];
    /// Displacement of the left and the right sole from their start positions, in m.
    fn feet(&self, time_s: f64) -> [Vector3<f64>; 2];
    /// Pitch of the left and the right arm relative to hanging down, backward positive, in rad.
    fn arms(&self, _time_s: f64) -> [f64; 2] {
        [0.0, 0.0]
    }
}

/// The references that execute `plan` for `duration_s` seconds.
pub(super) fn references(robot: &Robot, plan: &impl ZmpPlan, duration_s: f64) -> Result<References, LegError> {
    // A NaN duration also becomes zero.
    let duration_s = duration_s.max(0.0);
    let mut posture = Posture::new(robot)?;
    let carriage = plan.carriage();
    let origins = posture.soles_at_start();
    let middle = nalgebra::center(&origins[0], &origins[1]);
    let com = com(plan, carriage.com_height_m, duration_s);
    let mut q = vec![0.0; robot.movable().count()];
    let mut motion = References::new(q.len());
    for row in 0..=(duration_s / CONTROL_S).ceil() as usize {
        let time_s = row as f64 * CONTROL_S;
        let feet = plan.feet(time_s);
        let [x, y] = com[row * STEPS_PER_CONTROL];
        let stance = Stance {
            com_m: middle + Vector3::new(x, y, carriage.com_height_m),
            soles_m: [origins[0] + feet[0], origins[1] + feet[1]],
            lean_rad: carriage.lean_rad,
        };
        hang_arms(robot, plan.arms(time_s), &mut q);
        let reached = posture.solve(&stance, &mut q);
        if row == 0 {
            motion.begin(*posture.root(), &q);
        }
        let [x, y] = plan.zmp(time_s);
        motion.push(&q, reached);
        posture.stiffen(&stance, &(middle + Vector3::new(x, y, 0.0)), carriage.stiffening, motion.last_mut());
    }
    motion.clip(robot);
    Ok(motion)
}

/// Forward and left coordinate of the centre of mass, every [`PLAN_S`].
fn com(plan: &impl ZmpPlan, height_m: f64, duration_s: f64) -> Vec<[f64; 2]> {
    let samples = ((duration_s + CONTROL_S + FORESIGHT_S) / PLAN_S).ceil() as usize;
    let zmp: Vec<[f64; 2]> = (0..samples).map(|i| plan.zmp(i as f64 * PLAN_S)).collect();
    let [x, y] = [0, 1].map(|i| {
        let coordinate: Vec<f64> = zmp.iter().map(|p| p[i]).collect();
        com_for_zmp(&coordinate, height_m, PLAN_S)
    });
    x.into_iter().zip(y).map(|(x, y)| [x, y]).collect()
}

/// Sets straight arms that hang down, rotated backward by `arms` (left, right) in rad.
fn hang_arms(robot: &Robot, arms: [f64; 2], q: &mut [f64]) {
    for (q, (_, link)) in q.iter_mut().zip(robot.movable()) {
        match link.name.as_str() {
            "LShoulderPitch" => *q = FRAC_PI_2 + arms[0],
            "RShoulderPitch" => *q = FRAC_PI_2 + arms[1],
            _ => {}
        }
    }
}

/// From 0 to 1 while `u` goes from 0 to 1, with no velocity and no acceleration at the ends (minimum jerk); constant
/// outside.
pub(super) fn smooth(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
}
