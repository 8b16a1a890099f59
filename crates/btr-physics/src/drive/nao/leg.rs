//! Inverse kinematics of a leg.

use crate::robot::{JointKind, Robot};
use nalgebra::{Point3, UnitQuaternion, Vector2, Vector3};

/// Why [`Leg`] does not support a leg.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LegError {
    /// A link that does not exist.
    #[error("the robot has no link `{link}`")]
    Missing {
        /// Its name.
        link: String,
    },
    /// A leg with another structure.
    #[error("link `{link}`: {why}")]
    Shape {
        /// The offending link.
        link: String,
        /// What is unusual about it.
        why: &'static str,
    },
}

/// A leg that goes hip roll, hip pitch, knee pitch, ankle pitch, ankle roll, in a robot with x forward, y left, z up.
///
/// Everything between the two roll axes moves in one plane that contains the hip's roll axis, so the foot's position
/// and the direction of its sole's normal have a closed-form solution: roll of the plane, then two links with a knee.
#[derive(Clone, Debug, PartialEq)]
pub struct Leg {
    /// Positions of the five joints in the order of [`Robot::movable`].
    pub joints: [usize; 5],
    /// Index of the foot in [`Robot::links`].
    pub foot: usize,
    signs: [f64; 5],
    limits: [(f64, f64); 5],
    hip: Vector3<f64>,
    hip_to_pitch: Vector2<f64>,
    thigh: Vector2<f64>,
    shank: Vector2<f64>,
    ankle_to_foot: Vector2<f64>,
}

/// Joint angles for a pose of the foot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegPose {
    /// Hip roll, hip pitch, knee, ankle pitch, ankle roll, in rad, within the joints' limits.
    pub q: [f64; 5],
    /// Whether the foot reaches the pose; otherwise the leg stretches (or folds) towards it as far as it can.
    pub reached: bool,
}

impl Leg {
    /// The leg made of `links`: hip roll, hip pitch, knee, ankle pitch and the foot on the ankle's roll joint. Joints
    /// above the hip's roll stay at 0.
    ///
    /// # Errors
    /// A missing link, axes that are not x, y, y, y, x, rotated joint frames, or sideways offsets.
    pub fn new(robot: &Robot, links: [&str; 5]) -> Result<Leg, LegError> {
        let mut chain = [0; 5];
        let mut signs = [0.0; 5];
        for (i, name) in links.iter().enumerate() {
            chain[i] = robot.link(name).ok_or_else(|| LegError::Missing { link: (*name).to_owned() })?;
            let axis = if i == 0 || i == 4 { Vector3::x() } else { Vector3::y() };
            signs[i] = check_link(robot, chain[i], i.checked_sub(1).map(|above| chain[above]), &axis)?;
        }
        let offset = |i: usize| robot.links[chain[i]].joint.origin.translation.vector;
        Ok(Leg {
            joints: chain.map(|link| robot.movable().take_while(|(i, _)| *i < link).count()),
            foot: chain[4],
            signs,
            limits: chain.map(|link| robot.links[link].joint.limits),
            hip: offset_from_root(robot, chain[0])?,
            hip_to_pitch: offset(1).xz(),
            thigh: offset(2).xz(),
            shank: offset(3).xz(),
            ankle_to_foot: offset(4).xz(),
        })
    }

    /// Angles that place the foot's frame at `foot` with its z axis along the unit vector `normal`, both in the root's
    /// frame. The foot's heading follows from them; it is that of the root when the root is upright.
    pub fn solve(&self, foot: &Point3<f64>, normal: &Vector3<f64>) -> LegPose {
        let from_hip = foot.coords - self.hip;
        let hip_roll = from_hip.y.atan2(-from_hip.z);
        let unroll = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -hip_roll);
        let (foot, normal) = ((unroll * from_hip).xz(), unroll * normal);
        let pitch = normal.x.atan2(normal.z);
        let ankle_roll = (-normal.y).clamp(-1.0, 1.0).asin();

        let ankle = foot - pitched(&self.ankle_to_foot, pitch) - self.hip_to_pitch;
        let (knee, bends) = self.knee(ankle.norm_squared());
        let straight = self.thigh + pitched(&self.shank, knee);
        let hip_pitch = wrapped(ankle.x.atan2(ankle.y) - straight.x.atan2(straight.y));
        let ankle_pitch = wrapped(pitch - hip_pitch - knee);
        self.within_limits([hip_roll, hip_pitch, knee, ankle_pitch, ankle_roll], bends)
    }

    /// The knee angle at the squared distance `distance2_m2` between hip and ankle, and whether there is one.
    fn knee(&self, distance2_m2: f64) -> (f64, bool) {
        let (thigh, shank) = (&self.thigh, &self.shank);
        let lengths = thigh.norm() * shank.norm();
        let cos = (distance2_m2 - thigh.norm_squared() - shank.norm_squared()) / (2.0 * lengths);
        // Angle of the shank against the thigh when the knee is at 0.
        let built_in = (thigh.x * shank.y - thigh.y * shank.x).atan2(thigh.dot(shank));
        (built_in + cos.clamp(-1.0, 1.0).acos(), cos.abs() <= 1.0)
    }

    fn within_limits(&self, angles: [f64; 5], bends: bool) -> LegPose {
        let mut pose = LegPose { q: [0.0; 5], reached: bends };
        for (i, angle) in angles.iter().enumerate() {
            let (low, high) = self.limits[i];
            let angle = angle * self.signs[i];
            pose.q[i] = angle.max(low).min(high);
            pose.reached &= angle >= low && angle <= high;
        }
        pose
    }
}

