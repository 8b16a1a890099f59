//! State and working memory of the engine.

use super::contacts::{BallShape, ContactPoint, Hull};
use super::impulses::Impulses;
use super::joint_forces::{BoundedMotor, JointForces};
use super::linear_algebra::lanes::{Lanes, Mask};
use super::linear_algebra::spatial::Spatial;
use super::linear_algebra::vectors::V3;
use super::tree::{Configuration, Tree};
use crate::engine::PrescribedMotion;
use nalgebra::Isometry3;
use pulp::{Arch, Simd};

/// Robots of the same structure, each in a world of its own.
pub(crate) struct Articulated<S: Simd> {
    pub(super) simd: S,
    /// Instruction set of the step: the widest available, also for a single candidate.
    pub(super) arch: Arch,
    /// The selected candidate.
    pub(super) lane: usize,
    /// Joint positions and velocities of every candidate.
    pub(super) joint_states: Vec<JointStates>,
    pub(super) tree: Tree<S>,
    pub(super) now: Configuration<S>,
    /// Velocities one step ago.
    pub(super) before: Vec<Lanes<S>>,
    /// Degrees of freedom of the root, which come first: 6 or none.
    pub(super) root: usize,
    pub(super) fixed: Vec<Isometry3<f64>>,
    pub(super) inner: Vec<JointForces<S>>,
    pub(super) motors: Vec<Option<BoundedMotor<S>>>,
    /// Motion of prescribed joints; only with a single candidate.
    pub(super) prescribed: Vec<Option<PrescribedMotion>>,
    pub(super) limits: Vec<(Lanes<S>, Lanes<S>)>,
    pub(super) followers: Vec<Coupling<S>>,
    pub(super) names: Vec<String>,
    pub(super) gravity: V3<S>,
    pub(super) dt_s: f64,
    pub(super) substeps: usize,
    pub(super) floor: Option<Floor<S>>,
    pub(super) hulls: Vec<Hull<S>>,
    pub(super) ball: Option<BallShape<S>>,
    /// Rate at which the ball's spin decays, in 1/s.
    pub(super) rolling_damping: Lanes<S>,
    pub(super) impulses: Impulses<S>,
    pub(super) foot_impulses: Vec<Lanes<S>>,
    /// Candidates whose velocities diverged.
    pub(super) diverged: Mask<S>,
    pub(super) scratch: Scratch<S>,
}

/// Positions and velocities of a candidate's joints.
pub(super) struct JointStates {
    pub(super) q: Vec<f64>,
    pub(super) dq: Vec<f64>,
}

/// A joint that mimics another one: q = ratio·leader + offset.
pub(super) struct Coupling<S: Simd> {
    pub(super) joint: usize,
    pub(super) leader: usize,
    pub(super) ratio: Lanes<S>,
    pub(super) offset: Lanes<S>,
}

/// Contact properties of the floor and the ball.
pub(super) struct Floor<S: Simd> {
    /// None where there is only a ball.
    pub(super) friction: Option<Lanes<S>>,
    /// Of every contact point, in N/m and N·s/m.
    pub(super) stiffness: Lanes<S>,
    pub(super) damping: Lanes<S>,
}

/// Working memory of a step, allocated once.
pub(super) struct Scratch<S: Simd> {
    /// The middle of the step.
    pub(super) middle: Configuration<S>,
    /// Inertia matrix, then its factor; row-major.
    pub(super) matrix: Vec<Lanes<S>>,
    /// Bias force of every degree of freedom.
    pub(super) bias_forces: Vec<Lanes<S>>,
    /// Velocities at the step's end, and in the mean.
    pub(super) next: Vec<Lanes<S>>,
    pub(super) mean: Vec<Lanes<S>>,
    /// How implicit each joint is: 0.5 for the midpoint, 1 for backward Euler.
    pub(super) implicitness: Vec<Lanes<S>>,
    pub(super) contact_points: Vec<ContactPoint<S>>,
    /// Motion of every body without constraints, and its present motion.
    pub(super) motions: [Vec<Spatial<S>>; 2],
    /// Accelerations of the joints, for inverse dynamics.
    pub(super) known: Vec<Lanes<S>>,
}
