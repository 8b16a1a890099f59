//! Motor bounds: which motors are at a bound is found together with the step.
//!
//! A motor that would exceed its bound in the step's mean state gets the bound as its law and the step is solved again;
//! one that no longer needs its bound is released (a primal-dual active set: M. Hintermueller, K. Ito, K. Kunisch, SIAM
//! J. Optim. 13, 2002). The torque in a step is thus within its bounds, and no effective inertia has to be estimated.

use super::state::Articulated;
use pulp::Simd;

/// Number of iterations that may release motors. After these, motors only move to their bounds, which terminates.
const RELEASES: usize = 6;

impl<S: Simd> Articulated<S> {
    /// Predicts which motors are at their bounds, from the extrapolated midpoint.
    #[inline(always)]
    pub(super) fn predict_bounds(&mut self) {
        for i in 0..self.motors.len() {
            let Some(motor) = &mut self.motors[i] else { continue };
            motor.side = motor.side.like(0.0);
            motor.update_side(self.scratch.middle.q[i], self.scratch.middle.u[self.root + i], false);
            self.set_motor_law(i);
        }
    }

    /// Moves every motor to the side that the step's mean state requires, as just solved. Returns whether none had to
    /// change.
    #[inline(always)]
    pub(super) fn update_bounds(&mut self, iteration: usize) -> bool {
        let mut hold = true;
        for i in 0..self.motors.len() {
            let Some(motor) = &mut self.motors[i] else { continue };
            let (d, s) = (self.root + i, &self.scratch);
            let (implicitness, now) = (s.implicitness[d], self.now.u[d]);
            let mean = now + implicitness * (s.next[d] - now);
            if motor.update_side(self.now.q[i] + implicitness * mean * self.dt_s, mean, iteration < RELEASES) {
                hold = false;
                self.set_motor_law(i);
            }
        }
        hold
    }

    /// Sets the joint's forces to those with its motor on its current side.
    #[inline(always)]
    fn set_motor_law(&mut self, i: usize) {
        let Some(motor) = &self.motors[i] else { return };
        let (law, inner) = (motor.law(), &mut self.inner[i]);
        (inner.constant, inner.stiffness, inner.damping) = (law.constant, law.stiffness, law.damping);
    }
}
