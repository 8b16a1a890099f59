//! Joints with a prescribed motion. They follow it exactly, their acceleration acts on the other joints, and the torque
//! that they require comes from inverse dynamics (recursive Newton-Euler; Featherstone 2008, chapter 5). Prescribed
//! motions need an engine with a single candidate.

use super::linear_algebra::lanes::Lanes;
use super::state::Articulated;
use pulp::Simd;

impl<S: Simd> Articulated<S> {
    /// Sets the step's middle for prescribed joints, where it is known.
    #[inline(always)]
    pub(super) fn foresee(&mut self) {
        let (simd, middle) = (self.simd, &mut self.scratch.middle);
        for (i, course) in self.courses.iter().enumerate() {
            let Some(course) = course else { continue };
            middle.q[i] = Lanes::all(simd, 0.5 * (course.from.value + course.to.value));
            middle.u[i] = Lanes::all(simd, 0.5 * (course.from.velocity + course.to.velocity));
        }
    }

    /// Eliminates the prescribed velocities from the linear equations, by moving their known effect on the other joints
    /// to the right-hand side.
    #[inline(always)]
    pub(super) fn lead(&mut self) {
        let (n, simd, s) = (self.tree.freedom(), self.simd, &mut self.scratch);
        for (i, course) in self.courses.iter().enumerate() {
            let Some(course) = course else { continue };
            for j in 0..n {
                if j != i {
                    let at = if j < i { i * n + j } else { j * n + i };
                    s.next[j] = s.next[j] - s.matrix[at] * course.to.velocity;
                    s.matrix[at] = Lanes::zero(simd);
                }
            }
            s.matrix[i * n + i] = Lanes::all(simd, 1.0);
            s.next[i] = Lanes::all(simd, course.to.velocity);
        }
    }

    /// Sets prescribed joints to the exact end of their motion.
    #[inline(always)]
    pub(super) fn arrive(&mut self) {
        for (i, course) in self.courses.iter().enumerate() {
            let Some(course) = course else { continue };
            self.now.q[i] = Lanes::all(self.simd, course.to.value);
            self.now.u[i] = Lanes::all(self.simd, course.to.velocity);
        }
    }

    /// Computes the torques that the prescribed joints require at the beginning of the coming step, beyond the other
    /// forces on them. Free joints are assumed to keep the acceleration of the last step.
    pub(super) fn inverse(&mut self, torques: &mut [f64]) {
        let (now, simd, s) = (&self.now, self.simd, &mut self.scratch);
        s.middle.clone_from(now);
        s.known.clear();
        for (i, course) in self.courses.iter().enumerate() {
            let acceleration = (now.u[i] - self.before[i]) * self.dt_s.recip();
            s.known.push(course.map_or(acceleration, |course| Lanes::all(simd, course.from.acceleration)));
            if let Some(course) = course {
                s.middle.q[i] = Lanes::all(simd, course.from.value);
                s.middle.u[i] = Lanes::all(simd, course.from.velocity);
            }
        }
        self.tree.place(simd, &s.middle);
        self.tree.carry(simd, &s.middle.u, &self.gravity, Some(&s.known), &mut s.carried);
        for ((i, course), torque) in self.courses.iter().enumerate().zip(torques) {
            let Some(course) = course else { continue };
            let (inner, lane) = (&self.inner[i], self.lane);
            let [constant, stiffness, damping] =
                [inner.constant, inner.stiffness, inner.damping].map(|lanes| lanes.lane(lane));
            let (q, dq) = (course.from.value, course.from.velocity);
            let inertial = s.carried[i].lane(lane) + inner.armature.lane(lane) * course.from.acceleration;
            // At rest dry friction can be anything up to its bound: zero is the smallest.
            let rubs = if dq == 0.0 { 0.0 } else { inner.dry_friction.lane(lane).copysign(dq) };
            *torque = inertial + rubs - (constant - stiffness * q - damping * dq);
        }
    }
}
