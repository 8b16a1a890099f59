//! Conversions between nalgebra, used by robots, and glam, used by Rapier.

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};
use rapier3d_f64::math::{Pose, Rotation, Vector};

pub(super) fn vector(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

pub(super) fn quaternion(q: &UnitQuaternion<f64>) -> Rotation {
    Rotation::from_xyzw(q.i, q.j, q.k, q.w)
}

pub(super) fn pose(p: &Isometry3<f64>) -> Pose {
    Pose::from_parts(vector(&p.translation.vector), quaternion(&p.rotation))
}

pub(super) fn from_vector(v: Vector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

pub(super) fn from_pose(p: &Pose) -> Isometry3<f64> {
    let r = p.rotation;
    let rotation = UnitQuaternion::new_unchecked(Quaternion::new(r.w, r.x, r.y, r.z));
    Isometry3::from_parts(from_vector(p.translation).into(), rotation)
}
