//! The interface between the simulation loop and a physics engine.

pub(crate) mod articulated;
pub(crate) mod assemble;
#[cfg(feature = "rapier")]
pub mod rapier;

pub use articulated::forward_dynamics;
pub use assemble::{carried_inertia, turned_inertia};

use crate::robot::Joint;
use btr_core::signal::smooth::Motion;
use nalgebra::{Isometry3, Point3, Vector3};

/// A joint torque that is affine in the joint's state: tau = constant − stiffness·q − damping·dq.
///
/// Engines integrate it implicitly, so that stiff servos stay stable. A sum of such torques is again one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Affine {
    /// N·m (N for slides).
    pub constant: f64,
    /// N·m/rad (N/m).
    pub stiffness: f64,
    /// N·m·s/rad (N·s/m).
    pub damping: f64,
}

impl Affine {
    /// A constant torque, in N·m (N).
    pub fn constant(torque: f64) -> Self {
        Affine { constant: torque, ..Affine::default() }
    }

    /// The torque in the state (q, dq).
    pub fn at(&self, q: f64, dq: f64) -> f64 {
        self.constant - self.stiffness * q - self.damping * dq
    }

    /// Position and velocity after an implicit step of `dt_s` on a joint that moves `inertia` (kg·m²) without other
    /// forces: the engine's result, if the other joints did not matter.
    pub fn step(&self, q: f64, dq: f64, dt_s: f64, inertia: f64) -> (f64, f64) {
        let push = dt_s * (self.constant - self.stiffness * q);
        let dq = (inertia * dq + push) / (inertia + dt_s * self.damping + dt_s * dt_s * self.stiffness);
        (q + dt_s * dq, dq)
    }

    /// Adds another such torque.
    pub fn add(&mut self, other: &Affine) {
        self.constant += other.constant;
        self.stiffness += other.stiffness;
        self.damping += other.damping;
    }
}

/// A motor's torque over one step: the requested torque, at most `upper` and at least `lower`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounded {
    /// The requested torque.
    pub requested: Affine,
    /// The largest torque; it may depend on the velocity.
    pub upper: Affine,
    /// The lowest torque; it may depend on the velocity.
    pub lower: Affine,
}

/// How a joint gives way where dry friction holds it: dq + time·d(dq)/dt = -rate·torque, with friction's torque.
/// Constant during a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Creep {
    /// Velocity per torque held, in rad/(s·N·m) (m/(s·N)); 0 where the joint is held rigidly.
    pub rate: f64,
    /// Time constant in which that velocity is reached, in s.
    pub time_s: f64,
}

impl Creep {
    /// Friction's torque at a velocity and an acceleration, where it is at most `limit`.
    pub fn torque(&self, dq: f64, acceleration: f64, limit: f64) -> f64 {
        let driven = dq + self.time_s * acceleration;
        let rigid = if driven == 0.0 { 0.0 } else { f64::INFINITY.copysign(driven) };
        let held = if self.rate > 0.0 { driven / self.rate } else { rigid };
        -held.min(limit).max(-limit)
    }
}

/// The mean of a velocity's sign over a time around an instant, at an acceleration: dry friction in a reading that is
/// itself a mean.
pub(crate) fn mean_sign(dq: f64, acceleration: f64, over_s: f64) -> f64 {
    let reach = 0.5 * over_s * acceleration.abs();
    if dq == 0.0 { 0.0 } else { (dq / reach).clamp(-1.0, 1.0) }
}

/// Joint-level forces on one joint during one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dof {
    /// Springs, viscous friction, and a motor that is not in `motor`.
    pub torque: Affine,
    /// A motor with bounds, for engines that [enforce](Dynamics::enforces_bounds) them.
    pub motor: Option<Bounded>,
    /// Coulomb friction that holds at rest, in N·m (N).
    pub dry_friction: f64,
    /// How dry friction gives way to the torque that it holds.
    pub creep: Creep,
    /// Rotor inertia seen at the joint, in kg·m² (kg).
    pub armature: f64,
    /// The joint's motion over the coming step, if it is prescribed.
    pub prescribed: Option<PrescribedMotion>,
}

impl Dof {
    /// What acts in a joint by itself, without a motor.
    pub(crate) fn passive(joint: &Joint) -> Self {
        let torque = Affine { damping: joint.damping, ..Affine::default() };
        let (dry_friction, armature) = (joint.dry_friction, joint.armature);
        Dof { torque, dry_friction, armature, ..Dof::default() }
    }

