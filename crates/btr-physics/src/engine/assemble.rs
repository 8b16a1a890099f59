//! Links assembled to moving bodies: links connected by fixed joints become one body with one mass and one inertia.

use crate::robot::point_mass::steiner;
use crate::robot::{Base, Geometry, JointKind, Link, Robot, Shape};
use crate::setup::Setup;
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

/// A rigid body in the frame of its first link. `bodies[0]` is the root, `bodies[1 + j]` is the child of movable joint
/// `j`.
#[derive(Clone, Debug)]
pub(crate) struct MovingBody {
    /// Index of its first link, whose joint connects it to the parent.
    pub link: usize,
    /// Index of the parent body; the root is its own parent.
    pub parent: usize,
    /// The joint's frame in the parent body's frame at q = 0.
    pub origin: Isometry3<f64>,
    pub mass_kg: f64,
    pub com_m: Point3<f64>,
    /// About the centre of mass.
    pub inertia_kg_m2: Matrix3<f64>,
    /// Shapes, each with the index of its link.
    pub shapes: Vec<(usize, Shape)>,
}

/// The robot's moving bodies.
pub(crate) fn bodies(robot: &Robot) -> Vec<MovingBody> {
    let mut bodies: Vec<MovingBody> = Vec::with_capacity(robot.links.len());
    // For each link: its body, and the link's frame in that body's frame.
    let mut held_by: Vec<(usize, Isometry3<f64>)> = Vec::with_capacity(robot.links.len());
    for (index, link) in robot.links.iter().enumerate() {
        let (carrier, in_carrier) = match link.parent {
            Some(parent) => (held_by[parent].0, held_by[parent].1 * link.joint.origin),
            None => (0, Isometry3::identity()),
        };
        if link.parent.is_some() && link.joint.kind == JointKind::Fixed {
            bodies[carrier].fuse(index, link, &in_carrier);
            held_by.push((carrier, in_carrier));
        } else {
            held_by.push((bodies.len(), Isometry3::identity()));
            bodies.push(MovingBody::new(index, link, carrier, in_carrier));
        }
    }
    bodies
}

impl MovingBody {
    fn new(index: usize, link: &Link, parent: usize, origin: Isometry3<f64>) -> Self {
        MovingBody {
            link: index,
            parent,
            origin,
            mass_kg: link.mass_kg,
            com_m: link.com_m,
            inertia_kg_m2: link.inertia_kg_m2,
            shapes: link.shapes.iter().map(|shape| (index, shape.clone())).collect(),
        }
    }

    /// Merges a link that sits at `pose` in this body's frame.
    fn fuse(&mut self, index: usize, link: &Link, pose: &Isometry3<f64>) {
        let rotation = pose.rotation.to_rotation_matrix();
        let inertia = rotation * link.inertia_kg_m2 * rotation.transpose();
        self.add_mass(link.mass_kg, &(pose * link.com_m), &inertia);
        let shapes = link.shapes.iter().map(|s| (index, Shape { pose: pose * s.pose, geometry: s.geometry.clone() }));
        self.shapes.extend(shapes);
    }

    fn add_mass(&mut self, mass_kg: f64, com_m: &Point3<f64>, inertia: &Matrix3<f64>) {
        let total = self.mass_kg + mass_kg;
        if total > 0.0 {
            let com = Point3::from((self.com_m.coords * self.mass_kg + com_m.coords * mass_kg) / total);
            self.inertia_kg_m2 +=
                inertia + steiner(self.mass_kg, &(self.com_m - com)) + steiner(mass_kg, &(com_m - com));
            self.com_m = com;
        }
        self.mass_kg = total;
    }
}

/// For each movable joint an upper estimate of the inertia that it moves in any pose, in kg·m² (kg for slides).
pub fn carried_inertia(robot: &Robot) -> Vec<f64> {
    carried(robot, inertia_in_any_pose)
}

fn inertia_in_any_pose(body: &MovingBody, arm: &Vector3<f64>) -> f64 {
    body.mass_kg * arm.norm_squared() + body.inertia_kg_m2.trace()
}

