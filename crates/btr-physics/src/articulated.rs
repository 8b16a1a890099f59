//! Robots in minimal coordinates, on the ground, in the air or bolted down.
//!
//! Joint-space dynamics from the composite-rigid-body and the recursive Newton-Euler algorithm, factorised along the tree
//! (R. Featherstone, "Rigid Body Dynamics Algorithms", Springer 2008, chapters 5, 6 and 8), with all spatial quantities in the
//! world's axes about one point, so that composite inertias are plain sums.
//!
//! A step is the implicit midpoint rule for servos, springs and dampers, with inertia, gravity and velocity forces taken at
//! the middle that the past predicts: second order. Joints so stiff that the rule would let them ring are advanced by
//! backward Euler instead. Dry friction, joint limits and contacts are impulses within bounds. A contact is a spring and a
//! damper that are solved for the step's end, and Coulomb friction that holds; a hard floor is a stiff one.

mod build;
mod course;
mod impulses;
mod spatial;
mod touch;
mod tree;

use crate::engine::{BaseState, Dof, Dynamics, State};
use impulses::{Impulses, Law, separation};
use nalgebra::{Isometry3, Point3, Vector3};
use spatial::{factorise, solve};
use touch::{Hull, Reach, Round, Touch};
use tree::{Posture, Tree};

/// Faster than this (m/s, rad/s) is a blow-up.
const ABSURD_SPEED: f64 = 1e4;
/// What is still apart counts as a contact if it would meet within half a step at this speed (m/s) beyond what it is free to do:
/// others may push it down.
const PUSHED: f64 = 0.5;
/// Nothing is looked at that would have to be faster than this (m/s) to touch within a step.
const FASTEST: f64 = 20.0;

/// A robot in its world.
pub(crate) struct Articulated {
    tree: Tree,
    now: Posture,
    /// Velocities one step ago.
    before: Vec<f64>,
    /// Degrees of freedom of the root, which come first: 6 or none.
    root: usize,
    fixed: Isometry3<f64>,
    dofs: Vec<Dof>,
    limits: Vec<(f64, f64)>,
    names: Vec<String>,
    gravity: Vector3<f64>,
    dt_s: f64,
    substeps: usize,
    floor: Option<Floor>,
    hulls: Vec<Hull>,
    ball: Option<Round>,
    /// Rate at which the ball's spin decays, in 1/s.
    rolling_damping: f64,
    impulses: Impulses,
    foot_impulses: Vec<f64>,
    scratch: Scratch,
}

/// What the floor and the ball do to whatever touches them.
struct Floor {
    /// None where there is only a ball.
    friction: Option<f64>,
    /// Of every point of contact, in N/m and N·s/m.
    stiffness: f64,
    damping: f64,
}

/// Memory for a step, allocated once.
struct Scratch {
    /// The middle of the step.
    middle: Posture,
    /// Row by row: first the inertia matrix, then its factor.
    matrix: Vec<f64>,
    /// What all do at the step's end.
    next: Vec<f64>,
    /// How implicit each joint is: 0.5 for the midpoint, 1 for backward Euler.
    share: Vec<f64>,
    touches: Vec<Touch>,
    /// Accelerations of the joints where they are known.
    known: Vec<f64>,
}

impl Articulated {
    /// Where everything will be in the middle of the step if it goes on as it did.
    fn predict(&mut self) {
        let (now, middle) = (&self.now, &mut self.scratch.middle);
        now.fly(&self.tree.bodies, &self.tree.first, 0.5 * self.dt_s, |d| now.u[d], middle);
        for ((middle, now), before) in middle.u.iter_mut().zip(&now.u).zip(&self.before) {
            *middle = 1.5 * now - 0.5 * before;
        }
    }

