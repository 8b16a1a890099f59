//! Robots in minimal coordinates, on the ground, in the air or bolted down: one, or several candidates for the same
//! robot side by side, each in a lane of the vector registers.
//!
//! Joint-space dynamics from the composite-rigid-body and the recursive Newton-Euler algorithm, factorised along the tree
//! (R. Featherstone, "Rigid Body Dynamics Algorithms", Springer 2008, chapters 5, 6 and 8), with all spatial quantities in the
//! world's axes about one point, so that composite inertias are plain sums.
//!
//! A step is the implicit midpoint rule for servos, springs and dampers, with inertia, gravity and velocity forces taken at
//! the middle that the past predicts: second order. Joints so stiff that the rule would let them ring are advanced by
//! backward Euler instead. Motors at their bounds are found step by step. Dry friction, joint limits and contacts are impulses
//! within bounds. A contact is a spring and a
//! damper that are solved for the step's end, and Coulomb friction that holds; a hard floor is a stiff one.
#![allow(
    clippy::needless_range_loop,
    reason = "what an iterator calls may be left out of line, where it is compiled for narrow registers"
)]

mod build;
mod constraints;
mod contacts;
mod forward;
mod impulses;
mod lanes;
mod prescribed;
mod spatial;
mod torque_bounds;
mod tree;
mod vectors;
mod world;

pub(crate) use build::{engine, engine_of_several, lanes, width, widths};
pub use forward::forward_dynamics;

use super::{BaseState, Dof, Dynamics, PrescribedMotion, RobotState};
use contacts::{BallShape, ContactPoint, Hull};
use impulses::Impulses;
use lanes::{Lanes, Mask};
use nalgebra::{Isometry3, Point3, Vector3};
use pulp::{Arch, NullaryFnOnce, Simd};
use spatial::{Spatial, factorise, solve};
use std::ops::Range;
use torque_bounds::BoundedMotor;
use tree::{Configuration, Tree};
use vectors::V3;

/// Faster than this (m/s, rad/s) is a blow-up.
const ABSURD_SPEED: f64 = 1e4;
/// Robots of one kind, each in a world of its own.
pub(crate) struct Articulated<S: Simd> {
    simd: S,
    /// What it is compiled for: as wide registers as there are, also for a single candidate.
    arch: Arch,
    /// The candidate that is spoken of.
    lane: usize,
    /// What every candidate's joints do.
    seen: Vec<JointStates>,
    tree: Tree<S>,
    now: Configuration<S>,
    /// Velocities one step ago.
    before: Vec<Lanes<S>>,
    /// Degrees of freedom of the root, which come first: 6 or none.
    root: usize,
    fixed: Vec<Isometry3<f64>>,
    inner: Vec<JointForces<S>>,
    motors: Vec<Option<BoundedMotor<S>>>,
    /// Joints whose motion is prescribed; only where there is a single candidate.
    courses: Vec<Option<PrescribedMotion>>,
    limits: Vec<(Lanes<S>, Lanes<S>)>,
    followers: Vec<Coupling<S>>,
    names: Vec<String>,
    gravity: V3<S>,
    dt_s: f64,
    substeps: usize,
    floor: Option<Floor<S>>,
    hulls: Vec<Hull<S>>,
    ball: Option<BallShape<S>>,
    /// Rate at which the ball's spin decays, in 1/s.
    rolling_damping: Lanes<S>,
    impulses: Impulses<S>,
    foot_impulses: Vec<Lanes<S>>,
    /// Whose velocities are absurd.
    wild: Mask<S>,
    scratch: Scratch<S>,
}

/// Positions and velocities of a candidate's joints.
struct JointStates {
    q: Vec<f64>,
    dq: Vec<f64>,
}

/// Everything that acts on a joint from the inside: [`Dof`] of every candidate.
#[derive(Clone, Copy)]
struct JointForces<S: Simd> {
    constant: Lanes<S>,
    stiffness: Lanes<S>,
    damping: Lanes<S>,
    dry_friction: Lanes<S>,
    armature: Lanes<S>,
}

/// A joint that follows another one.
struct Coupling<S: Simd> {
    joint: usize,
    leader: usize,
    ratio: Lanes<S>,
    offset: Lanes<S>,
}

/// What the floor and the ball do to whatever touches them.
struct Floor<S: Simd> {
    /// None where there is only a ball.
    friction: Option<Lanes<S>>,
    /// Of every point of contact, in N/m and N·s/m.
    stiffness: Lanes<S>,
    damping: Lanes<S>,
}

/// Memory for a step, allocated once.
struct Scratch<S: Simd> {
    /// The middle of the step.
    middle: Configuration<S>,
    /// Row by row: first the inertia matrix, then its factor.
    matrix: Vec<Lanes<S>>,
    /// What every degree of freedom has to carry.
    carried: Vec<Lanes<S>>,
    /// What all do at the step's end, and in the mean.
    next: Vec<Lanes<S>>,
    mean: Vec<Lanes<S>>,
    /// How implicit each joint is: 0.5 for the midpoint, 1 for backward Euler.
    share: Vec<Lanes<S>>,
    touches: Vec<ContactPoint<S>>,
    /// How every body would move if nothing touched, and how it moves.
    motions: [Vec<Spatial<S>>; 2],
    /// Accelerations of the joints where they are known.
    known: Vec<Lanes<S>>,
}

