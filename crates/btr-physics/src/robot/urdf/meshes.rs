//! The meshes that a URDF names. They are in files of their own, which are read where files are read.

use super::{UrdfError, pose, read};
use crate::robot::{Geometry, Robot, Shape};
use nalgebra::{Isometry3, Point3, Translation3, Vector3};

/// A mesh of a link.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// The link.
    pub link: String,
    /// Its file as the URDF names it: `package://arm/base.stl`.
    pub file: String,
    scale: Vector3<f64>,
    pose: Isometry3<f64>,
}

/// The meshes of a URDF: those with which a link collides, or else those that are its picture.
///
/// # Errors
/// A text that is no URDF; a scale or a place that is no number.
pub fn meshes(text: &str) -> Result<Vec<Mesh>, UrdfError> {
    let urdf = read(text)?;
    let mut meshes = Vec::new();
    for link in &urdf.links {
        let collisions = link.collision.iter().map(|part| (&part.geometry, &part.origin));
        let visuals = link.visual.iter().map(|part| (&part.geometry, &part.origin));
        let of = |(geometry, origin): (&urdf_rs::Geometry, &urdf_rs::Pose)| match geometry {
            urdf_rs::Geometry::Mesh { filename, scale } => {
                let scale = scale.map_or(Vector3::repeat(1.0), |scale| Vector3::from(scale.0));
                Some(Mesh { link: link.name.clone(), file: filename.clone(), scale, pose: pose(origin) })
            }
            _ => None,
        };
        let touching: Vec<Mesh> = collisions.filter_map(of).collect();
        meshes.extend(if touching.is_empty() { visuals.filter_map(of).collect() } else { touching });
    }
    meshes.iter().try_for_each(Mesh::check)?;
    Ok(meshes)
}

impl Mesh {
    fn check(&self) -> Result<(), UrdfError> {
        let invalid = |what, value: f64| UrdfError::Value { name: self.link.clone(), what, value };
        let of = |what, numbers: &[f64]| match numbers.iter().find(|x| !x.is_finite()) {
            Some(x) => Err(invalid(what, *x)),
            None => Ok(()),
        };
        of("scale", self.scale.as_slice())?;
        of("place of a mesh", self.pose.translation.vector.as_slice())?;
        of("direction of a mesh", self.pose.rotation.coords.as_slice())
    }

    /// Gives the mesh's link of a robot the box between two corners, which are in the mesh's own units and axes.
    pub fn enclose(&self, robot: &mut Robot, low: Point3<f64>, high: Point3<f64>) {
        let Some(link) = robot.link(&self.link) else { return };
        // A negative scale mirrors the mesh.
        let (one, other) = (low.coords.component_mul(&self.scale), high.coords.component_mul(&self.scale));
        let centre = Translation3::from((one + other) / 2.0);
        let geometry = Geometry::Box { half_m: ((other - one) / 2.0).abs() };
        robot.links[link].mesh_boxes.push(Shape { pose: self.pose * centre, geometry });
    }
}
