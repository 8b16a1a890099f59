//! Motors within their bounds: which of them are at one is found with the step itself, whatever else acts on the
//! joints.
//!
//! A motor that would end beyond its bound in the step's mean state gets the bound as its law and the step is solved
//! anew; one that need not be at it is let go (a primal-dual active set: M. Hintermueller, K. Ito, K. Kunisch, SIAM J.
//! Optim. 13, 2002). So what acts in a step is within its bounds, and no inertia has to be guessed.

use super::state::Articulated;
use pulp::Simd;

/// So often motors may be let go. From then on they only come to their bounds, which has an end.
const LET_GO: usize = 6;

impl<S: Simd> Articulated<S> {
    /// Which motors are at their bounds if everything goes on as it did.
    #[inline(always)]
    pub(super) fn guess_bounds(&mut self) {
        for i in 0..self.motors.len() {
            let Some(motor) = &mut self.motors[i] else { continue };
            motor.side = motor.side.like(0.0);
            motor.look(self.scratch.middle.q[i], self.scratch.middle.u[self.root + i], false);
            self.take(i);
        }
    }

    /// Whether every motor is on the side where the step's mean state, as it was just solved, has it. Those that are
    /// not change sides.
    #[inline(always)]
    pub(super) fn bounds_hold(&mut self, look: usize) -> bool {
        let mut hold = true;
        for i in 0..self.motors.len() {
            let Some(motor) = &mut self.motors[i] else { continue };
            let (d, s) = (self.root + i, &self.scratch);
            let (share, now) = (s.share[d], self.now.u[d]);
            let mean = now + share * (s.next[d] - now);
            if motor.look(self.now.q[i] + share * mean * self.dt_s, mean, look < LET_GO) {
                hold = false;
                self.take(i);
            }
        }
        hold
    }

    /// Lets the joint feel its motor as it is now.
    #[inline(always)]
    fn take(&mut self, i: usize) {
        let Some(motor) = &self.motors[i] else { return };
        let (law, inner) = (motor.law(), &mut self.inner[i]);
        (inner.constant, inner.stiffness, inner.damping) = (law.constant, law.stiffness, law.damping);
    }
}
