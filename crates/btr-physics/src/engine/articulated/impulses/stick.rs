//! Active-set method for the usual case: each contact either sticks or separates, and each joint either is at rest or
//! slides with the full dry friction. The active set is guessed, its linear equations are solved, and the guess is
//! corrected. This is for soles with many contact points, where sweeps converge slowly; where a contact slides, the
//! sweeps are used all the same.

use super::rows::{BoundedRow, Impulses, Single};
use crate::engine::articulated::linear_algebra::lanes::{Lanes, Mask};
use pulp::Simd;

/// Corrections of the active set before the sweeps are used instead.
const GUESSES: usize = 4;
/// With more rows than this the sweeps are faster.
const MOST_ROWS: f64 = 30.0;
/// Regularisation of rows without softness, relative to the diagonal: a sole that sticks on four corners has no unique
/// load distribution...
const REGULARISATION: f64 = 1e-9;
/// ... and corners whose heights differ slightly would prevent it from tilting by huge tangential forces against each
/// other.
const TANGENTIAL_REGULARISATION: f64 = 2e-6;
/// Tangential forces are distributed as the load is, up to this ratio.
const MAX_LOAD_RATIO: f64 = 1e4;
/// Tolerance of the friction cone (relative) and of target velocities (m/s).
const TOLERANCE: f64 = 1e-9;

impl<S: Simd> Impulses<S> {
    /// Tries to solve for the impulses of the candidates in `may` without sweeps. Returns those where that succeeded;
    /// their impulses and speeds are final.
    #[inline(always)]
    pub(super) fn stick(&mut self, may: Mask<S>) -> Mask<S> {
        let zero = Lanes::zero(self.simd);
        self.guess();
        let mut open = may;
        for _ in 0..GUESSES {
            self.factorise();
            self.solve();
            let wrong = self.correct();
            open = open.and(wrong);
            if !open.any() {
                break;
            }
        }
        let few = self.own_rows().less_or_equal(zero.like(MOST_ROWS));
        open.or(self.slides()).not().and(few).and(may)
    }

    /// Number of rows that each candidate needs.
    #[inline(always)]
    fn own_rows(&self) -> Lanes<S> {
        let zero = Lanes::zero(self.simd);
        let mut rows = zero;
        for contact in &self.contacts {
            rows += contact.mask.select(zero.like(3.0), zero);
        }
        for single in &self.singles {
            rows += single.law.lower.less(single.law.upper).select(zero.like(1.0), zero);
        }
        rows
    }

    /// Initial active set: contacts with an impulse in the last step stick, the others are separated; joints that dry
    /// friction cannot stop slide.
    #[inline(always)]
    fn guess(&mut self) {
        let (rows, zero) = (self.rows(), Lanes::zero(self.simd));
        let (one, all) = (zero.like(1.0), zero.less_or_equal(zero));
        let g = &mut self.guess;
        g.free.clear();
        g.free.resize(rows, all);
        g.free_speeds.clear();
        g.free_speeds.extend_from_slice(&self.speeds);
        for numbers in [&mut g.target, &mut g.regularisation, &mut g.solution] {
            numbers.clear();
            numbers.resize(rows, zero);
        }
        // All entries that are read are written first.
        g.factor.resize(g.factor.len().max(rows * rows), zero);
        for (k, &Single { row, law, effective_mass }) in self.singles.iter().enumerate() {
            // Couplings hold exactly: they are never redundant.
            let own = if k < self.couplings { zero } else { self.delassus[row * rows + row] };
            let required = (law.target - self.speeds[row]) * effective_mass;
            let inside = law.lower.less(required).and(required.less(law.upper));
            (g.free[row], g.target[row]) = (inside, law.target);
            g.regularisation[row] = law.softness + own * REGULARISATION;
            self.impulses[row] = inside.select(zero, required.clamp(law.lower, law.upper));
        }
        let (mut loads, mut many) = (zero, zero);
        for contact in &self.contacts {
            let load = self.warm_start[contact.slot][0];
            let bears = contact.mask.and(zero.less(load));
            loads += bears.select(load, zero);
            many += bears.select(one, zero);
        }
        for contact in &self.contacts {
            let (row, load) = (contact.row, self.warm_start[contact.slot][0]);
            let share =
                loads / many.max(one) / load.max(loads * (1.0 / MAX_LOAD_RATIO)).max(zero.like(f64::MIN_POSITIVE));
            let share =
                zero.less(loads).select(share.clamp(zero.like(MAX_LOAD_RATIO.recip()), zero.like(MAX_LOAD_RATIO)), one);
            for k in 0..3 {
                g.free[row + k] = contact.mask.and(zero.less(load));
                self.impulses[row + k] = zero;
                let own = self.delassus[(row + k) * rows + row + k];
                g.regularisation[row + k] = if k == 0 {
                    contact.law.softness + own * REGULARISATION
                } else {
                    own * share * TANGENTIAL_REGULARISATION
                };
            }
            g.target[row] = contact.law.target;
        }
    }