/// The steps of the engine, compiled for the registers that there are.
struct Steps<'a, S: Simd>(&'a mut Articulated<S>);

impl<S: Simd> NullaryFnOnce for Steps<'_, S> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        let engine = self.0;
        let zero = Lanes::zero(engine.simd);
        engine.foot_impulses.fill(zero);
        for _ in 0..engine.substeps {
            engine.advance();
            engine.feel();
        }
        engine.look();
    }
}

impl<S: Simd> Articulated<S> {
    /// Where everything will be in the middle of the step if it goes on as it did.
    #[inline(always)]
    fn predict(&mut self) {
        let (now, s) = (&self.now, &mut self.scratch);
        now.fly(&self.tree, 0.5 * self.dt_s, &now.u, &mut s.middle);
        for ((middle, now), before) in s.middle.u.iter_mut().zip(&now.u).zip(&self.before) {
            *middle = *now * 1.5 - *before * 0.5;
        }
    }

    /// One step of `dt_s`: implicit in everything that acts inside the joints and at contacts.
    #[inline(always)]
    fn advance(&mut self) {
        self.predict();
        self.foresee();
        self.tree.place(self.simd, &self.scratch.middle);
        self.tree.carry(self.simd, &self.scratch.middle.u, &self.gravity, None, &mut self.scratch.carried);
        self.guess_bounds();
        for look in 0.. {
            self.tree.fill_matrix(&mut self.scratch.matrix);
            self.balance();
            self.lead();
            factorise(&mut self.scratch.matrix, &self.tree.ways);
            solve(&self.scratch.matrix, &self.tree.ways, &mut self.scratch.next);
            self.stop();
            if self.bounds_hold(look) {
                break;
            }
        }
        self.impulses.keep();
        let (now, s) = (&self.now, &mut self.scratch);
        for d in 0..s.next.len() {
            let share = s.share[d];
            s.mean[d] = (share.like(1.0) - share) * now.u[d] + share * s.next[d];
        }
        now.fly(&self.tree, self.dt_s, &s.mean, &mut s.middle);
        std::mem::swap(&mut self.now.q, &mut s.middle.q);
        std::mem::swap(&mut self.now.poses, &mut s.middle.poses);
        self.before.copy_from_slice(&self.now.u);
        self.now.u.copy_from_slice(&s.next);
        self.arrive();
    }

    /// The linear equations for the velocities at the step's end: `matrix`·u' = `next`.
    ///
    /// With the share h of the end in the step's mean state, a joint's torque is c − k·(q + dt·h·v) − d·v at the mean velocity
    /// v = (1 − h)·u + h·u'.
    #[inline(always)]
    fn balance(&mut self) {
        let (dt, n, s) = (self.dt_s, self.tree.freedom(), &mut self.scratch);
        let (half, whole) = (Lanes::all(self.simd, 0.5), Lanes::all(self.simd, 1.0));
        for (next, carried) in s.next.iter_mut().zip(&s.carried) {
            *next = *carried * -dt;
        }
        s.share.fill(half);
        for (i, joint) in self.inner.iter().enumerate() {
            let d = self.root + i;
            s.matrix[d * n + d] += joint.armature;
            s.next[d] += (joint.constant - joint.stiffness * self.now.q[i]) * dt;
        }
        for d in 0..n {
            let u = self.now.u[d];
            let mut own = s.next[d] + s.matrix[d * n + d] * u;
            let way = &self.tree.ways[d];
            for &e in &way[..way.len() - 1] {
                let inertia = s.matrix[d * n + e];
                own += inertia * self.now.u[e];
                s.next[e] += inertia * u;
            }
            s.next[d] = own;
        }
        for (i, joint) in self.inner.iter().enumerate() {
            let d = self.root + i;
            let inertia = s.matrix[d * n + d];
            let rings = inertia.at_most(joint.damping * dt + joint.stiffness * (dt * dt));
            let share = rings.select(whole, half);
            let resistance = joint.damping * dt + share * joint.stiffness * (dt * dt);
            s.share[d] = share;
            s.next[d] -= (whole - share) * resistance * self.now.u[d];
            s.matrix[d * n + d] = inertia + share * resistance;
        }
        if let Some(ball) = &self.ball {
            let first = self.tree.first[ball.body];
            for d in first..first + 3 {
                s.matrix[d * n + d] = s.matrix[d * n + d] * (whole + self.rolling_damping * dt);
            }
        }
    }

    /// The lanes of the candidate that is spoken of: the last one has all that are left, and does the same in each. Left to
    /// themselves they would fall over, and everybody would wait for them.
    fn spoken_of(&self) -> Range<usize> {
        let last = self.lane + 1 == self.seen.len();
        self.lane..if last { S::F64_LANES } else { self.lane + 1 }
    }

