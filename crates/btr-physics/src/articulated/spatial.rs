//! Spatial quantities in the world's axes about one point, and the linear algebra of a tree's inertia matrix.

use nalgebra::{Matrix3, Vector3};

/// A motion or a force in Pluecker coordinates about one point: angular part (moment), linear part (force).
#[derive(Clone, Copy, Debug)]
pub(super) struct Spatial {
    pub(super) angular: Vector3<f64>,
    pub(super) linear: Vector3<f64>,
}

/// A rigid body's inertia about the same point.
#[derive(Clone, Copy)]
pub(super) struct Inertia {
    pub(super) mass: f64,
    pub(super) first: Vector3<f64>,
    pub(super) second: Matrix3<f64>,
}

impl Spatial {
    pub(super) const ZERO: Spatial =
        Spatial { angular: Vector3::new(0.0, 0.0, 0.0), linear: Vector3::new(0.0, 0.0, 0.0) };

    pub(super) fn dot(&self, other: &Spatial) -> f64 {
        self.angular.dot(&other.angular) + self.linear.dot(&other.linear)
    }

    /// How a motion that is fixed to a body changes as the body moves with `self`.
    pub(super) fn cross_motion(&self, motion: &Spatial) -> Spatial {
        Spatial {
            angular: self.angular.cross(&motion.angular),
            linear: self.angular.cross(&motion.linear) + self.linear.cross(&motion.angular),
        }
    }

    /// The same for a momentum.
    pub(super) fn cross_force(&self, force: &Spatial) -> Spatial {
        Spatial {
            angular: self.angular.cross(&force.angular) + self.linear.cross(&force.linear),
            linear: self.angular.cross(&force.linear),
        }
    }
}

impl std::ops::Add for Spatial {
    type Output = Spatial;
    fn add(self, other: Spatial) -> Spatial {
        Spatial { angular: self.angular + other.angular, linear: self.linear + other.linear }
    }
}

impl std::ops::Mul<f64> for Spatial {
    type Output = Spatial;
    fn mul(self, factor: f64) -> Spatial {
        Spatial { angular: self.angular * factor, linear: self.linear * factor }
    }
}

impl Inertia {
    /// Momentum of a motion, or the force for an acceleration.
    pub(super) fn times(&self, motion: &Spatial) -> Spatial {
        Spatial {
            angular: self.second * motion.angular + self.first.cross(&motion.linear),
            linear: motion.linear * self.mass + motion.angular.cross(&self.first),
        }
    }

    pub(super) fn plus(&self, other: &Inertia) -> Inertia {
        Inertia { mass: self.mass + other.mass, first: self.first + other.first, second: self.second + other.second }
    }
}

/// The factor L of a symmetric matrix LᵀL, in place, in the lower triangle (Featherstone 2008, table 6.3). `above` is the tree
/// that leaves the matrix empty wherever neither of two moves the other; the factor is empty there, too. Its diagonal holds the
/// reciprocals, which is all that is ever asked for.
pub(super) fn factorise(matrix: &mut [f64], above: &[Option<usize>]) {
    let n = above.len();
    for k in (0..n).rev() {
        // A body without any inertia makes this NaN, which is noticed as trouble.
        let pivot = matrix[k * n + k].sqrt().recip();
        matrix[k * n + k] = pivot;
        let mut at = above[k];
        while let Some(i) = at {
            matrix[k * n + i] *= pivot;
            at = above[i];
        }
        at = above[k];
        while let Some(i) = at {
            let share = matrix[k * n + i];
            let mut other = at;
            while let Some(j) = other {
                matrix[i * n + j] -= share * matrix[k * n + j];
                other = above[j];
            }
            at = above[i];
        }
    }
}

/// Solves LᵀL·x = b, in place.
pub(super) fn solve(factor: &[f64], above: &[Option<usize>], x: &mut [f64]) {
    for i in (0..above.len()).rev() {
        eliminate(factor, above, i, x);
    }
    substitute(factor, above, x);
}

/// Solves Lᵀ·x = b where b only is something on the way from `last` to the root, in place.
pub(super) fn solve_way(factor: &[f64], above: &[Option<usize>], last: usize, x: &mut [f64]) {
    let mut at = Some(last);
    while let Some(i) = at {
        eliminate(factor, above, i, x);
        at = above[i];
    }
}

fn eliminate(factor: &[f64], above: &[Option<usize>], i: usize, x: &mut [f64]) {
    let n = above.len();
    x[i] *= factor[i * n + i];
    let mut at = above[i];
    while let Some(j) = at {
        x[j] -= factor[i * n + j] * x[i];
        at = above[j];
    }
}

/// Solves L·x = b, in place.
pub(super) fn substitute(factor: &[f64], above: &[Option<usize>], x: &mut [f64]) {
    let n = above.len();
    for i in 0..n {
        let mut at = above[i];
        while let Some(j) = at {
            x[i] -= factor[i * n + j] * x[j];
            at = above[j];
        }
        x[i] *= factor[i * n + i];
    }
}

/// The force of a push in `direction` at `point`.
pub(super) fn push(point: &Vector3<f64>, direction: &Vector3<f64>) -> Spatial {
    Spatial { angular: point.cross(direction), linear: *direction }
}
