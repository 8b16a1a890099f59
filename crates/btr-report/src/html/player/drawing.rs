//! A robot as the player draws it.

use btr_physics::robot::{DrawnBody, Geometry, JointKind, Link, Robot};
use nalgebra::Isometry3;
use serde::Serialize;

/// A place in m and a rotation as a quaternion x, y, z, w.
pub(super) type Pose = [f64; 7];

/// A link, and the joint that carries it.
#[derive(Debug, Serialize)]
pub(super) struct DrawnLink {
    /// Index of the link that carries it; none for the root.
    parent: Option<usize>,
    /// Its joint's frame in the parent's frame, at position 0.
    origin: Pose,
    /// The joint's place among those that move; none if it is fixed.
    joint: Option<usize>,
    /// Whether the joint moves along its axis instead of about it.
    slides: bool,
    /// The joint's axis.
    axis: [f64; 3],
    /// What is drawn of the link, in its frame.
    shapes: Vec<DrawnShape>,
}

/// A body of a link.
#[derive(Debug, Serialize)]
struct DrawnShape {
    /// `box`, `cylinder` or `capsule`; a sphere is a capsule without a straight part.
    kind: &'static str,
    /// Half the sides of a box; radius and half the straight length along z of the others. In m.
    size_m: Vec<f64>,
    pose: Pose,
    /// Whether it has the colour of the joint's error.
    shows_error: bool,
}

/// The links in the order of the robot, parents first.
pub(super) fn drawn(robot: &Robot) -> Vec<DrawnLink> {
    let movable: Vec<usize> = robot.movable().map(|(link, _)| link).collect();
    let bodies = robot.drawn();
    let link = |(index, link): (usize, &Link)| {
        let joint = movable.iter().position(|other| *other == index);
        DrawnLink {
            parent: link.parent,
            origin: pose(&link.joint.origin),
            joint,
            slides: link.joint.kind == JointKind::Prismatic,
            axis: link.joint.axis.map(|x| rounded(x, 1e-6)).into(),
            shapes: bodies[index].iter().map(|body| shape(body, joint.is_some())).collect(),
        }
    };
    robot.links.iter().enumerate().map(link).collect()
}

fn shape(DrawnBody { shape, is_own }: &DrawnBody, moves: bool) -> DrawnShape {
    let (kind, size_m) = match shape.geometry {
        Geometry::Box { half_m } => ("box", half_m.iter().copied().collect()),
        Geometry::Sphere { radius_m } => ("capsule", vec![radius_m, 0.0]),
        Geometry::Cylinder { radius_m, half_length_m } => ("cylinder", vec![radius_m, half_length_m]),
        Geometry::Capsule { radius_m, half_length_m } => ("capsule", vec![radius_m, half_length_m]),
    };
    let size_m = size_m.into_iter().map(|x: f64| rounded(x, 1e-6)).collect();
    DrawnShape { kind, size_m, pose: pose(&shape.pose), shows_error: moves && *is_own }
}

pub(super) fn pose(at: &Isometry3<f64>) -> Pose {
    let (p, q) = (at.translation.vector, at.rotation);
    [p.x, p.y, p.z, q.i, q.j, q.k, q.w].map(|x| rounded(x, 1e-6))
}

/// A number in whole multiples of a unit of at most 1 that is a power of ten, which JSON writes with few digits.
pub(super) fn rounded(x: f64, unit: f64) -> f64 {
    let per_one = (1.0 / unit).round();
    // Zero has no sign in the file.
    (x * per_one).round() / per_one + 0.0
}
