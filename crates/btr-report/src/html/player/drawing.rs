//! A robot as the player draws it: its links' shapes, or rods and hubs where it has none.

use btr_physics::robot::{Geometry, Joint, JointKind, Link, Robot, Shape};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use serde::Serialize;

/// Radius of a rod in multiples of the robot's reach, and at most in multiples of its own length.
const ROD: (f64, f64) = (0.03, 0.3);
/// Radius of a hub in multiples of the robot's reach.
const HUB: f64 = 0.045;

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
    let reach_m = reach_m(robot);
    let link = |(index, link): (usize, &Link)| DrawnLink {
        parent: link.parent,
        origin: pose(&link.joint.origin),
        joint: movable.iter().position(|other| *other == index),
        slides: link.joint.kind == JointKind::Prismatic,
        axis: link.joint.axis.map(|x| rounded(x, 1e-6)).into(),
        shapes: shapes(robot, index, movable.contains(&index), reach_m),
    };
    robot.links.iter().enumerate().map(link).collect()
}

/// The shapes of a link: those that touch, or the boxes around its meshes, with rods to those that are away from the
/// joint; or rods with a hub in the joint.
fn shapes(robot: &Robot, index: usize, moves: bool, reach_m: f64) -> Vec<DrawnShape> {
    let link = &robot.links[index];
    let own = if link.shapes.is_empty() { &link.mesh_boxes } else { &link.shapes };
    if !own.is_empty() {
        let away = own.iter().filter_map(|shape| Some(shape.pose.translation.vector).filter(|at| is_away(shape, at)));
        let shapes = own.iter().map(|shape| DrawnShape { shows_error: moves, ..body(shape) });
        return shapes.chain(away.filter_map(|at| rod(&at, reach_m))).collect();
    }
    let rods = ends(robot, index).into_iter().filter_map(|end| rod(&end, reach_m));
    rods.chain(moves.then(|| hub(link, reach_m))).collect()
}

fn body(shape: &Shape) -> DrawnShape {
    let (kind, size_m) = match shape.geometry {
        Geometry::Box { half_m } => ("box", half_m.iter().copied().collect()),
        Geometry::Sphere { radius_m } => ("capsule", vec![radius_m, 0.0]),
        Geometry::Cylinder { radius_m, half_length_m } => ("cylinder", vec![radius_m, half_length_m]),
        Geometry::Capsule { radius_m, half_length_m } => ("capsule", vec![radius_m, half_length_m]),
    };
    let size_m = size_m.into_iter().map(|x: f64| rounded(x, 1e-6)).collect();
    DrawnShape { kind, size_m, pose: pose(&shape.pose), shows_error: false }
}

/// Where rods of a link without shapes end: at the joints that it carries, or beyond its centre of mass.
fn ends(robot: &Robot, index: usize) -> Vec<Vector3<f64>> {
    let carried = robot.links.iter().filter(|link| link.parent == Some(index));
    let joints: Vec<Vector3<f64>> = carried.map(|link| link.joint.origin.translation.vector).collect();
    if joints.is_empty() { vec![2.0 * robot.links[index].com_m.coords] } else { joints }
}

/// Whether a shape with its centre there does not reach to the link's origin.
fn is_away(shape: &Shape, centre: &Vector3<f64>) -> bool {
    let reach_m = match shape.geometry {
        Geometry::Box { half_m } => half_m.norm(),
        Geometry::Sphere { radius_m } => radius_m,
        Geometry::Cylinder { radius_m, half_length_m } => radius_m.hypot(half_length_m),
        Geometry::Capsule { radius_m, half_length_m } => radius_m + half_length_m,
    };
    centre.norm() > reach_m
}

/// A rod from the link's origin; none to a point that lies there.
fn rod(end: &Vector3<f64>, reach_m: f64) -> Option<DrawnShape> {
    let length_m = end.norm();
    let radius_m = (ROD.0 * reach_m).min(ROD.1 * length_m);
    (length_m > 1e-6).then(|| {
        let placed = Isometry3::from_parts(Translation3::from(end / 2.0), along(end));
        let geometry = Geometry::Capsule { radius_m, half_length_m: length_m / 2.0 };
        body(&Shape { pose: placed, geometry })
    })
}

/// A hub about the axis of a link's joint, or a carriage on it.
fn hub(link: &Link, reach_m: f64) -> DrawnShape {
    let size_m = HUB * reach_m;
    let geometry = match link.joint.kind {
        JointKind::Prismatic => Geometry::Box { half_m: Vector3::new(1.0, 1.0, 1.5) * size_m },
        JointKind::Fixed | JointKind::Revolute => Geometry::Cylinder { radius_m: size_m, half_length_m: 1.1 * size_m },
    };
    let placed = Isometry3::from_parts(Translation3::identity(), along(&link.joint.axis));
    DrawnShape { shows_error: true, ..body(&Shape { pose: placed, geometry }) }
}

/// How far the robot reaches from its root at most, roughly.
fn reach_m(robot: &Robot) -> f64 {
    let mut reach: Vec<f64> = Vec::with_capacity(robot.links.len());
    let mut most: f64 = 0.05;
    for link in &robot.links {
        let here = link.parent.map_or(0.0, |parent| reach[parent] + origin_m(&link.joint));
        most = most.max(here + 2.0 * (link.com_m - Point3::origin()).norm());
        reach.push(here);
    }
    most
}

/// How far a joint's frame gets from its parent's origin at most: a slide by its limits.
fn origin_m(joint: &Joint) -> f64 {
    let stroke_m = match joint.kind {
        JointKind::Prismatic => joint.limits.0.abs().max(joint.limits.1.abs()),
        JointKind::Fixed | JointKind::Revolute => 0.0,
    };
    joint.origin.translation.vector.norm() + if stroke_m.is_finite() { stroke_m } else { 0.0 }
}

/// The rotation that takes z into a direction.
fn along(direction: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between(&Vector3::z(), direction)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI))
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