    /// One step of `dt_s`: implicit in everything that acts inside the joints and at contacts.
    fn advance(&mut self) {
        self.predict();
        self.foresee();
        self.tree.place(&self.scratch.middle);
        self.tree.carry(&self.scratch.middle.u, &self.gravity, None);
        self.tree.fill_matrix(&mut self.scratch.matrix);
        self.balance();
        self.lead();
        factorise(&mut self.scratch.matrix, &self.tree.above);
        solve(&self.scratch.matrix, &self.tree.above, &mut self.scratch.next);
        self.stop();
        let (now, s) = (&self.now, &mut self.scratch);
        let mean = |d: usize| (1.0 - s.share[d]) * now.u[d] + s.share[d] * s.next[d];
        now.fly(&self.tree.bodies, &self.tree.first, self.dt_s, mean, &mut s.middle);
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
    fn balance(&mut self) {
        let (dt, n, s) = (self.dt_s, self.tree.freedom(), &mut self.scratch);
        for (next, carried) in s.next.iter_mut().zip(self.tree.carried()) {
            *next = -dt * carried;
        }
        s.share.fill(0.5);
        for (i, dof) in self.dofs.iter().enumerate() {
            let d = self.root + i;
            s.matrix[d * n + d] += dof.armature;
            s.next[d] += dt * (dof.torque.constant - dof.torque.stiffness * self.now.q[i]);
        }
        for d in 0..n {
            let u = self.now.u[d];
            s.next[d] += s.matrix[d * n + d] * u;
            let mut at = self.tree.above[d];
            while let Some(e) = at {
                s.next[d] += s.matrix[d * n + e] * self.now.u[e];
                s.next[e] += s.matrix[d * n + e] * u;
                at = self.tree.above[e];
            }
        }
        for (i, dof) in self.dofs.iter().enumerate() {
            let (d, torque) = (self.root + i, &dof.torque);
            let implicit = dt * torque.damping + dt * dt * torque.stiffness;
            let rings = implicit >= s.matrix[d * n + d];
            s.share[d] = if rings { 1.0 } else { 0.5 };
            let resistance = dt * torque.damping + dt * dt * s.share[d] * torque.stiffness;
            s.next[d] -= (1.0 - s.share[d]) * resistance * self.now.u[d];
            s.matrix[d * n + d] += s.share[d] * resistance;
        }
        if let Some(ball) = &self.ball {
            let first = self.tree.first[ball.body];
            for d in first..first + 3 {
                s.matrix[d * n + d] *= 1.0 + dt * self.rolling_damping;
            }
        }
    }

    /// Dry friction, joint limits and contacts: impulses within their bounds.
    fn stop(&mut self) {
        self.impulses.clear();
        self.rub();
        self.touch();
        self.impulses.act(&self.tree, &self.scratch.matrix, &mut self.scratch.next);
    }

    /// Dry friction and joint limits stop joints as far as they can.
    fn rub(&mut self) {
        let (dt, s) = (self.dt_s, &mut self.scratch);
        let mut hold = |dof, bounds| self.impulses.hold(dof, bounds, &self.tree, &s.matrix, &s.next);
        for (i, dof) in self.dofs.iter().enumerate().filter(|(_, dof)| dof.course.is_none()) {
            let (d, q) = (self.root + i, self.now.q[i]);
            let (lower, upper) = ((self.limits[i].0 - q) / dt, (self.limits[i].1 - q) / dt);
            if dof.dry_friction > 0.0 {
                let most = dt * dof.dry_friction;
                hold(d, [0.0, -most, most]);
            }
            if s.next[d] < lower || s.next[d] > upper {
                // It must end the step at the limit, not halfway beyond.
                s.share[d] = 1.0;
            }
            if s.next[d] < lower {
                hold(d, [lower, 0.0, f64::INFINITY]);
            }
            if s.next[d] > upper {
                hold(d, [upper, f64::NEG_INFINITY, 0.0]);
            }
        }
    }

    /// Contacts with the floor and the ball.
    fn touch(&mut self) {
        let Some(floor) = &self.floor else { return };
        let (dt, s) = (self.dt_s, &mut self.scratch);
        let height = floor.friction.map(|_| -self.tree.origin.z);
        let reach = Reach { floor: height, gap: dt * FASTEST };
        touch::find(&self.tree, &self.hulls, self.ball.as_ref(), reach, &mut s.touches);
        for touch in &s.touches {
            let free = separation(touch, &self.tree, &s.next);
            let arrives = touch.depth > 0.5 * dt * (free - PUSHED);
            let ball = self.ball.as_ref().filter(|ball| touch.body == ball.body || touch.other == Some(ball.body));
            let bounces = ball.filter(|ball| ball.restitution > 0.0);
            // What shall bounce has to arrive at its full speed first.
            if !arrives || (bounces.is_some() && touch.depth < 0.0) {
                continue;
            }
            let Some(mut law) = floor.law(touch.depth, dt) else { continue };
            law.friction = ball.map_or(floor.friction.unwrap_or(0.0), |ball| ball.friction);
            if let Some(ball) = bounces {
                let kept = -ball.restitution * separation(touch, &self.tree, &self.now.u);
                if kept > law.wanted {
                    // An impact is over within the step: nothing of what is kept goes into a spring.
                    (law.wanted, law.softness) = (kept, 0.0);
                }
            }
            self.impulses.touch(touch, law, &self.tree, &s.matrix, &s.next);
        }
    }
}

impl Floor {
    /// A spring and a damper over a step, at a depth in its middle. None if there is neither.
    ///
    /// The force is k·(depth − dt/2·v') − d·v' at the speed v' of separation at the step's end. While there is a gap, it only has
    /// to close.
    fn law(&self, depth: f64, dt_s: f64) -> Option<Law> {
        let resistance = self.damping + 0.5 * dt_s * self.stiffness;
        let softness = 1.0 / (dt_s * resistance);
        let wanted = if depth > 0.0 { self.stiffness * depth / resistance } else { 2.0 * depth / dt_s };
        (resistance > 0.0).then_some(Law { wanted, softness, friction: 0.0 })
    }
}

impl Dynamics for Articulated {
    fn positions(&self) -> &[f64] {
        &self.now.q
    }

