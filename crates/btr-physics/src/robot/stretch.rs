//! Scaling of a link along its long axis.

use super::{Geometry, Link, Robot, Shape};
use nalgebra::{Matrix3, Point3, Unit, Vector3};

/// A shape counts as lying along the axis when the cosine between them is above this.
const ALIGNED: f64 = 0.99;

/// Long axis of a link, in its frame: towards the farthest joint that it carries, or towards its
/// centre of mass if it carries none. `None` when these are at its origin.
pub(crate) fn long_axis(robot: &Robot, link: usize) -> Option<Unit<Vector3<f64>>> {
    Unit::try_new(farthest_joint(robot, link).unwrap_or(robot.links[link].com_m.coords), 1e-9)
}

/// The end of a link, in its frame: the farthest joint that it carries, or else twice as far as its centre of mass.
pub(crate) fn end(robot: &Robot, link: usize) -> Vector3<f64> {
    farthest_joint(robot, link).unwrap_or(2.0 * robot.links[link].com_m.coords)
}

/// Where a tool is held, in the link's frame: the farthest face of the box around the link's meshes, or else its end.
pub(crate) fn tip(robot: &Robot, link: usize) -> Vector3<f64> {
    let boxes = &robot.links[link].mesh_boxes;
    boxes.iter().flat_map(face_centres).max_by(|a, b| a.norm().total_cmp(&b.norm())).unwrap_or_else(|| end(robot, link))
}

/// The centres of the six faces of a box, in the link's frame; none of another shape.
fn face_centres(shape: &Shape) -> Vec<Vector3<f64>> {
    let Geometry::Box { half_m } = shape.geometry else { return Vec::new() };
    let face = |axis: usize, side: f64| shape.pose * Point3::from(Vector3::ith(axis, side * half_m[axis]));
    (0..3).flat_map(|axis| [face(axis, 1.0).coords, face(axis, -1.0).coords]).collect()
}

impl Robot {
    /// How far a link reaches from its joint, in m: to its end, or to that of a rod with its inertia.
    pub fn extent_m(&self, link: usize) -> f64 {
        let Link { mass_kg, com_m, inertia_kg_m2, .. } = &self.links[link];
        let rod = if *mass_kg > 0.0 { (1.5 * inertia_kg_m2.trace() / mass_kg).sqrt() } else { 0.0 };
        end(self, link).norm().max(com_m.coords.norm() + rod)
    }
}

/// The place of the farthest joint that a link carries; `None` without one away from its origin.
fn farthest_joint(robot: &Robot, link: usize) -> Option<Vector3<f64>> {
    let carried = robot.links.iter().filter(|child| child.parent == Some(link));
    let far = carried.map(|child| child.joint.origin.translation.vector);
    far.max_by(|a, b| a.norm().total_cmp(&b.norm())).filter(|v| v.norm() > 1e-9)
}

/// Scales the length of a link by `factor` at constant density: shapes, centre of mass and the joints that it carries
/// move along the axis, its mass is proportional to its length, its inertia is that of the stretched body.
pub(crate) fn stretch(robot: &mut Robot, link: usize, factor: f64) {
    let Some(axis) = long_axis(robot, link) else { return };
    let stretched = |p: &Vector3<f64>| p + axis.into_inner() * ((factor - 1.0) * axis.dot(p));
    for child in robot.links.iter_mut().filter(|child| child.parent == Some(link)) {
        let origin = &mut child.joint.origin.translation.vector;
        *origin = stretched(origin);
    }
    let Link { mass_kg, com_m, inertia_kg_m2, shapes, mesh_boxes, .. } = &mut robot.links[link];
    *mass_kg *= factor;
    com_m.coords = stretched(&com_m.coords);
    *inertia_kg_m2 = stretched_inertia(inertia_kg_m2, &axis, factor);
    for shape in shapes.iter_mut().chain(mesh_boxes) {
        let at = &mut shape.pose.translation.vector;
        *at = stretched(at);
        stretch_shape(shape, &axis, factor);
    }
}

/// Second moments of mass scale with the square of the length, and mass with the length.
fn stretched_inertia(inertia: &Matrix3<f64>, axis: &Vector3<f64>, factor: f64) -> Matrix3<f64> {
    let moments = Matrix3::from_diagonal_element(inertia.trace() / 2.0) - inertia;
    let stretch = Matrix3::identity() + axis * axis.transpose() * (factor - 1.0);
    let moments = stretch * moments * stretch * factor;
    Matrix3::from_diagonal_element(moments.trace()) - moments
}

/// Spheres stay spheres, and shapes across the axis keep their size.
fn stretch_shape(shape: &mut Shape, axis: &Vector3<f64>, factor: f64) {
    let local = shape.pose.rotation.inverse() * axis;
    match &mut shape.geometry {
        Geometry::Sphere { .. } => {}
        Geometry::Box { half_m } => {
            let longest = local.iamax();
            if local[longest].abs() > ALIGNED {
                half_m[longest] *= factor;
            }
        }
        Geometry::Cylinder { half_length_m, .. } | Geometry::Capsule { half_length_m, .. } => {
            if local.z.abs() > ALIGNED {
                *half_length_m *= factor;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{end, tip};
    use crate::presets::pendulum::pendulum;
    use crate::robot::{Actuator, Geometry, Shape};
    use nalgebra::{Isometry3, Vector3};

    #[test]
    fn a_tool_is_held_where_the_meshes_end() {
        let mut robot = pendulum(1.0, 0.5, Actuator::Passive);
        assert_eq!(tip(&robot, 1), end(&robot, 1));
        let geometry = Geometry::Box { half_m: Vector3::new(0.1, 0.2, 0.3) };
        robot.links[1].mesh_boxes.push(Shape { pose: Isometry3::translation(0.0, 0.0, -0.5), geometry });
        assert_eq!(tip(&robot, 1), Vector3::new(0.0, 0.0, -0.8));
        assert_ne!(end(&robot, 1), tip(&robot, 1), "laws keep their place");
    }
}
