//! The simplest robot: a point mass on a massless rod, hanging from a hinge that turns about y.

use crate::robot::{Actuator, Base, Joint, JointKind, Link, Robot};
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

/// A pendulum of this mass and length; joint `hinge`, link `bob`, hanging straight down at q = 0.
pub fn pendulum(mass_kg: f64, length_m: f64, actuator: Actuator) -> Robot {
    let joint = |name: &str, axis| Joint::new(name, JointKind::Revolute, Isometry3::identity(), axis);
    let stand = Link {
        name: "stand".to_owned(),
        parent: None,
        joint: joint("root", Vector3::y()),
        mass_kg: 1.0,
        com_m: Point3::origin(),
        inertia_kg_m2: Matrix3::identity(),
        shapes: Vec::new(),
        mesh_boxes: vec![],
        foot: false,
    };
    let bob = Link {
        name: "bob".to_owned(),
        parent: Some(0),
        joint: Joint { actuator, ..joint("hinge", Vector3::y()) },
        mass_kg,
        com_m: Point3::new(0.0, 0.0, -length_m),
        inertia_kg_m2: Matrix3::zeros(),
        ..stand.clone()
    };
    Robot { name: "pendulum".to_owned(), base: Base::Fixed, start: Isometry3::identity(), links: vec![stand, bob] }
}