/// The same, but with the inertia of the joint's own link about the joint's axis: a roll joint turns a long link with
/// little inertia.
pub fn turned_inertia(robot: &Robot) -> Vec<f64> {
    carried(robot, |body, _| {
        let axis = robot.links[body.link].joint.axis;
        let arm = body.com_m.coords.cross(&axis);
        body.mass_kg * arm.norm_squared() + axis.dot(&(body.inertia_kg_m2 * axis))
    })
}

/// For each movable joint the inertia that it moves; `own` is that of its own link, whose centre of mass is at `arm`.
fn carried(robot: &Robot, own: impl Fn(&MovingBody, &Vector3<f64>) -> f64) -> Vec<f64> {
    let bodies = bodies(robot);
    let poses = start_poses(robot, &bodies);
    let mut carried = vec![0.0; bodies.len()];
    for (index, body) in bodies.iter().enumerate() {
        let mut at = index;
        while at > 0 {
            let joint = &robot.links[bodies[at].link].joint;
            let arm = poses[index] * body.com_m - Point3::from(poses[at].translation.vector);
            carried[at] += match joint.kind {
                JointKind::Prismatic => body.mass_kg,
                JointKind::Revolute | JointKind::Fixed if at == index => own(body, &arm),
                JointKind::Revolute | JointKind::Fixed => inertia_in_any_pose(body, &arm),
            };
            at = bodies[at].parent;
        }
    }
    let rotors = bodies.iter().map(|body| robot.links[body.link].joint.armature);
    carried.iter().zip(rotors).skip(1).map(|(inertia, rotor)| inertia + rotor).collect()
}

/// Poses of the bodies' frames in the root's frame in the start pose.
fn start_poses(robot: &Robot, bodies: &[MovingBody]) -> Vec<Isometry3<f64>> {
    let mut poses: Vec<Isometry3<f64>> = Vec::with_capacity(bodies.len());
    for body in bodies {
        let joint = &robot.links[body.link].joint;
        let moved = match joint.kind {
            JointKind::Revolute => Isometry3::rotation(joint.axis * joint.start),
            JointKind::Prismatic => Isometry3::from_parts((joint.axis * joint.start).into(), nalgebra::one()),
            JointKind::Fixed => Isometry3::identity(),
        };
        let pose = if poses.is_empty() { Isometry3::identity() } else { poses[body.parent] * body.origin * moved };
        poses.push(pose);
    }
    poses
}

/// Penetration depth of the robot's lowest shape into the floor (z = 0) in the start pose, in m; negative above it.
fn depth_m(robot: &Robot, bodies: &[MovingBody]) -> f64 {
    let poses = start_poses(robot, bodies);
    let shapes = bodies.iter().zip(&poses).flat_map(|(body, pose)| body.shapes.iter().map(move |(_, s)| (pose, s)));
    shapes
        .map(|(pose, shape)| shape_depth_m(&(robot.start * pose * shape.pose), &shape.geometry))
        .fold(f64::MIN, f64::max)
}

/// Height by which a floating robot is lifted at the start, in m. With longer legs than the start pose was made for it
/// would start inside the floor and be expelled. A robot that rests before it moves is placed on the floor.
pub(crate) fn lift_m(robot: &Robot, bodies: &[MovingBody], setup: &Setup) -> f64 {
    if robot.base == Base::Fixed || setup.ground.is_none() {
        return 0.0;
    }
    let depth = depth_m(robot, bodies);
    let touches = bodies.iter().any(|body| !body.shapes.is_empty());
    if setup.rest_s > 0.0 && touches { depth } else { depth.max(0.0) }
}

fn shape_depth_m(pose: &Isometry3<f64>, geometry: &Geometry) -> f64 {
    // The world's vertical in the shape's axes.
    let up = pose.rotation.inverse() * Vector3::z();
    let reach = match geometry {
        Geometry::Box { half_m } => half_m.dot(&up.abs()),
        Geometry::Sphere { radius_m } => *radius_m,
        Geometry::Cylinder { radius_m, half_length_m } => half_length_m * up.z.abs() + radius_m * up.x.hypot(up.y),
        Geometry::Capsule { radius_m, half_length_m } => half_length_m * up.z.abs() + radius_m,
    };
    reach - pose.translation.z
}
