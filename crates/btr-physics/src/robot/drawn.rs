//! What is drawn of a robot: its links' shapes, or rods and hubs where it has none.

use super::{Geometry, Joint, JointKind, Link, Robot, Shape};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

/// Radius of a rod in multiples of the robot's reach, and at most in multiples of its own length.
const ROD: (f64, f64) = (0.03, 0.3);
/// Radius of a hub in multiples of the robot's reach.
const HUB: f64 = 0.045;

/// A body that is drawn of a link, in the link's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnBody {
    /// Its shape.
    pub shape: Shape,
    /// Whether it is the link's own or the hub in its joint; other bodies only connect.
    pub is_own: bool,
}

impl Robot {
    /// What is drawn of each link: the shapes that touch, or the boxes around its meshes, with rods to those that are
    /// away from the joint; or rods with a hub in the joint.
    pub fn drawn(&self) -> Vec<Vec<DrawnBody>> {
        let reach_m = reach_m(self);
        (0..self.links.len()).map(|index| bodies(self, index, reach_m)).collect()
    }

    /// The same robot with what is drawn of links that have neither shapes nor meshes; it touches nothing.
    #[must_use]
    pub fn with_drawn_links(&self) -> Robot {
        let mut robot = self.clone();
        for (link, drawn) in robot.links.iter_mut().zip(self.drawn()) {
            if link.shapes.is_empty() && link.mesh_boxes.is_empty() {
                link.mesh_boxes = drawn.into_iter().map(|body| body.shape).collect();
            }
        }
        robot
    }

    /// The same robot with shapes of another size about their centres.
    #[must_use]
    pub fn with_scaled_shapes(mut self, by: f64) -> Robot {
        let shapes = self.links.iter_mut().flat_map(|link| link.shapes.iter_mut().chain(&mut link.mesh_boxes));
        shapes.for_each(|shape| shape.geometry = shape.geometry.scaled(by));
        self
    }
}

impl Geometry {
    fn scaled(&self, by: f64) -> Geometry {
        match *self {
            Geometry::Box { half_m } => Geometry::Box { half_m: half_m * by },
            Geometry::Sphere { radius_m } => Geometry::Sphere { radius_m: radius_m * by },
            Geometry::Cylinder { radius_m, half_length_m } => {
                Geometry::Cylinder { radius_m: radius_m * by, half_length_m: half_length_m * by }
            }
            Geometry::Capsule { radius_m, half_length_m } => {
                Geometry::Capsule { radius_m: radius_m * by, half_length_m: half_length_m * by }
            }
        }
    }
}

fn bodies(robot: &Robot, index: usize, reach_m: f64) -> Vec<DrawnBody> {
    let link = &robot.links[index];
    let moves = index > 0 && link.joint.kind != JointKind::Fixed;
    let own = if link.shapes.is_empty() { &link.mesh_boxes } else { &link.shapes };
    if !own.is_empty() {
        let away = own.iter().filter_map(|shape| Some(shape.pose.translation.vector).filter(|at| is_away(shape, at)));
        let shapes = own.iter().map(|shape| DrawnBody { shape: shape.clone(), is_own: true });
        return shapes.chain(away.filter_map(|at| rod(&at, reach_m))).collect();
    }
    let rods = ends(robot, index).into_iter().filter_map(|end| rod(&end, reach_m));
    rods.chain(moves.then(|| hub(link, reach_m))).collect()
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
fn rod(end: &Vector3<f64>, reach_m: f64) -> Option<DrawnBody> {
    let length_m = end.norm();
    let radius_m = (ROD.0 * reach_m).min(ROD.1 * length_m);
    (length_m > 1e-6).then(|| {
        let pose = Isometry3::from_parts(Translation3::from(end / 2.0), along(end));
        let geometry = Geometry::Capsule { radius_m, half_length_m: length_m / 2.0 };
        DrawnBody { shape: Shape { pose, geometry }, is_own: false }
    })
}

/// A hub about the axis of a link's joint, or a carriage on it.
fn hub(link: &Link, reach_m: f64) -> DrawnBody {
    let size_m = HUB * reach_m;
    let geometry = match link.joint.kind {
        JointKind::Prismatic => Geometry::Box { half_m: Vector3::new(1.0, 1.0, 1.5) * size_m },
        JointKind::Fixed | JointKind::Revolute => Geometry::Cylinder { radius_m: size_m, half_length_m: 1.1 * size_m },
    };
    let pose = Isometry3::from_parts(Translation3::identity(), along(&link.joint.axis));
    DrawnBody { shape: Shape { pose, geometry }, is_own: true }
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
