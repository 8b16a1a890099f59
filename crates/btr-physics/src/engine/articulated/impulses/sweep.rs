//! Projected Gauss-Seidel: impulses are corrected one after the other, in sweeps, until the velocities converge.

use super::rows::{Contact, ContactLaw, Impulses, Single};
use crate::engine::articulated::linear_algebra::lanes::{Lanes, Mask};
use pulp::Simd;

/// Termination without contacts: maximum number of sweeps, and relative change of a velocity below which it has
/// converged.
const IN_JOINTS: (usize, f64) = (60, 1e-13);
/// The same with contacts, relative to the fastest speed: far below any sensor's resolution. A sole that slides flat on
/// its corners has no unique load distribution and would never converge.
const TOUCHING: (usize, f64) = (50, 1e-6);
/// Bodies at rest must not creep: speeds below this (rad/s, m/s) count as this.
const AT_REST: f64 = 0.01;

impl<S: Simd> Impulses<S> {
    /// Warm start from the last impulses, for candidates that have not converged; `tried` are those that the active-set
    /// method has changed.
    #[inline(always)]
    pub(super) fn start_sweeps(&mut self, settled: Mask<S>, tried: Mask<S>) {
        let (rows, zero) = (self.rows(), Lanes::zero(self.simd));
        if !settled.not().any() {
            return;
        }
        if tried.any() {
            for (speed, free_speed) in self.speeds.iter_mut().zip(&self.guess.free_speeds) {
                *speed = settled.select(*speed, *free_speed);
            }
            for single in &self.singles {
                self.impulses[single.row] = settled.select(self.impulses[single.row], zero);
            }
        }
        for contact in &self.contacts {
            for k in 0..3 {
                let row = contact.row + k;
                let warm_start = contact.mask.select(self.warm_start[contact.slot][k], zero);
                self.impulses[row] = settled.select(self.impulses[row], warm_start);
                let impulse = settled.select(zero, warm_start);
                let delassus = &self.delassus[row * rows..(row + 1) * rows];
                for (speed, &response) in self.speeds.iter_mut().zip(delassus) {
                    *speed = speed.add_product(response, impulse);
                }
            }
        }
    }

    /// Sweeps each candidate until it converges or reaches its maximum; returns those that did not converge.
    #[inline(always)]
    pub(super) fn sweep_until_settled(&mut self, mut moving: Mask<S>, u: &[Lanes<S>]) -> Mask<S> {
        let zero = Lanes::zero(self.simd);
        let mut fastest = zero.like(AT_REST);
        for speed in u {
            fastest = fastest.max(speed.abs());
        }
        let touching = self.touching();
        let settled = [
            touching.select(fastest * TOUCHING.1, zero.like(IN_JOINTS.1)),
            touching.select(zero, zero.like(IN_JOINTS.1)),
        ];
        let sweeps = touching.select(zero.like(TOUCHING.0 as f64), zero.like(IN_JOINTS.0 as f64));
        let (mut sweep, mut unconverged) = (0.0, zero.less(zero));
        while moving.any() {
            moving = self.sweep(moving, settled);
            sweep += 1.0;
            let last = sweeps.less_or_equal(zero.like(sweep));
            unconverged = unconverged.or(moving.and(last));
            moving = moving.and(last.not());
        }
        unconverged
    }

    /// One sweep: sets each joint's and each contact's impulses to their optimum with all others fixed, for the
    /// candidates in `moving`. Returns those where a velocity changed by more than the tolerances, absolute and
    /// relative.
    #[inline(always)]
    fn sweep(&mut self, moving: Mask<S>, settled: [Lanes<S>; 2]) -> Mask<S> {
        let (rows, zero) = (self.rows(), Lanes::zero(self.simd));
        let mut still = zero.less(zero);
        for k in 0..self.singles.len() {
            let Single { row, law, effective_mass } = self.singles[k];
            let (own, before) = (self.delassus[row * rows + row], self.impulses[row]);
            let missing = law.target - self.speeds[row] - law.softness * before;
            let to = before.add_product(missing, effective_mass).clamp(law.lower, law.upper);
            let change = moving.select(to - before, zero);
            self.impulses[row] += change;
            for (speed, &response) in self.speeds.iter_mut().zip(&self.delassus[row * rows..(row + 1) * rows]) {
                *speed = speed.add_product(response, change);
            }
            still = still.or(moves(change * own, self.speeds[row], settled));
        }
        for k in 0..self.contacts.len() {
            let row = self.contacts[k].row;
            let found = self.solve_contact(&self.contacts[k]);
            let mut change = found;
            for k in 0..3 {
                change[k] = moving.select(found[k] - self.impulses[row + k], zero);
                self.impulses[row + k] += change[k];
            }
            let (first, rest) = self.delassus[row * rows..(row + 3) * rows].split_at(rows);
            let (second, third) = rest.split_at(rows);
            for (((speed, &a), &b), &c) in self.speeds.iter_mut().zip(first).zip(second).zip(third) {
                *speed = speed.add_product(a, change[0]).add_product(b, change[1]).add_product(c, change[2]);
            }
            for k in 0..3 {
                let own = self.delassus[(row + k) * rows + row + k];
                still = still.or(moves(change[k] * own, self.speeds[row + k], settled));
            }
        }
        moving.and(still)
    }

    /// The impulses of a contact with all others fixed: the normal one, then the tangential ones within its friction
    /// cone.
    #[inline(always)]
    fn solve_contact(&self, contact: &Contact<S>) -> [Lanes<S>; 3] {
        let (rows, row, ContactLaw { target, softness, friction }) = (self.rows(), contact.row, contact.law);
        let (zero, one) = (Lanes::zero(self.simd), Lanes::splat(self.simd, 1.0));
        let before = self.impulses[row];
        let missing = target - self.speeds[row] - softness * before;
        let normal = contact.mask.select(before.add_product(missing, contact.effective_mass).max(zero), zero);
        let mut across = [zero; 2];
        for k in 0..2 {
            let speed = self.speeds[row + 1 + k].add_product(self.delassus[row * rows + row + 1 + k], normal - before);
            across[k] = self.impulses[row + 1 + k].sub_product(speed, contact.tangential_mass);
        }
        let limit = friction * normal;
        let square = across[0] * across[0] + across[1] * across[1];
        let beyond = (limit * limit).less(square);
        // Most contacts stick.
        let shrink = if beyond.any() { beyond.select(limit / beyond.select(square, one).sqrt(), one) } else { one };
        [normal, across[0] * shrink, across[1] * shrink]
    }
}

/// Whether a velocity changed by more than these absolute and relative tolerances.
#[inline(always)]
fn moves<S: Simd>(change: Lanes<S>, speed: Lanes<S>, [absolute, relative]: [Lanes<S>; 2]) -> Mask<S> {
    change.abs().less_or_equal(absolute.add_product(relative, speed.abs())).not()
}
