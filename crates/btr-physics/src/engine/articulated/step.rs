//! One step: extrapolate the middle, solve the linear equations with motor bounds and impulses, advance.

use super::linear_algebra::lanes::Lanes;
use super::linear_algebra::spatial::{factorise, solve};
use super::state::Articulated;
use pulp::{NullaryFnOnce, Simd};
use std::ops::Range;

/// A speed above this (m/s, rad/s) counts as divergence.
pub(super) const ABSURD_SPEED: f64 = 1e4;

/// A step of the engine, compiled for its instruction set.
pub(super) struct Steps<'a, S: Simd>(pub(super) &'a mut Articulated<S>);

impl<S: Simd> NullaryFnOnce for Steps<'_, S> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        let engine = self.0;
        let zero = Lanes::zero(engine.simd);
        engine.foot_impulses.fill(zero);
        for _ in 0..engine.substeps {
            engine.advance();
            engine.sum_foot_impulses();
        }
        engine.publish_states();
    }
}

impl<S: Simd> Articulated<S> {
    /// Extrapolates the state to the middle of the step.
    #[inline(always)]
    fn predict(&mut self) {
        let (now, s) = (&self.now, &mut self.scratch);
        now.integrate(&self.tree, 0.5 * self.dt_s, &now.u, &mut s.middle);
        for ((middle, now), before) in s.middle.u.iter_mut().zip(&now.u).zip(&self.before) {
            *middle = *now * 1.5 - *before * 0.5;
        }
    }

    /// One step of `dt_s`, implicit in joint-level forces and contacts.
    #[inline(always)]
    fn advance(&mut self) {
        if self.is_prescribed() {
            self.before.copy_from_slice(&self.now.u);
            self.set_prescribed_end();
            return;
        }
        self.predict();
        self.set_prescribed_midpoint();
        self.tree.place(self.simd, &self.scratch.middle);
        self.tree.newton_euler(self.simd, &self.scratch.middle.u, &self.gravity, None, &mut self.scratch.bias_forces);
        self.predict_bounds();
        for iteration in 0.. {
            self.tree.fill_matrix(&mut self.scratch.matrix);
            self.assemble_equations();
            self.eliminate_prescribed();
            factorise(&mut self.scratch.matrix, &self.tree.paths);
            solve(&self.scratch.matrix, &self.tree.paths, &mut self.scratch.next);
            self.apply_constraints();
            if self.update_bounds(iteration) {
                break;
            }
        }
        self.impulses.accept();
        let (now, s) = (&self.now, &mut self.scratch);
        for d in 0..s.next.len() {
            let implicitness = s.implicitness[d];
            s.mean[d] = (implicitness.like(1.0) - implicitness) * now.u[d] + implicitness * s.next[d];
        }
        now.integrate(&self.tree, self.dt_s, &s.mean, &mut s.middle);
        std::mem::swap(&mut self.now.q, &mut s.middle.q);
        std::mem::swap(&mut self.now.poses, &mut s.middle.poses);
        self.before.copy_from_slice(&self.now.u);
        self.now.u.copy_from_slice(&s.next);
        self.set_prescribed_end();
    }

    /// The linear equations for the velocities at the step's end: `matrix`·u' = `next`.
    ///
    /// With the implicitness h, the weight of the step's end in its mean state, a joint's torque is c − k·(q + dt·h·v)
    /// − d·v at the mean velocity v = (1 − h)·u + h·u'.
    #[inline(always)]
    fn assemble_equations(&mut self) {
        let (dt, n, s) = (self.dt_s, self.tree.freedom(), &mut self.scratch);
        let (half, whole) = (Lanes::splat(self.simd, 0.5), Lanes::splat(self.simd, 1.0));
        for (next, bias_forces) in s.next.iter_mut().zip(&s.bias_forces) {
            *next = *bias_forces * -dt;
        }
        s.implicitness.fill(half);
        for (i, joint) in self.inner.iter().enumerate() {
            let d = self.root + i;
            s.matrix[d * n + d] += joint.armature;
            s.next[d] += (joint.constant - joint.stiffness * self.now.q[i]) * dt;
        }
        for d in 0..n {
            let u = self.now.u[d];
            let mut own = s.next[d] + s.matrix[d * n + d] * u;
            let path = &self.tree.paths[d];
            for &e in &path[..path.len() - 1] {
                let inertia = s.matrix[d * n + e];
                own += inertia * self.now.u[e];
                s.next[e] += inertia * u;
            }
            s.next[d] = own;
        }
        for (i, joint) in self.inner.iter().enumerate() {
            let d = self.root + i;
            let inertia = s.matrix[d * n + d];
            let rings = inertia.less_or_equal(joint.damping * dt + joint.stiffness * (dt * dt));
            let implicitness = rings.select(whole, half);
            let resistance = joint.damping * dt + implicitness * joint.stiffness * (dt * dt);
            s.implicitness[d] = implicitness;
            s.next[d] -= (whole - implicitness) * resistance * self.now.u[d];
            s.matrix[d * n + d] = inertia + implicitness * resistance;
        }
        if let Some(ball) = &self.ball {
            let first = self.tree.first[ball.body];
            for d in first..first + 3 {
                s.matrix[d * n + d] = s.matrix[d * n + d] * (whole + self.rolling_damping * dt);
            }
        }
    }

    /// Lanes of the selected candidate. The last candidate also fills the lanes that are left over, so that these cost
    /// no further iterations.
    pub(super) fn selected_lanes(&self) -> Range<usize> {
        let last = self.lane + 1 == self.joint_states.len();
        self.lane..if last { S::F64_LANES } else { self.lane + 1 }
    }

    /// Copies the joint states of every candidate out of the lanes, and detects divergence.
    #[inline(always)]
    pub(super) fn publish_states(&mut self) {
        let (none, absurd) = (Lanes::zero(self.simd), Lanes::splat(self.simd, ABSURD_SPEED));
        self.diverged = absurd.less(none);
        for u in &self.now.u {
            self.diverged = self.diverged.or(u.abs().less_or_equal(absurd).not());
        }
        for (lane, joint_states) in self.joint_states.iter_mut().enumerate() {
            for i in 0..joint_states.q.len() {
                joint_states.q[i] = self.now.q[i].lane(lane);
                joint_states.dq[i] = self.now.u[self.root + i].lane(lane);
            }
        }
    }
}
