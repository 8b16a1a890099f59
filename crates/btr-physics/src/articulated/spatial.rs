//! Spatial quantities in the world's axes about the world's origin, and the linear algebra of a joint-space inertia matrix.

use nalgebra::{Matrix3, Vector3};

/// A motion or a force in Pluecker coordinates about the world's origin: angular part (moment), linear part (force).
#[derive(Clone, Copy, Debug)]
pub(super) struct Spatial {
    pub(super) angular: Vector3<f64>,
    pub(super) linear: Vector3<f64>,
}

/// A rigid body's inertia about the world's origin.
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

/// Cholesky's factor of a symmetric matrix, in place, in the lower triangle.
pub(super) fn factorise(matrix: &mut [f64], n: usize) {
    for i in 0..n {
        for j in 0..=i {
            let mut sum = matrix[i * n + j];
            for k in 0..j {
                sum -= matrix[i * n + k] * matrix[j * n + k];
            }
            // A body without any inertia makes this NaN, which is noticed as trouble.
            matrix[i * n + j] = if i == j { sum.sqrt() } else { sum / matrix[j * n + j] };
        }
    }
}

/// Solves with the factor, in place.
pub(super) fn solve(factor: &[f64], n: usize, x: &mut [f64]) {
    for i in 0..n {
        let mut sum = x[i];
        for k in 0..i {
            sum -= factor[i * n + k] * x[k];
        }
        x[i] = sum / factor[i * n + i];
    }
    for i in (0..n).rev() {
        let mut sum = x[i];
        for k in i + 1..n {
            sum -= factor[k * n + i] * x[k];
        }
        x[i] = sum / factor[i * n + i];
    }
}