    /// What can be seen of every candidate after a step.
    #[inline(always)]
    fn look(&mut self) {
        let (none, absurd) = (Lanes::zero(self.simd), Lanes::all(self.simd, ABSURD_SPEED));
        self.wild = absurd.less(none);
        for u in &self.now.u {
            self.wild = self.wild.or(u.abs().at_most(absurd).not());
        }
        for (lane, seen) in self.seen.iter_mut().enumerate() {
            for i in 0..seen.q.len() {
                seen.q[i] = self.now.q[i].lane(lane);
                seen.dq[i] = self.now.u[self.root + i].lane(lane);
            }
        }
    }
}

impl<S: Simd> Dynamics for Articulated<S> {
    fn lanes(&self) -> usize {
        self.seen.len()
    }

    fn turn_to(&mut self, lane: usize) {
        self.lane = lane;
    }

    fn positions(&self) -> &[f64] {
        &self.seen[self.lane].q
    }

    fn velocities(&self) -> &[f64] {
        &self.seen[self.lane].dq
    }

    fn place(&mut self, state: &RobotState) {
        let root = [state.base.angular_rad_s, state.base.velocity_m_s];
        let root = root.iter().flat_map(|v| v.iter().copied()).take(self.root);
        let mut wanted: Vec<f64> = root.chain(state.joints.iter().map(|&(_, dq)| dq)).collect();
        for lane in self.spoken_of() {
            for Coupling { joint, leader, ratio, .. } in &self.followers {
                wanted[self.root + joint] = ratio.lane(lane) * wanted[self.root + leader];
            }
            for ((now, before), &wanted) in self.now.u.iter_mut().zip(&mut self.before).zip(&wanted) {
                // Where nothing jumps, what the velocity was before goes on counting.
                before.set(lane, before.lane(lane) + (wanted - now.lane(lane)));
                now.set(lane, wanted);
            }
            for (now, &(q, _)) in self.now.q.iter_mut().zip(&state.joints) {
                now.set(lane, q);
            }
            for Coupling { joint, leader, ratio, offset } in &self.followers {
                let q = *ratio * self.now.q[*leader] + *offset;
                self.now.q[*joint].set(lane, q.lane(lane));
            }
            if self.root > 0 {
                self.now.poses[0].set(lane, &state.base.pose);
            }
        }
        self.look();
    }

    fn set_joint(&mut self, joint: usize, dof: &Dof) {
        for lane in self.spoken_of() {
            let inner = &mut self.inner[joint];
            if dof.motor.is_none() {
                inner.constant.set(lane, dof.torque.constant);
                inner.stiffness.set(lane, dof.torque.stiffness);
                inner.damping.set(lane, dof.torque.damping);
            }
            inner.dry_friction.set(lane, dof.dry_friction);
            inner.armature.set(lane, dof.armature);
            if dof.motor.is_some() || self.motors[joint].is_some() {
                torque_bounds::set(&mut self.motors[joint], inner, lane, dof);
            }
        }
        self.courses[joint] = dof.course;
    }

    fn midway(&self) -> bool {
        true
    }

    fn keeps_bounds(&self) -> bool {
        true
    }

    fn leads(&self) -> bool {
        // Substeps would have to share a course, and what the floor or a linkage pushes would have to be known beforehand.
        let pushed = self.root > 0 || self.ball.is_some() || !self.followers.is_empty();
        self.seen.len() == 1 && self.substeps == 1 && !pushed
    }

    fn needed(&mut self, torques: &mut [f64]) {
        self.inverse(torques);
    }

    fn step(&mut self) {
        if S::IS_SCALAR { self.arch.dispatch(Steps(self)) } else { self.simd.vectorize(Steps(self)) }
    }

    fn base(&self) -> BaseState {
        if self.root == 0 {
            let pose = self.fixed[self.lane];
            return BaseState { pose, velocity_m_s: Vector3::zeros(), angular_rad_s: Vector3::zeros() };
        }
        let part = |first: usize| Vector3::from_fn(|k, _| self.now.u[first + k].lane(self.lane));
        BaseState { pose: self.now.poses[0].lane(self.lane), velocity_m_s: part(3), angular_rad_s: part(0) }
    }

    fn foot_force_n(&self, foot: usize) -> f64 {
        self.foot_impulses[foot].lane(self.lane) / (self.dt_s * self.substeps as f64)
    }

    fn ball(&self) -> Option<Point3<f64>> {
        self.ball.as_ref().and_then(|_| self.now.poses.last()).map(|pose| Point3::from(pose.place.lane(self.lane)))
    }

    fn trouble(&self) -> Option<String> {
        if !self.wild.lane(self.lane) {
            return None;
        }
        let wild = |x: f64| !x.is_finite() || x.abs() > ABSURD_SPEED;
        let mut joints = self.velocities().iter().enumerate();
        if let Some((joint, dq)) = joints.find(|(_, dq)| wild(**dq)) {
            return Some(format!("joint `{}` moves at {dq:.1e} per second", self.names[joint]));
        }
        let BaseState { velocity_m_s: velocity, angular_rad_s: angular, .. } = self.base();
        Some(format!("the base moves at {} m/s and turns at {} rad/s", velocity.norm(), angular.norm()))
    }
}
