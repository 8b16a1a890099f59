//! Joints with a prescribed motion. They follow it exactly, their acceleration acts on the other joints, and the torque
//! that they require comes from inverse dynamics (recursive Newton-Euler; Featherstone 2008, chapter 5). Prescribed
//! motions need an engine with a single candidate.

use super::linear_algebra::lanes::Lanes;
use super::state::Articulated;
use crate::engine::{Affine, Creep, Dof};
use pulp::{NullaryFnOnce, Simd};

/// The torques that prescribed joints require, compiled for the engine's instruction set.
pub(super) struct InverseDynamics<'a, S: Simd> {
    pub(super) engine: &'a mut Articulated<S>,
    pub(super) torques: &'a mut [f64],
}

impl<S: Simd> NullaryFnOnce for InverseDynamics<'_, S> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        self.engine.inverse_dynamics(self.torques);
    }
}

impl<S: Simd> Articulated<S> {
    /// Whether every joint follows a prescribed motion: then nothing has to be solved for.
    #[inline(always)]
    pub(super) fn is_prescribed(&self) -> bool {
        self.root == 0 && self.ball.is_none() && self.prescribed.iter().all(Option::is_some)
    }

    /// Sets the step's middle for prescribed joints, where it is known.
    #[inline(always)]
    pub(super) fn set_prescribed_midpoint(&mut self) {
        let (simd, middle) = (self.simd, &mut self.scratch.middle);
        for (i, motion) in self.prescribed.iter().enumerate() {
            let Some(motion) = motion else { continue };
            middle.q[i] = Lanes::splat(simd, 0.5 * (motion.from.value + motion.to.value));
            middle.u[i] = Lanes::splat(simd, 0.5 * (motion.from.velocity + motion.to.velocity));
        }
    }

    /// Eliminates the prescribed velocities from the linear equations, by moving their known effect on the other joints
    /// to the right-hand side.
    #[inline(always)]
    pub(super) fn eliminate_prescribed(&mut self) {
        let (n, simd, s) = (self.tree.freedom(), self.simd, &mut self.scratch);
        for (i, motion) in self.prescribed.iter().enumerate() {
            let Some(motion) = motion else { continue };
            for j in 0..n {
                if j != i {
                    let at = if j < i { i * n + j } else { j * n + i };
                    s.next[j] = s.next[j] - s.matrix[at] * motion.to.velocity;
                    s.matrix[at] = Lanes::zero(simd);
                }
            }
            s.matrix[i * n + i] = Lanes::splat(simd, 1.0);
            s.next[i] = Lanes::splat(simd, motion.to.velocity);
        }
    }

    /// Sets prescribed joints to the exact end of their motion.
    #[inline(always)]
    pub(super) fn set_prescribed_end(&mut self) {
        for (i, motion) in self.prescribed.iter().enumerate() {
            let Some(motion) = motion else { continue };
            self.now.q[i] = Lanes::splat(self.simd, motion.to.value);
            self.now.u[i] = Lanes::splat(self.simd, motion.to.velocity);
        }
    }

    /// Computes the torques that the prescribed joints require at the beginning of the coming step, beyond the other
    /// forces on them. Free joints are assumed to keep the acceleration of the last step.
    #[inline(always)]
    fn inverse_dynamics(&mut self, torques: &mut [f64]) {
        let (now, simd, s) = (&self.now, self.simd, &mut self.scratch);
        s.middle.clone_from(now);
        s.known.clear();
        for (i, motion) in self.prescribed.iter().enumerate() {
            let acceleration = (now.u[i] - self.before[i]) * self.dt_s.recip();
            s.known.push(motion.map_or(acceleration, |motion| Lanes::splat(simd, motion.from.acceleration)));
            if let Some(motion) = motion {
                s.middle.q[i] = Lanes::splat(simd, motion.from.value);
                s.middle.u[i] = Lanes::splat(simd, motion.from.velocity);
            }
        }
        self.tree.place(simd, &s.middle);
        self.tree.newton_euler(simd, &s.middle.u, &self.gravity, Some(&s.known), &mut s.bias_forces);
        for ((i, motion), torque) in self.prescribed.iter().enumerate().zip(torques) {
            let Some(motion) = motion else { continue };
            let (inner, lane) = (&self.inner[i], self.lane);
            let [constant, stiffness, damping] =
                [inner.constant, inner.stiffness, inner.damping].map(|lanes| lanes.lane(lane));
            let [rate, time_s] = inner.creep.map(|lanes| lanes.lane(lane));
            let dof = Dof {
                torque: Affine { constant, stiffness, damping },
                dry_friction: inner.dry_friction.lane(lane),
                creep: Creep { rate, time_s },
                armature: inner.armature.lane(lane),
                ..Dof::default()
            };
            *torque = dof.required(motion, s.bias_forces[i].lane(lane));
        }
    }
}
