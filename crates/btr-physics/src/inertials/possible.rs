//! All standard parameters that a robot of rigid bodies can have: a smooth function of coordinates around its own.

use super::{Inertials, LOG_CHOLESKY, PER_BODY, PER_JOINT, PseudoInertia};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Farthest change of a body's mass and extents, as a logarithm: a flat body is at infinity.
const FARTHEST: f64 = 5.0;
/// Radius of what stands for a body of which the model states no extent, in m.
const RADIUS_M: f64 = 0.005;
/// Mass of what stands for a body of which the model states no mass, in kg.
const MASS_KG: f64 = 0.1;

/// The possible standard parameters of a robot. A coordinate of 0 is the model, and one of 1 a deviation of the order
/// of the value itself.
#[derive(Clone, Debug)]
pub struct PossibleParameters {
    bodies: Vec<PseudoInertia>,
    /// For each parameter of a joint its value, a typical one, and whether it can be negative.
    joints: Vec<(f64, f64, bool)>,
}

impl PossibleParameters {
    /// Around values of the standard parameters in their order, of a robot with this many moving bodies; `typical` has
    /// the order of magnitude of each of them, which only those of joints need. An impossible value is replaced by a
    /// possible one next to it.
    pub fn around(values: &[f64], typical: &[f64], bodies: usize) -> Self {
        let (of_bodies, of_joints) = values.split_at((PER_BODY * bodies).min(values.len()));
        let body = |of: &[f64]| {
            let inertials = Inertials::from_array(std::array::from_fn(|k| of[k]));
            PseudoInertia::from(&inertials).made_possible(MASS_KG.min(inertials.mass_kg.abs().max(1e-3)), RADIUS_M)
        };
        let joint = |(k, (value, typical)): (usize, (&f64, &f64))| {
            let signed = k % PER_JOINT == OFFSET;
            let value = if signed { *value } else { value.max(0.0) };
            (value, typical.abs().max(value.abs()).max(f64::MIN_POSITIVE), signed)
        };
        PossibleParameters {
            bodies: of_bodies.chunks_exact(PER_BODY).map(body).collect(),
            joints: of_joints.iter().zip(&typical[of_bodies.len()..]).enumerate().map(joint).collect(),
        }
    }

    /// Smallest and largest value of each coordinate.
    pub fn bounds(&self) -> Vec<(f64, f64)> {
        let of_body = |k: usize| if k < 4 { (-FARTHEST, FARTHEST) } else { (f64::NEG_INFINITY, f64::INFINITY) };
        let bodies = self.bodies.iter().flat_map(|_| (0..LOG_CHOLESKY).map(of_body));
        let least =
            |&(value, typical, signed): &(f64, f64, bool)| if signed { f64::NEG_INFINITY } else { -value / typical };
        bodies.chain(self.joints.iter().map(|joint| (least(joint), f64::INFINITY))).collect()
    }

    /// The standard parameters at some coordinates; `None` where rounding leaves no possible body.
    pub fn at(&self, x: &[f64]) -> Option<Vec<f64>> {
        let (of_bodies, of_joints) = x.split_at(LOG_CHOLESKY * self.bodies.len());
        let mut values = Vec::with_capacity(x.len());
        for (body, by) in self.bodies.iter().zip(of_bodies.chunks_exact(LOG_CHOLESKY)) {
            let changed = body.changed(&std::array::from_fn(|k| by[k]))?;
            values.extend(Inertials::from(&changed).to_array());
        }
        values.extend(self.joints.iter().zip(of_joints).map(|((value, typical, _), x)| value + typical * x));
        values.iter().all(|value| value.is_finite()).then_some(values)
    }
}

/// Share of a vector's or a matrix's size that is a rounding error.
const ROUNDING: f64 = 1e-12;
/// Place of the offset among a joint's parameters.
const OFFSET: usize = 2;

