//! Joints whose motion is prescribed: they are where their course says, the other joints feel their acceleration, and what
//! that takes is inverse dynamics (recursive Newton-Euler; Featherstone 2008, chapter 5).

use super::Articulated;

impl Articulated {
    /// The middle of the step is known for prescribed joints.
    pub(super) fn foresee(&mut self) {
        for (dof, middle) in self.dofs.iter().zip(&mut self.scratch.middle) {
            let Some(course) = dof.course else { continue };
            let velocity = 0.5 * (course.from.velocity + course.to.velocity);
            *middle = (0.5 * (course.from.value + course.to.value), velocity);
        }
    }

    /// Takes the prescribed velocities out of the linear equations: what they do to the others is known.
    pub(super) fn lead(&mut self) {
        let (n, s) = (self.dofs.len(), &mut self.scratch);
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
            (self.q[i], self.dq[i]) = (course.to.value, course.to.velocity);
        }
    }

    /// The torques that the prescribed joints need as the coming step begins, beyond what acts on them anyway. Joints that are
    /// free go on accelerating as they did in the last step.
    pub(super) fn inverse(&mut self, torques: &mut [f64]) {
        let (dt, s) = (self.dt_s, &mut self.scratch);
        for (i, dof) in self.dofs.iter().enumerate() {
            let acceleration = (self.dq[i] - self.before[i]) / dt;
            s.middle[i] = dof.course.map_or((self.q[i], self.dq[i]), |c| (c.from.value, c.from.velocity));
            s.joints.push(dof.course.map_or(acceleration, |course| course.from.acceleration));
        }
        self.place();
        self.carry();
        let s = &mut self.scratch;
        for (i, (dof, torque)) in self.dofs.iter().zip(torques).enumerate() {
            let Some(course) = dof.course else { continue };
            let (q, dq) = s.middle[i];
            let inertial = s.axes[i].dot(&s.forces[i]) + dof.armature * course.from.acceleration;
            // At rest dry friction could be anything up to its bound: nothing is the least.
            let rubs = if dq == 0.0 { 0.0 } else { dof.dry_friction.copysign(dq) };
            *torque = inertial + rubs - dof.torque.at(q, dq);
        }
        s.joints.clear();
    }
}
