//! The pseudo-inertia of a body: the second moments of its mass in homogeneous coordinates. A body of positive mass
//! everywhere can have exactly those that are positive definite: P. M. Wensing, S. Kim and J.-J. E. Slotine, "Linear
//! matrix inequalities for physically consistent inertial parameter identification: a statistical perspective on the
//! mass distribution", IEEE Robotics and Automation Letters 3(1), 2018.

use super::{Inertials, PER_BODY};
use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};

/// Number of coordinates of a positive definite pseudo-inertia.
pub const LOG_CHOLESKY: usize = PER_BODY;

/// Smallest eigenvalue of a body's pseudo-inertia, in units in which the diagonal is 1.
const THIN: f64 = 1e-6;

/// ∫(x, 1)(x, 1)ᵀ dm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PseudoInertia(pub Matrix4<f64>);

impl From<&Inertials> for PseudoInertia {
    fn from(inertials: &Inertials) -> Self {
        let inertia = &inertials.inertia_kg_m2;
        let second = Matrix3::identity() * (0.5 * inertia.trace()) - inertia;
        let mut matrix = Matrix4::zeros();
        matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&second);
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&inertials.moment_kg_m);
        matrix.fixed_view_mut::<1, 3>(3, 0).copy_from(&inertials.moment_kg_m.transpose());
        matrix[(3, 3)] = inertials.mass_kg;
        PseudoInertia(matrix)
    }
}

impl From<&PseudoInertia> for Inertials {
    fn from(PseudoInertia(matrix): &PseudoInertia) -> Self {
        let second: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into();
        let moment_kg_m: Vector3<f64> = matrix.fixed_view::<3, 1>(0, 3).into();
        let inertia_kg_m2 = Matrix3::identity() * second.trace() - second;
        Inertials { mass_kg: matrix[(3, 3)], moment_kg_m, inertia_kg_m2 }
    }
}

impl PseudoInertia {
    /// Whether a body can have it.
    pub fn is_possible(&self) -> bool {
        self.0.cholesky().is_some()
    }

    /// This one if a body can have it. Otherwise one near it: every second moment at least that of `mass_kg` spread
    /// over `radius_m`, and then the nearest in units in which the diagonal is 1.
    #[must_use]
    pub fn made_possible(&self, mass_kg: f64, radius_m: f64) -> Self {
        let least = Vector3::repeat(mass_kg * radius_m * radius_m).push(mass_kg);
        let mut raised = self.0;
        (0..4).for_each(|k| raised[(k, k)] = raised[(k, k)].max(least[k]));
        let units = raised.diagonal().map(f64::sqrt);
        let (scale, back) = (Matrix4::from_diagonal(&units.map(f64::recip)), Matrix4::from_diagonal(&units));
        let eigen = (scale * raised * scale).symmetric_eigen();
        let values = Matrix4::from_diagonal(&eigen.eigenvalues.map(|value| value.max(THIN)));
        let nearest = back * eigen.eigenvectors * values * eigen.eigenvectors.transpose() * back;
        if self.is_possible() { *self } else { PseudoInertia(0.5 * (nearest + nearest.transpose())) }
    }

    /// A factor U with positive diagonal and nothing below it, so that this is U·Uᵀ; `None` where no body can have it.
    fn upper_factor(&self) -> Option<Matrix4<f64>> {
        // The lower factor of the matrix read backwards.
        let reversed = Matrix4::from_fn(|i, j| self.0[(3 - i, 3 - j)]);
        let lower = reversed.cholesky()?.l();
        Some(Matrix4::from_fn(|i, j| lower[(3 - i, 3 - j)]))
    }

    /// This one after a change by coordinates of which each value is possible: 0 is no change, and ±1 one of the order
    /// of the body itself. With its upper factor U it is U·C·(U·C)ᵀ, C the upper triangular matrix with exponentials on
    /// its diagonal: C. Rucker and P. M. Wensing, "Smooth parameterization of rigid-body inertia", IEEE Robotics and
    /// Automation Letters 7(2), 2022, relative to this body. `None` where no body can have this one.
    pub fn changed(&self, by: &[f64; LOG_CHOLESKY]) -> Option<Self> {
        let [whole, d1, d2, d3, s12, s23, s13, t1, t2, t3] = *by;
        let diagonal = Vector4::new(d1.exp(), d2.exp(), d3.exp(), 1.0);
        let mut change = Matrix4::from_diagonal(&diagonal);
        let beside = [((0, 1), s12), ((1, 2), s23), ((0, 2), s13), ((0, 3), t1), ((1, 3), t2), ((2, 3), t3)];
        beside.iter().for_each(|(at, value)| change[*at] = *value);
        let factor = self.upper_factor()? * change * whole.exp();
        Some(PseudoInertia(factor * factor.transpose()))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use nalgebra::{Point3, UnitQuaternion};
    use proptest::prelude::*;

    fn body() -> Inertials {
        let turned = UnitQuaternion::from_euler_angles(0.3, -0.8, 1.1).to_rotation_matrix();
        let central = turned * Matrix3::from_diagonal(&Vector3::new(0.02, 0.05, 0.06)) * turned.transpose();
        Inertials::of(2.5, &Point3::new(0.1, -0.2, 0.3), &central)
    }

    #[test]
    fn inertials_and_pseudo_inertia_say_the_same() {
        let again = Inertials::from(&PseudoInertia::from(&body()));
        let close = |(a, b): (f64, f64)| (a - b).abs() < 1e-12;
        assert!(body().to_array().into_iter().zip(again.to_array()).all(close));
        assert_eq!(Inertials::from_array(body().to_array()), body());
        assert!((body().com_m() - Point3::new(0.1, -0.2, 0.3)).norm() < 1e-12);
    }

    #[test]
    fn a_body_whose_moments_break_the_triangle_inequality_is_impossible() {
        let of = |diagonal| {
            let central = Matrix3::from_diagonal(&diagonal);
            PseudoInertia::from(&Inertials::of(1.0, &Point3::new(0.2, 0.0, 0.0), &central))
        };
        assert!(of(Vector3::new(1.0, 2.0, 2.5)).is_possible());
        let impossible = of(Vector3::new(1.0, 1.0, 2.5));
        assert!(!impossible.is_possible() && impossible.made_possible(1.0, 0.1).is_possible());
        let nothing = PseudoInertia(Matrix4::zeros());
        assert!(!nothing.is_possible() && nothing.made_possible(1.0, 0.1).is_possible());
    }

    #[test]
    fn no_change_changes_nothing() {
        let pseudo = PseudoInertia::from(&body());
        assert!((pseudo.changed(&[0.0; 10]).unwrap().0 - pseudo.0).norm() < 1e-12);
        assert!((pseudo.made_possible(1.0, 0.1).0 - pseudo.0).norm() < 1e-12);
    }

    proptest! {
        #[test]
        fn every_change_is_possible(by in prop::array::uniform10(-2.0..2.0f64)) {
            let changed = PseudoInertia::from(&body()).changed(&by).unwrap();
            prop_assert!(changed.is_possible());
            let inertials = Inertials::from(&changed);
            let moments = inertials.central_kg_m2().symmetric_eigenvalues();
            prop_assert!(inertials.mass_kg > 0.0 && moments.min() > 0.0);
            prop_assert!(moments.sum() > 2.0 * moments.max());
        }
    }
}
