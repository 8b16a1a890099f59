//! Assembly of the rows: bounded joints, coupled joints, and contacts.

use super::rows::{Contact, ContactLaw, ImpulseBlock, Impulses, Single};
use crate::engine::articulated::contacts::ContactPoint;
use crate::engine::articulated::linear_algebra::lanes::{Lanes, Mask};
use crate::engine::articulated::linear_algebra::spatial::{Spatial, solve_motions, solve_way};
use crate::engine::articulated::tree::Tree;
use pulp::Simd;

impl<S: Simd> Impulses<S> {
    /// Adds a row that drives a joint to the velocity `target` with an impulse between `lower` and `upper`.
    #[inline(always)]
    pub(in crate::engine::articulated) fn hold(
        &mut self,
        dof: usize,
        [wanted, least, most]: [Lanes<S>; 3],
        tree: &Tree<S>,
        factor: &[Lanes<S>],
        u: &[Lanes<S>],
    ) {
        let (way, begin) = (&tree.ways[dof], self.halves.len());
        for &d in way {
            self.halves.push(Lanes::all(self.simd, if d == dof { 1.0 } else { 0.0 }));
        }
        solve_way(factor, tree.freedom(), way, &mut self.halves[begin..]);
        self.single([Some((dof, begin)), None], [wanted, least, most], u[dof]);
    }

    /// Adds a row that couples a degree of freedom to another one: velocity = ratio·leader + target, with an unbounded
    /// impulse.
    #[inline(always)]
    pub(in crate::engine::articulated) fn couple(
        &mut self,
        [dof, leader]: [usize; 2],
        [ratio, wanted]: [Lanes<S>; 2],
        tree: &Tree<S>,
        factor: &[Lanes<S>],
        u: &[Lanes<S>],
    ) {
        let (zero, one) = (Lanes::zero(self.simd), Lanes::all(self.simd, 1.0));
        let mut ways = [None; 2];
        for (way, (last, along)) in ways.iter_mut().zip([(dof, one), (leader, -ratio)]) {
            let (all, begin) = (&tree.ways[last], self.halves.len());
            self.halves.extend(all.iter().map(|&d| if d == last { along } else { zero }));
            solve_way(factor, tree.freedom(), all, &mut self.halves[begin..]);
            *way = Some((last, begin));
        }
        let endless = one * f64::INFINITY;
        self.single(ways, [wanted, -endless, endless], u[dof] - ratio * u[leader]);
        self.couples += 1;
    }

    #[inline(always)]
    fn single(&mut self, ways: [Option<(usize, usize)>; 2], [wanted, least, most]: [Lanes<S>; 3], speed: Lanes<S>) {
        let row = self.rows();
        self.singles.push(Single { row, wanted, least, most, stubborn: Lanes::zero(self.simd) });
        self.blocks.push(ImpulseBlock { row, rows: 1, ways });
        self.speeds.push(speed);
    }

    /// Adds the three rows of a contact.
    #[inline(always)]
    pub(in crate::engine::articulated) fn touch(
        &mut self,
        touch: &ContactPoint<S>,
        law: ContactLaw<S>,
        there: Mask<S>,
        tree: &Tree<S>,
        factor: &[Lanes<S>],
        motions: &[Spatial<S>],
    ) {
        let (row, zero, one) = (self.rows(), Lanes::zero(self.simd), Lanes::all(self.simd, 1.0));
        let mut ways = [Some(self.aim(touch, touch.body, one, tree, factor)), None];
        if let Some(other) = touch.other {
            ways[1] = Some(self.aim(touch, other, -one, tree, factor));
        }
        let speeds = touch.along(self.simd, &touch.apart(motions));
        self.blocks.push(ImpulseBlock { row, rows: 3, ways });
        self.speeds.extend_from_slice(&speeds);
        self.contacts.push(Contact { row, slot: touch.slot, law, there, stubborn: zero, stubborn_across: zero });
    }

    /// Adds the rows' entries along the path to a body, for unit impulses on it along the normal and the tangents, with
    /// this sign. Returns the path's last degree of freedom and the offset of the entries.
    #[inline(always)]
    fn aim(
        &mut self,
        touch: &ContactPoint<S>,
        body: usize,
        sense: Lanes<S>,
        tree: &Tree<S>,
        factor: &[Lanes<S>],
    ) -> (usize, usize) {
        let (way, begin, basis) = (tree.way_to(body), self.halves.len(), self.solved(body, tree, factor));
        self.halves.resize(begin + 3 * way.len(), sense);
        for step in 0..way.len() {
            let along = touch.along(self.simd, &self.bases[basis + step].at(&touch.point));
            for k in 0..3 {
                self.halves[begin + 3 * step + k] = along[k] * sense;
            }
        }
        (way[way.len() - 1], begin)
    }

    /// Offset of a body's half Jacobians for unit forces and moments: an entry for each degree of freedom of the path
    /// to it.
    #[inline(always)]
    fn solved(&mut self, body: usize, tree: &Tree<S>, factor: &[Lanes<S>]) -> usize {
        for k in 0..self.pushed.len() {
            if self.pushed[k].0 == body {
                return self.pushed[k].1;
            }
        }
        let (way, begin) = (tree.way_to(body), self.bases.len());
        for &d in way {
            self.bases.push(tree.axes[d]);
        }
        solve_motions(factor, tree.freedom(), way, &mut self.bases[begin..]);
        self.pushed.push((body, begin));
        begin
    }
}
