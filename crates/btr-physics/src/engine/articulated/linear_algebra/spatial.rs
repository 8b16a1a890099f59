//! Spatial quantities in the world's axes about one point, and the linear algebra of a tree's inertia matrix.

use super::lanes::Lanes;
use super::vectors::{M3, V3};
use pulp::Simd;

/// A motion or a force in Pluecker coordinates about one point: angular part (moment), linear part (force).
#[derive(Clone, Copy)]
pub(in crate::engine::articulated) struct Spatial<S: Simd> {
    pub(in crate::engine::articulated) angular: V3<S>,
    pub(in crate::engine::articulated) linear: V3<S>,
}

/// A rigid body's inertia about the same point.
#[derive(Clone, Copy)]
pub(in crate::engine::articulated) struct Inertia<S: Simd> {
    pub(in crate::engine::articulated) mass: Lanes<S>,
    pub(in crate::engine::articulated) first: V3<S>,
    pub(in crate::engine::articulated) second: Symmetric<S>,
}

/// A symmetric matrix: the diagonal, then xy, xz and yz.
#[derive(Clone, Copy)]
pub(in crate::engine::articulated) struct Symmetric<S: Simd>(pub(in crate::engine::articulated) [Lanes<S>; 6]);

impl<S: Simd> Spatial<S> {
    #[inline(always)]
    pub(in crate::engine::articulated) fn zero(simd: S) -> Self {
        Spatial { angular: V3::zero(simd), linear: V3::zero(simd) }
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn dot(&self, other: &Self) -> Lanes<S> {
        self.angular.dot(&other.angular) + self.linear.dot(&other.linear)
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn plus(&self, other: &Self) -> Self {
        Spatial { angular: self.angular + other.angular, linear: self.linear + other.linear }
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn times(&self, factor: Lanes<S>) -> Self {
        Spatial { angular: self.angular.times(factor), linear: self.linear.times(factor) }
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn add_times(&self, other: &Self, factor: Lanes<S>) -> Self {
        let mut sum = *self;
        for k in 0..3 {
            sum.angular.0[k] = sum.angular.0[k].add_product(other.angular.0[k], factor);
            sum.linear.0[k] = sum.linear.0[k].add_product(other.linear.0[k], factor);
        }
        sum
    }

    /// Velocity of a point under this motion.
    #[inline(always)]
    pub(in crate::engine::articulated) fn at(&self, point: &V3<S>) -> V3<S> {
        self.linear + self.angular.cross(point)
    }

    /// Spatial cross product with a motion: rate of change of a motion that is fixed to a body moving with `self`.
    #[inline(always)]
    pub(in crate::engine::articulated) fn cross_motion(&self, motion: &Self) -> Self {
        Spatial {
            angular: self.angular.cross(&motion.angular),
            linear: self.angular.cross(&motion.linear) + self.linear.cross(&motion.angular),
        }
    }

    /// Spatial cross product with a force or a momentum.
    #[inline(always)]
    pub(in crate::engine::articulated) fn cross_force(&self, force: &Self) -> Self {
        Spatial {
            angular: self.angular.cross(&force.angular) + self.linear.cross(&force.linear),
            linear: self.angular.cross(&force.linear),
        }
    }
}

impl<S: Simd> Symmetric<S> {
    #[inline(always)]
    pub(in crate::engine::articulated) fn zero(simd: S) -> Self {
        Symmetric([Lanes::zero(simd); 6])
    }

    /// The matrix in axes rotated by `rotation`.
    #[inline(always)]
    pub(in crate::engine::articulated) fn rotated(&self, rotation: &M3<S>) -> Self {
        let [xx, yy, zz, xy, xz, yz] = self.0;
        let own = M3([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]);
        let half = rotation.product(&own);
        let entry = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
        let mut rotated = self.0;
        for k in 0..6 {
            rotated[k] = half.row(entry[k].0).dot(&rotation.row(entry[k].1));
        }
        Symmetric(rotated)
    }

    /// Inertia of a point mass at `place` about the origin.
    #[inline(always)]
    pub(in crate::engine::articulated) fn of_point(mass: Lanes<S>, place: &V3<S>) -> Self {
        let [x, y, z] = place.0;
        let [mx, my, mz] = place.times(mass).0;
        Symmetric([my * y + mz * z, mx * x + mz * z, mx * x + my * y, -(mx * y), -(mx * z), -(my * z)])
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn plus(&self, other: &Self) -> Self {
        let mut sum = self.0;
        for k in 0..6 {
            sum[k] += other.0[k];
        }
        Symmetric(sum)
    }

    #[inline(always)]
    fn transform(&self, v: &V3<S>) -> V3<S> {
        let [xx, yy, zz, xy, xz, yz] = self.0;
        V3([V3([xx, xy, xz]).dot(v), V3([xy, yy, yz]).dot(v), V3([xz, yz, zz]).dot(v)])
    }
}

impl<S: Simd> Inertia<S> {
    /// Momentum of a motion, or force of an acceleration.
    #[inline(always)]
    pub(in crate::engine::articulated) fn times(&self, motion: &Spatial<S>) -> Spatial<S> {
        Spatial {
            angular: self.second.transform(&motion.angular) + self.first.cross(&motion.linear),
            linear: motion.linear.times(self.mass) + motion.angular.cross(&self.first),
        }
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn plus(&self, other: &Self) -> Self {
        Inertia {
            mass: self.mass + other.mass,
            first: self.first + other.first,
            second: self.second.plus(&other.second),
        }
    }
}

/// The factor L of a symmetric matrix LᵀL, in place, in the lower triangle (Featherstone 2008, table 6.3). `paths` has
/// the path from the root to each degree of freedom, itself last. The matrix has no entries for degrees of freedom on
/// different branches, and neither has the factor. Its diagonal holds the reciprocals, which is all that is needed of
/// it.
#[inline(always)]
pub(in crate::engine::articulated) fn factorise<S: Simd>(matrix: &mut [Lanes<S>], paths: &[Vec<usize>]) {
    let n = paths.len();
    for k in (0..n).rev() {
        // A body without inertia makes this NaN, which [`Dynamics::trouble`](crate::engine::Dynamics::trouble) reports.
        let pivot = matrix[k * n + k].sqrt().recip();
        matrix[k * n + k] = pivot;
        let above = &paths[k][..paths[k].len() - 1];
        for &i in above {
            matrix[k * n + i] = matrix[k * n + i] * pivot;
        }
        for (steps, &i) in above.iter().enumerate() {
            let share = matrix[k * n + i];
            for &j in &above[..=steps] {
                matrix[i * n + j] = matrix[i * n + j].sub_product(share, matrix[k * n + j]);
            }
        }
    }
}

/// Solves LᵀL·x = b, in place.
#[inline(always)]
pub(in crate::engine::articulated) fn solve<S: Simd>(factor: &[Lanes<S>], paths: &[Vec<usize>], x: &mut [Lanes<S>]) {
    let n = paths.len();
    for i in (0..n).rev() {
        let own = x[i] * factor[i * n + i];
        x[i] = own;
        for &j in &paths[i][..paths[i].len() - 1] {
            x[j] = x[j].sub_product(factor[i * n + j], own);
        }
    }
    substitute(factor, paths, x);
}

/// Solves Lᵀ·x = b in place, where b is nonzero only on the path from the root to one degree of freedom; `x` has an
/// entry for each step of the path.
#[inline(always)]
pub(in crate::engine::articulated) fn solve_path<S: Simd>(
    factor: &[Lanes<S>],
    n: usize,
    path: &[usize],
    x: &mut [Lanes<S>],
) {
    for step in (0..path.len()).rev() {
        let row = path[step] * n;
        let own = x[step] * factor[row + path[step]];
        x[step] = own;
        for (x, &j) in x[..step].iter_mut().zip(path) {
            *x = x.sub_product(factor[row + j], own);
        }
    }
}

/// The same for six right-hand sides at once.
#[inline(always)]
pub(in crate::engine::articulated) fn solve_motions<S: Simd>(
    factor: &[Lanes<S>],
    n: usize,
    path: &[usize],
    x: &mut [Spatial<S>],
) {
    for step in (0..path.len()).rev() {
        let row = path[step] * n;
        let own = x[step].times(factor[row + path[step]]);
        x[step] = own;
        for (x, &j) in x[..step].iter_mut().zip(path) {
            *x = x.add_times(&own, -factor[row + j]);
        }
    }
}

/// Solves L·x = b, in place.
#[inline(always)]
pub(in crate::engine::articulated) fn substitute<S: Simd>(
    factor: &[Lanes<S>],
    paths: &[Vec<usize>],
    x: &mut [Lanes<S>],
) {
    let n = paths.len();
    for i in 0..n {
        let mut own = x[i];
        for &j in &paths[i][..paths[i].len() - 1] {
            own = own.sub_product(factor[i * n + j], x[j]);
        }
        x[i] = own * factor[i * n + i];
    }
}