/// A body's inertial parameters as a robot's file states them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StatedInertials {
    /// Mass in kg.
    pub mass_kg: f64,
    /// Centre of mass in the link's frame, in m.
    pub com_m: [f64; 3],
    /// Inertia about the centre of mass in the link's axes, in kg·m²: xx, yy, zz, xy, xz, yz.
    pub inertia_kg_m2: [f64; 6],
}

impl From<&Inertials> for StatedInertials {
    fn from(inertials: &Inertials) -> Self {
        let (com, i) = (inertials.com_m(), inertials.central_kg_m2());
        let inertia_kg_m2 = [i[(0, 0)], i[(1, 1)], i[(2, 2)], i[(0, 1)], i[(0, 2)], i[(1, 2)]];
        let tidy = |x: f64, size: f64| if x.abs() > ROUNDING * size { x } else { 0.0 };
        StatedInertials {
            mass_kg: inertials.mass_kg,
            com_m: [com.x, com.y, com.z].map(|x| tidy(x, com.coords.norm())),
            inertia_kg_m2: inertia_kg_m2.map(|x| tidy(x, i.norm())),
        }
    }
}

impl From<&StatedInertials> for Inertials {
    fn from(stated: &StatedInertials) -> Self {
        let [xx, yy, zz, xy, xz, yz] = stated.inertia_kg_m2;
        let central = Inertials::from_array([0.0, 0.0, 0.0, 0.0, xx, yy, zz, xy, xz, yz]).inertia_kg_m2;
        Inertials::of(stated.mass_kg, &Vector3::from(stated.com_m).into(), &central)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use nalgebra::{Matrix3, Point3};
    use proptest::prelude::*;

    const BODIES: usize = 2;
    const COUNT: usize = BODIES * (PER_BODY + PER_JOINT);

    /// A body of some extent, and one without any, as files state it.
    fn values() -> Vec<f64> {
        let inertia = Matrix3::from_diagonal(&Vector3::new(0.02, 0.05, 0.06));
        let body = Inertials::of(2.5, &Point3::new(0.1, -0.2, 0.3), &inertia).to_array();
        let point = Inertials::of(1.5, &Point3::new(0.2, 0.0, 0.0), &Matrix3::zeros()).to_array();
        [&body[..], &point, &[0.5, 0.0, -0.3, 0.1], &[0.0; 4]].concat()
    }

    #[test]
    fn no_change_is_the_model_where_that_is_possible() {
        let family = PossibleParameters::around(&values(), &[1.0; COUNT], BODIES);
        let same = family.at(&[0.0; COUNT]).unwrap();
        let of_joints = BODIES * PER_BODY;
        let close = |k: &usize| (same[*k] - values()[*k]).abs() < 1e-12;
        assert!((0..PER_BODY).chain(of_joints..COUNT).all(|k| close(&k)), "{same:?}");
        assert!((PER_BODY..of_joints).all(|k| (same[k] - values()[k]).abs() < 1e-3), "{same:?}");
        let stated = StatedInertials::from(&Inertials::from_array(std::array::from_fn(|k| same[k])));
        let again = Inertials::from(&stated).to_array();
        assert!(again.iter().zip(&same).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    proptest! {
        #[test]
        fn every_member_is_possible(x in prop::collection::vec(-3.0..3.0f64, COUNT)) {
            let family = PossibleParameters::around(&values(), &[1.0; COUNT], BODIES);
            let bounds = family.bounds();
            let x: Vec<f64> = x.iter().zip(&bounds).map(|(x, (least, most))| x.clamp(*least, *most)).collect();
            let values = family.at(&x).unwrap();
            let (bodies, joints) = values.split_at(BODIES * PER_BODY);
            for body in bodies.chunks_exact(PER_BODY) {
                let inertials = Inertials::from_array(std::array::from_fn(|k| body[k]));
                prop_assert!(PseudoInertia::from(&inertials).is_possible());
            }
            for joint in joints.chunks_exact(PER_JOINT) {
                prop_assert!(joint[0] >= 0.0 && joint[1] >= 0.0 && joint[3] >= 0.0);
            }
        }
    }
}
