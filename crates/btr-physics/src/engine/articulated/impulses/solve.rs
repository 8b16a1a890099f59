//! The Delassus matrix, and the change of velocities by the impulses.

use super::rows::{ImpulseBlock, Impulses};
use crate::engine::articulated::linear_algebra::lanes::Lanes;
use crate::engine::articulated::linear_algebra::spatial::substitute;
use crate::engine::articulated::tree::Tree;
use pulp::Simd;

impl<S: Simd> Impulses<S> {
    /// Solves for the impulses and applies them to the velocities.
    #[inline(always)]
    pub(in crate::engine::articulated) fn apply(&mut self, tree: &Tree<S>, factor: &[Lanes<S>], u: &mut [Lanes<S>]) {
        let zero = Lanes::zero(self.simd);
        if self.blocks.is_empty() {
            self.found.fill([zero; 3]);
            self.found_hard = zero.less(zero);
            return;
        }
        self.fill_delassus(tree);
        // Couplings make Gauss-Seidel converge slowly, too.
        let all = zero.less_or_equal(zero);
        let hard = if self.couplings > 0 { all } else { self.hard.and(self.touching()) };
        let stuck = if hard.any() { self.stick(hard) } else { hard };
        self.start_sweeps(stuck, hard);
        self.found_hard = stuck.or(self.sweep_until_settled(stuck.not(), u));
        self.found.fill([zero; 3]);
        for contact in &self.contacts {
            for k in 0..3 {
                self.found[contact.slot][k] = self.impulses[contact.row + k];
            }
        }
        self.change.clear();
        self.change.resize(u.len(), zero);
        for block in 0..self.blocks.len() {
            match self.blocks[block].rows {
                3 => self.accumulate::<3>(block, tree),
                _ => self.accumulate::<1>(block, tree),
            }
        }
        substitute(factor, &tree.paths, &mut self.change);
        for (u, change) in u.iter_mut().zip(&self.change) {
            *u += *change;
        }
    }

    /// Accepts the impulses of the step. A step that is solved again before that has the same warm start.
    #[inline(always)]
    pub(in crate::engine::articulated) fn accept(&mut self) {
        std::mem::swap(&mut self.warm_start, &mut self.found);
        self.hard = self.found_hard;
    }

    /// The normal impulse of the last step at a contact slot, in N·s.
    #[inline(always)]
    pub(in crate::engine::articulated) fn normal(&self, slot: usize) -> Lanes<S> {
        self.warm_start[slot][0]
    }

    /// Adds a block's impulses, in generalized coordinates, to the change.
    #[inline(always)]
    fn accumulate<const ROWS: usize>(&mut self, block: usize, tree: &Tree<S>) {
        let ImpulseBlock { row, paths, .. } = self.blocks[block];
        for &(last, offset) in paths.iter().flatten() {
            for (step, &d) in tree.paths[last].iter().enumerate() {
                for k in 0..ROWS {
                    let half = self.half_jacobians[offset + step * ROWS + k];
                    self.change[d] = self.change[d].add_product(half, self.impulses[row + k]);
                }
            }
        }
    }

    /// Fills the Delassus matrix and the effective masses.
    #[inline(always)]
    fn fill_delassus(&mut self, tree: &Tree<S>) {
        let (rows, zero) = (self.rows(), Lanes::zero(self.simd));
        // All entries that are read are written first.
        self.delassus.resize(self.delassus.len().max(rows * rows), zero);
        for i in 0..self.blocks.len() {
            for j in 0..=i {
                match (self.blocks[i].rows, self.blocks[j].rows) {
                    (3, 3) => self.fill_block::<3, 3>(i, j, tree),
                    (3, _) => self.fill_block::<3, 1>(i, j, tree),
                    (_, 3) => self.fill_block::<1, 3>(i, j, tree),
                    _ => self.fill_block::<1, 1>(i, j, tree),
                }
            }
        }
        self.impulses.clear();
        self.impulses.resize(rows, zero);
        for single in &mut self.singles {
            single.effective_mass = (self.delassus[single.row * rows + single.row] + single.law.softness).recip();
        }
        for contact in &mut self.contacts {
            let row = contact.row;
            let (a, b, c) = (
                self.delassus[(row + 1) * rows + row + 1],
                self.delassus[(row + 1) * rows + row + 2],
                self.delassus[(row + 2) * rows + row + 2],
            );
            contact.effective_mass = (self.delassus[row * rows + row] + contact.law.softness).recip();
            let apart = ((a - c) * (a - c) * 0.25 + b * b).sqrt();
            contact.tangential_mass = ((a + c) * 0.5 + apart).recip();
        }
    }

    /// Fills the entries of two blocks.
    #[inline(always)]
    fn fill_block<const OWN: usize, const OTHERS: usize>(&mut self, i: usize, j: usize, tree: &Tree<S>) {
        let (rows, one, other) = (self.rows(), self.blocks[i], self.blocks[j]);
        let mut sums = [[Lanes::zero(self.simd); OTHERS]; OWN];
        for &(a, own) in one.paths.iter().flatten() {
            for &(b, others) in other.paths.iter().flatten() {
                for step in 0..shared(&tree.paths[a], &tree.paths[b]) {
                    let own = &self.half_jacobians[own + step * OWN..][..OWN];
                    let others = &self.half_jacobians[others + step * OTHERS..][..OTHERS];
                    for k in 0..OWN {
                        for l in 0..OTHERS {
                            sums[k][l] = sums[k][l].add_product(own[k], others[l]);
                        }
                    }
                }
            }
        }
        for k in 0..OWN {
            for l in 0..OTHERS {
                self.delassus[(one.row + k) * rows + other.row + l] = sums[k][l];
                self.delassus[(other.row + l) * rows + one.row + k] = sums[k][l];
            }
        }
    }
}

/// Length of the common prefix of two paths from the root.
#[inline(always)]
fn shared(a: &[usize], b: &[usize]) -> usize {
    if a[a.len() - 1] == b[b.len() - 1] {
        return a.len();
    }
    let mut steps = 0;
    while steps < a.len() && steps < b.len() && a[steps] == b[steps] {
        steps += 1;
    }
    steps
}