    fn velocities(&self) -> &[f64] {
        &self.now.u[self.root..self.root + self.dofs.len()]
    }

    fn place(&mut self, state: &State) {
        let root = [state.base.angular_rad_s, state.base.velocity_m_s];
        let root = root.iter().flat_map(|v| v.iter().copied()).take(self.root);
        let wanted = root.chain(state.joints.iter().map(|&(_, dq)| dq));
        for ((now, before), wanted) in self.now.u.iter_mut().zip(&mut self.before).zip(wanted) {
            // Where nothing jumps, what the velocity was before goes on counting.
            *before += wanted - *now;
            *now = wanted;
        }
        for (now, &(q, _)) in self.now.q.iter_mut().zip(&state.joints) {
            *now = q;
        }
        if self.root > 0 {
            self.now.poses[0] = state.base.pose;
        }
    }

    fn set_joint(&mut self, joint: usize, dof: &Dof) {
        self.dofs[joint] = *dof;
    }

    fn midway(&self) -> bool {
        true
    }

    fn leads(&self) -> bool {
        // Substeps would have to share a course, and what the floor pushes would have to be known beforehand.
        self.substeps == 1 && self.root == 0 && self.ball.is_none()
    }

    fn needed(&mut self, torques: &mut [f64]) {
        self.inverse(torques);
    }

    fn step(&mut self) {
        self.foot_impulses.fill(0.0);
        for _ in 0..self.substeps {
            self.advance();
            for touch in &self.scratch.touches {
                if let Some(foot) = touch.hull.filter(|_| touch.other.is_none()).and_then(|hull| self.hulls[hull].foot)
                {
                    self.foot_impulses[foot] += self.impulses.normal(touch.slot);
                }
            }
        }
    }

    fn base(&self) -> BaseState {
        if self.root == 0 {
            return BaseState { pose: self.fixed, velocity_m_s: Vector3::zeros(), angular_rad_s: Vector3::zeros() };
        }
        let part = |first: usize| Vector3::from_column_slice(&self.now.u[first..first + 3]);
        BaseState { pose: self.now.poses[0], velocity_m_s: part(3), angular_rad_s: part(0) }
    }

    fn foot_force_n(&self, foot: usize) -> f64 {
        self.foot_impulses[foot] / (self.dt_s * self.substeps as f64)
    }

    fn ball(&self) -> Option<Point3<f64>> {
        self.ball.as_ref().and_then(|_| self.now.poses.last()).map(|pose| Point3::from(pose.translation.vector))
    }

    fn trouble(&self) -> Option<String> {
        let wild = |x: f64| !x.is_finite() || x.abs() > ABSURD_SPEED;
        let mut joints = self.now.q.iter().zip(self.velocities()).enumerate();
        if let Some((joint, (_, dq))) = joints.find(|(_, (q, dq))| wild(**dq) || !q.is_finite()) {
            return Some(format!("joint `{}` moves at {dq:.1e} per second", self.names[joint]));
        }
        let BaseState { velocity_m_s: velocity, angular_rad_s: angular, .. } = self.base();
        (wild(velocity.norm()) || wild(angular.norm()))
            .then(|| format!("the base moves at {} m/s and turns at {} rad/s", velocity.norm(), angular.norm()))
    }
}
