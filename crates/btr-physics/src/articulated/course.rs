//! Joints whose motion is prescribed: they are where their course says, the other joints feel their acceleration, and what
//! that takes is inverse dynamics (recursive Newton-Euler; Featherstone 2008, chapter 5).

use super::Articulated;

impl Articulated {
    /// The middle of the step is known for prescribed joints.
    pub(super) fn foresee(&mut self) {
        let middle = &mut self.scratch.middle;
        for (i, dof) in self.dofs.iter().enumerate() {
            let Some(course) = dof.course else { continue };
            middle.q[i] = 0.5 * (course.from.value + course.to.value);
            middle.u[i] = 0.5 * (course.from.velocity + course.to.velocity);
        }
    }

    /// Takes the prescribed velocities out of the linear equations: what they do to the others is known.
    pub(super) fn lead(&mut self) {
        let (n, s) = (self.tree.freedom(), &mut self.scratch);
        for (i, dof) in self.dofs.iter().enumerate() {
            let Some(course) = dof.course else { continue };
            for j in (0..n).filter(|j| *j != i) {
                let at = if j < i { i * n + j } else { j * n + i };
                s.next[j] -= s.matrix[at] * course.to.velocity;
                s.matrix[at] = 0.0;
            }
            s.matrix[i * n + i] = 1.0;
            s.next[i] = course.to.velocity;
        }
    }

    /// Puts prescribed joints exactly where they shall be.
    pub(super) fn arrive(&mut self) {
        for (i, dof) in self.dofs.iter().enumerate() {
            let Some(course) = dof.course else { continue };
            (self.now.q[i], self.now.u[i]) = (course.to.value, course.to.velocity);
        }
    }

    /// The torques that the prescribed joints need as the coming step begins, beyond what acts on them anyway. Joints that are
    /// free go on accelerating as they did in the last step.
    pub(super) fn inverse(&mut self, torques: &mut [f64]) {
        let (now, s) = (&self.now, &mut self.scratch);
        s.middle.clone_from(now);
        s.known.clear();
        for (i, dof) in self.dofs.iter().enumerate() {
            let acceleration = (now.u[i] - self.before[i]) / self.dt_s;
            s.known.push(dof.course.map_or(acceleration, |course| course.from.acceleration));
            if let Some(course) = dof.course {
                (s.middle.q[i], s.middle.u[i]) = (course.from.value, course.from.velocity);
            }
        }
        self.tree.place(&s.middle);
        self.tree.carry(&s.middle.u, &self.gravity, Some(&s.known));
        for (((i, dof), inertial), torque) in self.dofs.iter().enumerate().zip(self.tree.carried()).zip(torques) {
            let Some(course) = dof.course else { continue };
            let (q, dq) = (s.middle.q[i], s.middle.u[i]);
            let inertial = inertial + dof.armature * course.from.acceleration;
            // At rest dry friction could be anything up to its bound: nothing is the least.
            let rubs = if dq == 0.0 { 0.0 } else { dof.dry_friction.copysign(dq) };
            *torque = inertial + rubs - dof.torque.at(q, dq);
        }
    }
}