    /// The factor UᵀU of the free rows' Delassus matrix (A.-L. Cholesky), with reciprocals on its diagonal. Sums are
    /// accumulated row by row, so that rows of other candidates change no bit.
    #[inline(always)]
    fn factorise(&mut self) {
        let (rows, zero, g) = (self.rows(), Lanes::zero(self.simd), &mut self.guess);
        let one = zero.like(1.0);
        for i in 0..rows {
            for j in i + 1..rows {
                let both = g.free[i].and(g.free[j]);
                g.factor[i * rows + j] = both.select(self.delassus[i * rows + j], zero);
            }
            g.factor[i * rows + i] = g.free[i].select(self.delassus[i * rows + i] + g.regularisation[i], one);
        }
        for k in 0..rows {
            let (above, below) = g.factor.split_at_mut((k + 1) * rows);
            let own = &mut above[k * rows..];
            let pivot = own[k].sqrt().recip();
            own[k] = pivot;
            for entry in &mut own[k + 1..] {
                *entry = *entry * pivot;
            }
            for i in k + 1..rows {
                let (share, row) = (own[i], (i - k - 1) * rows);
                for (entry, &other) in below[row + i..row + rows].iter_mut().zip(&own[i..]) {
                    *entry = entry.sub_product(share, other);
                }
            }
        }
    }

    /// Solves for the impulses of the free rows, and computes the speeds with all impulses.
    #[inline(always)]
    fn solve(&mut self) {
        let (rows, zero, g) = (self.rows(), Lanes::zero(self.simd), &mut self.guess);
        for i in 0..rows {
            let mut missing = g.target[i] - g.free_speeds[i];
            for &Single { row, .. } in &self.singles {
                missing -= g.free[row].select(zero, self.delassus[i * rows + row] * self.impulses[row]);
            }
            g.solution[i] = g.free[i].select(missing, zero);
        }
        for i in 0..rows {
            let own = g.solution[i] * g.factor[i * rows + i];
            g.solution[i] = own;
            for (other, &entry) in g.solution[i + 1..rows].iter_mut().zip(&g.factor[i * rows + i + 1..]) {
                *other = other.sub_product(entry, own);
            }
        }
        for i in (0..rows).rev() {
            let own = g.solution[i] * g.factor[i * rows + i];
            for j in 0..i {
                g.solution[j] = g.solution[j].sub_product(g.factor[j * rows + i], own);
            }
            self.impulses[i] = g.free[i].select(own, self.impulses[i]);
        }
        self.speeds.copy_from_slice(&g.free_speeds);
        for (i, &impulse) in self.impulses.iter().enumerate() {
            for (speed, &response) in self.speeds.iter_mut().zip(&self.delassus[i * rows..(i + 1) * rows]) {
                *speed = speed.add_product(response, impulse);
            }
        }
    }

    /// Corrects the active set: releases contacts that pull, activates those that penetrate, and likewise for joints.
    /// Returns the candidates whose guess was wrong.
    #[inline(always)]
    fn correct(&mut self) -> Mask<S> {
        let (zero, g) = (Lanes::zero(self.simd), &mut self.guess);
        let tolerance = zero.like(TOLERANCE);
        let mut wrong = zero.less(zero);
        for contact in &self.contacts {
            let (row, free) = (contact.row, g.free[contact.row]);
            let pulls = free.and(self.impulses[row].less(zero));
            let sinks = contact.mask.and(free.not()).and(self.speeds[row].less(contact.law.target - tolerance));
            wrong = wrong.or(pulls).or(sinks);
            for k in 0..3 {
                g.free[row + k] = free.and(pulls.not()).or(sinks);
                self.impulses[row + k] = pulls.select(zero, self.impulses[row + k]);
            }
        }
        for &Single { row, law, .. } in &self.singles {
            let (free, impulse, BoundedRow { lower, upper, .. }) = (g.free[row], self.impulses[row], law);
            let target = law.target - law.softness * impulse;
            let beyond = free.and(impulse.less(lower).or(upper.less(impulse)));
            let behind = self.speeds[row].less(target - tolerance).and(impulse.less(upper));
            let ahead = (target + tolerance).less(self.speeds[row]).and(lower.less(impulse));
            let release = free.not().and(behind.or(ahead));
            wrong = wrong.or(beyond).or(release);
            g.free[row] = free.and(beyond.not()).or(release);
            self.impulses[row] = beyond.select(impulse.clamp(lower, upper), impulse);
        }
        wrong
    }

    /// Candidates with a contact outside its friction cone.
    #[inline(always)]
    fn slides(&self) -> Mask<S> {
        let zero = Lanes::zero(self.simd);
        let mut slides = zero.less(zero);
        for contact in &self.contacts {
            let row = contact.row;
            let [normal, a, b] = [self.impulses[row], self.impulses[row + 1], self.impulses[row + 2]];
            let limit = contact.law.friction * normal * (1.0 + TOLERANCE);
            slides = slides.or((limit * limit).less(a * a + b * b));
        }
        slides
    }
}
