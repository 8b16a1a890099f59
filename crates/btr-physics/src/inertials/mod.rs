//! The inertial parameters of rigid bodies, in the form in which torques are linear in them, and which of them are
//! physically possible.

mod possible;
mod pseudo;
mod standard;

pub use possible::{PossibleParameters, StatedInertials};
pub use pseudo::{LOG_CHOLESKY, PseudoInertia};
pub use standard::{BodyNames, PER_JOINT, StandardKind, StandardParameter, moving_bodies, standard_parameters};
pub(crate) use standard::{MovingInertials, where_massless};

use crate::robot::Link;
use crate::robot::point_mass::steiner;
use nalgebra::{Matrix3, Point3, Vector3};

/// Number of inertial parameters of a body.
pub const PER_BODY: usize = 10;

/// Mass, first moment and inertia of a body about the origin of a frame, in its axes. Torques are linear in these ten
/// numbers, while they are not in the place of the centre of mass.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inertials {
    /// In kg.
    pub mass_kg: f64,
    /// Mass times centre of mass, in kg·m.
    pub moment_kg_m: Vector3<f64>,
    /// Inertia about the origin, in kg·m²: a matrix with the negative products of inertia beside the diagonal, as in
    /// URDF.
    pub inertia_kg_m2: Matrix3<f64>,
}

impl Inertials {
    /// Those of a mass with this centre and inertia about it.
    pub fn of(mass_kg: f64, com_m: &Point3<f64>, central_kg_m2: &Matrix3<f64>) -> Self {
        let inertia_kg_m2 = central_kg_m2 + steiner(mass_kg, &com_m.coords);
        Inertials { mass_kg, moment_kg_m: com_m.coords * mass_kg, inertia_kg_m2 }
    }

    /// In the order mass, first moments x y z, inertia xx yy zz xy xz yz.
    pub fn to_array(&self) -> [f64; PER_BODY] {
        let (h, i) = (&self.moment_kg_m, &self.inertia_kg_m2);
        [self.mass_kg, h.x, h.y, h.z, i[(0, 0)], i[(1, 1)], i[(2, 2)], i[(0, 1)], i[(0, 2)], i[(1, 2)]]
    }

    /// The inverse of [`to_array`](Self::to_array).
    pub fn from_array([mass_kg, hx, hy, hz, xx, yy, zz, xy, xz, yz]: [f64; PER_BODY]) -> Self {
        let inertia_kg_m2 = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        Inertials { mass_kg, moment_kg_m: Vector3::new(hx, hy, hz), inertia_kg_m2 }
    }

    /// The centre of mass in m; the origin where there is no mass.
    pub fn com_m(&self) -> Point3<f64> {
        if self.mass_kg == 0.0 { Point3::origin() } else { Point3::from(self.moment_kg_m / self.mass_kg) }
    }

    /// Inertia about the centre of mass, in kg·m².
    pub fn central_kg_m2(&self) -> Matrix3<f64> {
        self.inertia_kg_m2 - steiner(self.mass_kg, &self.com_m().coords)
    }
}

impl Link {
    /// Its inertial parameters in its own frame.
    pub fn inertials(&self) -> Inertials {
        Inertials::of(self.mass_kg, &self.com_m, &self.inertia_kg_m2)
    }

    /// Gives it inertial parameters as a file states them; its centre of mass has a place even without a mass.
    pub fn set_stated(&mut self, stated: &StatedInertials) {
        self.set_inertials(&stated.into());
        self.com_m = stated.com_m.into();
    }

    /// Gives it other inertial parameters.
    pub fn set_inertials(&mut self, inertials: &Inertials) {
        self.mass_kg = inertials.mass_kg;
        self.com_m = inertials.com_m();
        self.inertia_kg_m2 = inertials.central_kg_m2();
    }
}
