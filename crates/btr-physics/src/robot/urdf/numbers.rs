//! Checks of the numbers in a URDF: what is no number, or has the wrong sign, is refused by name.

use super::UrdfError;
use urdf_rs::{Geometry, Joint, Link, Pose};

/// Checks every number of the links and joints that becomes part of a robot.
///
/// # Errors
/// [`UrdfError::Value`] for the first invalid one.
pub(super) fn check(urdf: &urdf_rs::Robot) -> Result<(), UrdfError> {
    urdf.links.iter().try_for_each(check_link)?;
    urdf.joints.iter().try_for_each(check_joint)
}

fn check_link(link: &Link) -> Result<(), UrdfError> {
    let (of, i) = (Named(&link.name), &link.inertial.inertia);
    of.not_negative("mass", &[link.inertial.mass.value])?;
    for (what, value) in [("ixx", i.ixx), ("iyy", i.iyy), ("izz", i.izz)] {
        of.not_negative(what, &[value])?;
    }
    for (what, value) in [("ixy", i.ixy), ("ixz", i.ixz), ("iyz", i.iyz)] {
        of.finite(what, &[value])?;
    }
    of.pose(&link.inertial.origin)?;
    for collision in &link.collision {
        of.pose(&collision.origin)?;
        match &collision.geometry {
            Geometry::Box { size } => of.not_negative("size", &size.0)?,
            Geometry::Sphere { radius } => of.not_negative("radius", &[*radius])?,
            Geometry::Cylinder { radius, length } | Geometry::Capsule { radius, length } => {
                of.not_negative("radius", &[*radius])?;
                of.not_negative("length", &[*length])?;
            }
            Geometry::Mesh { .. } => {}
        }
    }
    Ok(())
}

fn check_joint(joint: &Joint) -> Result<(), UrdfError> {
    let of = Named(&joint.name);
    of.pose(&joint.origin)?;
    of.finite("axis", &joint.axis.xyz.0)?;
    if let Some(dynamics) = &joint.dynamics {
        of.not_negative("damping", &[dynamics.damping])?;
        of.not_negative("friction", &[dynamics.friction])?;
    }
    if let Some(mimic) = &joint.mimic {
        of.finite("multiplier", &[mimic.multiplier.unwrap_or(1.0)])?;
        of.finite("offset", &[mimic.offset.unwrap_or(0.0)])?;
    }
    // A range or a speed without end is infinite.
    let limit = &joint.limit;
    for (what, value) in [("lower limit", limit.lower), ("upper limit", limit.upper), ("velocity", limit.velocity)] {
        of.check(what, &[value], |x| !x.is_nan())?;
    }
    Ok(())
}

/// The name of a link or joint.
struct Named<'a>(&'a str);

impl Named<'_> {
    fn pose(&self, pose: &Pose) -> Result<(), UrdfError> {
        self.finite("origin", &pose.xyz.0)?;
        self.finite("orientation", &pose.rpy.0)
    }

    fn finite(&self, what: &'static str, values: &[f64]) -> Result<(), UrdfError> {
        self.check(what, values, f64::is_finite)
    }

    fn not_negative(&self, what: &'static str, values: &[f64]) -> Result<(), UrdfError> {
        self.check(what, values, |x| x >= 0.0 && x.is_finite())
    }

    fn check(&self, what: &'static str, values: &[f64], good: impl Fn(f64) -> bool) -> Result<(), UrdfError> {
        match values.iter().find(|value| !good(**value)) {
            Some(value) => Err(UrdfError::Value { name: self.0.to_owned(), what, value: *value }),
            None => Ok(()),
        }
    }
}
