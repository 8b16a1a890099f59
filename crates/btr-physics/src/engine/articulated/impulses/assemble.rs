//! Assembly of the rows: bounded joints, coupled joints, and contacts.

use super::rows::{BoundedRow, Contact, ContactLaw, ImpulseBlock, Impulses, Single};
use crate::engine::articulated::contacts::ContactPoint;
use crate::engine::articulated::linear_algebra::lanes::{Lanes, Mask};
use crate::engine::articulated::linear_algebra::spatial::{Spatial, solve_motions, solve_path};
use crate::engine::articulated::tree::Tree;
use pulp::Simd;

impl<S: Simd> Impulses<S> {
    /// Adds a row on one joint.
    #[inline(always)]
    pub(in crate::engine::articulated) fn add_bounded(
        &mut self,
        dof: usize,
        law: BoundedRow<S>,
        tree: &Tree<S>,
        factor: &[Lanes<S>],
        u: &[Lanes<S>],
    ) {
        let (path, offset) = (&tree.paths[dof], self.half_jacobians.len());
        for &d in path {
            self.half_jacobians.push(Lanes::splat(self.simd, if d == dof { 1.0 } else { 0.0 }));
        }
        solve_path(factor, tree.freedom(), path, &mut self.half_jacobians[offset..]);
        self.add_single([Some((dof, offset)), None], law, u[dof]);
    }

    /// Adds a row that couples a degree of freedom to another one: velocity = ratio·leader + target, with an unbounded
    /// impulse.
    #[inline(always)]
    pub(in crate::engine::articulated) fn add_coupling(
        &mut self,
        [dof, leader]: [usize; 2],
        [ratio, target]: [Lanes<S>; 2],
        tree: &Tree<S>,
        factor: &[Lanes<S>],
        u: &[Lanes<S>],
    ) {
        let (zero, one) = (Lanes::zero(self.simd), Lanes::splat(self.simd, 1.0));
        let mut paths = [None; 2];
        for (path, (last, along)) in paths.iter_mut().zip([(dof, one), (leader, -ratio)]) {
            let (all, offset) = (&tree.paths[last], self.half_jacobians.len());
            self.half_jacobians.extend(all.iter().map(|&d| if d == last { along } else { zero }));
            solve_path(factor, tree.freedom(), all, &mut self.half_jacobians[offset..]);
            *path = Some((last, offset));
        }
        let unbounded = one * f64::INFINITY;
        let law = BoundedRow { target, softness: zero, lower: -unbounded, upper: unbounded };
        self.add_single(paths, law, u[dof] - ratio * u[leader]);
        self.couplings += 1;
    }

    #[inline(always)]
    fn add_single(&mut self, paths: [Option<(usize, usize)>; 2], law: BoundedRow<S>, speed: Lanes<S>) {
        let row = self.rows();
        self.singles.push(Single { row, law, effective_mass: Lanes::zero(self.simd) });
        self.blocks.push(ImpulseBlock { row, rows: 1, paths });
        self.speeds.push(speed);
    }

    /// Adds the three rows of a contact.
    #[inline(always)]
    pub(in crate::engine::articulated) fn add_contact(
        &mut self,
        contact: &ContactPoint<S>,
        law: ContactLaw<S>,
        mask: Mask<S>,
        tree: &Tree<S>,
        factor: &[Lanes<S>],
        motions: &[Spatial<S>],
    ) {
        let (row, zero, one) = (self.rows(), Lanes::zero(self.simd), Lanes::splat(self.simd, 1.0));
        let mut paths = [Some(self.add_jacobian(contact, contact.body, one, tree, factor)), None];
        if let Some(other) = contact.other {
            paths[1] = Some(self.add_jacobian(contact, other, -one, tree, factor));
        }
        let speeds = contact.in_contact_frame(self.simd, &contact.relative_velocity(motions));
        self.blocks.push(ImpulseBlock { row, rows: 3, paths });
        self.speeds.extend_from_slice(&speeds);
        self.contacts.push(Contact { row, slot: contact.slot, law, mask, effective_mass: zero, tangential_mass: zero });
    }

    /// Adds the rows' entries along the path to a body, for unit impulses on it along the normal and the tangents, with
    /// this sign. Returns the path's last degree of freedom and the offset of the entries.
    #[inline(always)]
    fn add_jacobian(
        &mut self,
        contact: &ContactPoint<S>,
        body: usize,
        sense: Lanes<S>,
        tree: &Tree<S>,
        factor: &[Lanes<S>],
    ) -> (usize, usize) {
        let (path, offset, basis) =
            (tree.path_to(body), self.half_jacobians.len(), self.body_bases(body, tree, factor));
        self.half_jacobians.resize(offset + 3 * path.len(), sense);
        for step in 0..path.len() {
            let along = contact.in_contact_frame(self.simd, &self.bases[basis + step].at(&contact.point));
            for k in 0..3 {
                self.half_jacobians[offset + 3 * step + k] = along[k] * sense;
            }
        }
        (path[path.len() - 1], offset)
    }

    /// Offset of a body's half Jacobians for unit forces and moments: an entry for each degree of freedom of the path
    /// to it.
    #[inline(always)]
    fn body_bases(&mut self, body: usize, tree: &Tree<S>, factor: &[Lanes<S>]) -> usize {
        for k in 0..self.pushed.len() {
            if self.pushed[k].0 == body {
                return self.pushed[k].1;
            }
        }
        let (path, offset) = (tree.path_to(body), self.bases.len());
        for &d in path {
            self.bases.push(tree.axes[d]);
        }
        solve_motions(factor, tree.freedom(), path, &mut self.bases[offset..]);
        self.pushed.push((body, offset));
        offset
    }
}