    /// The torque that a prescribed motion requires at the beginning of a step, where the links alone require `links`.
    pub(crate) fn required(&self, motion: &PrescribedMotion, links: f64) -> f64 {
        let Motion { value: q, velocity: dq, acceleration } = motion.from;
        // A rigid hold can be anything up to friction's torque: zero is the smallest.
        let friction = match self.creep.rate > 0.0 {
            true => self.creep.torque(dq, acceleration, self.dry_friction),
            false => -self.dry_friction * mean_sign(dq, acceleration, motion.mean_s),
        };
        links + self.armature * acceleration - friction - self.torque.at(q, dq)
    }
}

/// A prescribed motion over one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrescribedMotion {
    /// At the beginning of the step.
    pub from: Motion,
    /// At its end.
    pub to: Motion,
    /// Over how long the readings are means, in s; 0 where each is of one instant.
    pub mean_s: f64,
}

/// Pose and velocity of the root's frame, in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseState {
    /// Pose of the root link's frame.
    pub pose: Isometry3<f64>,
    /// Velocity of that frame's origin in m/s.
    pub velocity_m_s: Vector3<f64>,
    /// Angular velocity in rad/s.
    pub angular_rad_s: Vector3<f64>,
}

/// The state of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotState {
    /// Joint positions in rad (m) and velocities in rad/s (m/s), in the order of
    /// [`movable`](crate::robot::Robot::movable).
    pub joints: Vec<(f64, f64)>,
    /// The root; meaningless if the base is fixed.
    pub base: BaseState,
}

impl RobotState {
    /// The state of an engine's selected candidate.
    pub fn of(engine: &dyn Dynamics) -> Self {
        let joints = engine.positions().iter().copied().zip(engine.velocities().iter().copied());
        RobotState { joints: joints.collect(), base: engine.base() }
    }
}

/// A robot in its world, advanced step by step; or a batch of candidates for it, each in a world of its own. Joints are
/// counted in the order of [`movable`](crate::robot::Robot::movable), feet in the order of the links marked as such.
pub trait Dynamics {
    /// Number of candidates.
    fn lanes(&self) -> usize {
        1
    }
    /// Selects the candidate that all methods but [`step`](Self::step) refer to; initially the first one.
    fn select_lane(&mut self, lane: usize) {
        let _ = lane;
    }
    /// Joint positions in rad (m).
    fn positions(&self) -> &[f64];
    /// Joint velocities in rad/s (m/s).
    fn velocities(&self) -> &[f64];
    /// Sets the state: the joints' positions and velocities, and a floating root.
    fn place(&mut self, state: &RobotState);
    /// Sets the forces on a joint from now on.
    fn set_joint(&mut self, joint: usize, dof: &Dof);
    /// Whether steps are solved for their middle, which is second order, instead of their end.
    fn midpoint(&self) -> bool {
        false
    }
    /// Whether it enforces motor bounds within the step; if not, it is never given any.
    fn enforces_bounds(&self) -> bool {
        false
    }
    /// Whether it supports joints with a [`PrescribedMotion`]; if not, it is never given any.
    fn supports_prescribed(&self) -> bool {
        false
    }
    /// Writes the torque that every prescribed joint requires at the beginning of the coming step; leaves the others
    /// unchanged.
    fn prescribed_torques(&mut self, torques: &mut [f64]) {
        let _ = torques;
    }
    /// Advances all candidates by the setup's `dt_s`.
    fn step(&mut self);
    /// State of the root.
    fn base(&self) -> BaseState;
    /// Sum of the normal forces on a foot during the last step, in N.
    fn foot_force_n(&self, foot: usize) -> f64;
    /// Centre of the ball, if there is one.
    fn ball(&self) -> Option<Point3<f64>>;
    /// Why the state is invalid (not finite, or faster than any plausible motion), if it is.
    fn trouble(&self) -> Option<String>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_sign_is_the_mean_of_signs() {
        for (dq, acceleration) in [(0.3, 2.0), (-0.004, 2.0), (0.004, -2.0), (0.002, 0.0), (0.0, 3.0), (-1.0, 0.0)] {
            let over_s = 0.01;
            let at = |i: i32| dq + acceleration * over_s * (f64::from(i) + 0.5) / 2000.0;
            let mean = (-1000..1000).map(|i| if at(i) == 0.0 { 0.0 } else { at(i).signum() }).sum::<f64>() / 2000.0;
            assert!((mean_sign(dq, acceleration, over_s) - mean).abs() < 2e-3, "{dq} {acceleration}: {mean}");
            assert!((mean_sign(dq, acceleration, 0.0) - if dq == 0.0 { 0.0 } else { dq.signum() }).abs() < 1e-12);
        }
    }
}
