//! Point masses on links.

use super::Link;
use nalgebra::{Matrix3, Point3, Vector3};

/// Inertia of a point mass at `arm` from an origin (Steiner's theorem).
pub(crate) fn steiner(mass_kg: f64, arm: &Vector3<f64>) -> Matrix3<f64> {
    (Matrix3::identity() * arm.norm_squared() - arm * arm.transpose()) * mass_kg
}

impl Link {
    /// Adds a point mass at a place in the link's frame; does nothing where no mass is left.
    pub(crate) fn add_point_mass(&mut self, mass_kg: f64, at: &Point3<f64>) {
        let total = self.mass_kg + mass_kg;
        if total <= 0.0 {
            return;
        }
        let shift = (at - self.com_m) * (mass_kg / total);
        let to_mass = at - self.com_m - shift;
        self.inertia_kg_m2 += steiner(self.mass_kg, &shift) + steiner(mass_kg, &to_mass);
        self.com_m += shift;
        self.mass_kg = total;
    }
}