/// The sign of the link's axis along `axis`, after checking that the link continues a leg from `above`.
fn check_link(robot: &Robot, index: usize, above: Option<usize>, axis: &Vector3<f64>) -> Result<f64, LegError> {
    let link = &robot.links[index];
    let error = |why| Err(LegError::Shape { link: link.name.clone(), why });
    let along = link.joint.axis.dot(axis);
    if link.joint.kind != JointKind::Revolute || along.abs() < 1.0 - 1e-9 {
        return error("its joint must be a hinge about x (rolls) or y (pitches)");
    }
    if above.is_some() && link.parent != above {
        return error("it is not a child of the link above it");
    }
    if above.is_some() && link.joint.origin.translation.vector.y.abs() > 1e-9 {
        return error("its joint is offset sideways from the one above");
    }
    if link.joint.origin.rotation.angle() > 1e-9 {
        return error("its frame is rotated against the one above");
    }
    Ok(along.signum())
}

/// Position of the link's joint in the root's frame when all joints above it are at 0.
fn offset_from_root(robot: &Robot, link: usize) -> Result<Vector3<f64>, LegError> {
    let mut sum = Vector3::zeros();
    let mut at = link;
    while let Some(parent) = robot.links[at].parent {
        let origin = &robot.links[at].joint.origin;
        if origin.rotation.angle() > 1e-9 {
            return Err(LegError::Shape {
                link: robot.links[at].name.clone(),
                why: "its frame is rotated against the one above",
            });
        }
        sum += origin.translation.vector;
        at = parent;
    }
    Ok(sum)
}

/// A vector of the x-z plane rotated about y.
fn pitched(v: &Vector2<f64>, angle: f64) -> Vector2<f64> {
    let (sin, cos) = angle.sin_cos();
    Vector2::new(v.x * cos + v.y * sin, v.y * cos - v.x * sin)
}

/// The same angle in [-pi, pi].
fn wrapped(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    if angle > PI {
        angle - TAU
    } else if angle < -PI {
        angle + TAU
    } else {
        angle
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::presets::nao::nao;
    use crate::robot::kinematics::link_poses;
    use nalgebra::Isometry3;
    use proptest::prelude::*;

    const LEFT: [&str; 5] = ["LHipRoll", "LHipPitch", "LKneePitch", "LAnklePitch", "LAnkleRoll"];
    const RIGHT: [&str; 5] = ["RHipRoll", "RHipPitch", "RKneePitch", "RAnklePitch", "RAnkleRoll"];

    proptest! {
        /// Angles to foot pose and back, for every leg pose with a bent knee.
        #[test]
        fn inverse_kinematics_recovers_the_leg_angles(
            links in prop::sample::select(vec![LEFT, RIGHT]),
            rolls in (-0.37..0.37f64, -0.37..0.37f64),
            pitches in (-1.2..0.48f64, 0.25..2.0f64, -1.0..0.5f64),
        ) {
            let robot = nao();
            let leg = Leg::new(&robot, links).unwrap();
            let angles = [rolls.0, pitches.0, pitches.1, pitches.2, rolls.1];
            let mut q = vec![0.0; robot.movable().count()];
            for (joint, angle) in leg.joints.iter().zip(angles) {
                q[*joint] = angle;
            }
            let mut poses = Vec::new();
            link_poses(&robot, &Isometry3::identity(), &q, &mut poses);
            let foot = poses[leg.foot];
            let pose = leg.solve(&Point3::from(foot.translation.vector), &(foot.rotation * Vector3::z()));
            prop_assert!(pose.reached);
            for (found, angle) in pose.q.iter().zip(angles) {
                prop_assert!((found - angle).abs() < 1e-9, "{:?} for {angles:?}", pose.q);
            }
        }

        /// Beyond its reach the leg stretches towards the foot's position and reports that it does not reach it.
        #[test]
        fn a_leg_stretches_to_what_it_cannot_reach(x in -0.3..0.3f64, y in -0.3..0.3f64) {
            let robot = nao();
            let pose = Leg::new(&robot, LEFT).unwrap().solve(&Point3::new(x, y, -0.5), &Vector3::z());
            prop_assert!(!pose.reached);
            prop_assert!(pose.q.iter().all(|angle| angle.is_finite()));
        }
    }

    #[test]
    fn an_arm_is_not_a_leg() {
        let arm = ["LShoulderPitch", "LShoulderRoll", "LElbowYaw", "LElbowRoll", "HeadYaw"];
        assert!(matches!(Leg::new(&nao(), arm), Err(LegError::Shape { .. })));
        assert!(matches!(Leg::new(&nao(), ["Tail"; 5]), Err(LegError::Missing { .. })));
    }
}
