//! Forward kinematics and static holding torques.

use super::{Joint, JointKind, Robot};
use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};

/// Poses of all links in the world, for the root's frame at `root` and the movable joints at `q` (rad or m, in the
/// order of [`Robot::movable`]; missing values count as 0). `poses` is overwritten and keeps its memory between calls.
pub fn link_poses(robot: &Robot, root: &Isometry3<f64>, q: &[f64], poses: &mut Vec<Isometry3<f64>>) {
    poses.clear();
    let mut q = q.iter().copied();
    for link in &robot.links {
        let Some(parent) = link.parent else {
            poses.push(*root);
            continue;
        };
        let joint = &link.joint;
        let q = if joint.moves() { q.next().unwrap_or(0.0) } else { 0.0 };
        poses.push(joint.at(&poses[parent], q));
    }
}

impl Joint {
    /// Whether it can move.
    pub fn moves(&self) -> bool {
        self.kind != JointKind::Fixed
    }

    /// The link's frame in the parent's frame, at a position in rad or m.
    pub fn pose(&self, q: f64) -> Isometry3<f64> {
        self.at(&Isometry3::identity(), q)
    }

    /// The link's frame in the world, for the parent's frame there.
    fn at(&self, parent: &Isometry3<f64>, q: f64) -> Isometry3<f64> {
        let at_zero = parent * self.origin;
        match self.kind {
            JointKind::Fixed => at_zero,
            JointKind::Revolute => at_zero * UnitQuaternion::from_axis_angle(&Unit::new_unchecked(self.axis), q),
            JointKind::Prismatic => at_zero * Translation3::from(self.axis * q),
        }
    }
}

/// The robot's centre of mass in the world, in m, for links at `poses`.
pub fn center_of_mass(robot: &Robot, poses: &[Isometry3<f64>]) -> Point3<f64> {
    let moment: Vector3<f64> =
        robot.links.iter().zip(poses).map(|(link, pose)| (pose * link.com_m).coords * link.mass_kg).sum();
    Point3::from(moment / robot.mass_kg())
}

/// A force in N at a point in m on one link, both in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Push {
    /// Index of the link.
    pub link: usize,
    /// Where it acts.
    pub at_m: Point3<f64>,
    /// The force.
    pub force_n: Vector3<f64>,
}

/// Torques (N·m; N for slides) with which the movable joints hold the robot still at `poses` against `gravity_m_s2` and
/// `pushes`, in the order of [`Robot::movable`]. An ideal support at the root carries the remaining force.
pub fn holding_torques(
    robot: &Robot,
    poses: &[Isometry3<f64>],
    gravity_m_s2: &Vector3<f64>,
    pushes: &[Push],
    torques: &mut [f64],
) {
    for ((link, _), torque) in robot.movable().zip(torques) {
        let joint = &robot.links[link].joint;
        let anchor = poses[link].translation.vector;
        let mut force = Vector3::zeros();
        let mut moment = Vector3::zeros();
        let mut add = |at: &Point3<f64>, f: Vector3<f64>| {
            force += f;
            moment += (at.coords - anchor).cross(&f);
        };
        for (i, carried) in robot.links.iter().enumerate().filter(|(i, _)| carries(robot, link, *i)) {
            add(&(poses[i] * carried.com_m), gravity_m_s2 * carried.mass_kg);
        }
        for push in pushes.iter().filter(|push| carries(robot, link, push.link)) {
            add(&push.at_m, push.force_n);
        }
        let axis = poses[link] * joint.axis;
        *torque = -axis.dot(if joint.kind == JointKind::Prismatic { &force } else { &moment });
    }
}

/// Whether `link` is `ancestor` or a descendant of it.
fn carries(robot: &Robot, ancestor: usize, link: usize) -> bool {
    link == ancestor || robot.links[link].parent.is_some_and(|parent| carries(robot, ancestor, parent))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::presets::nao::nao;
    use proptest::prelude::*;

    const DOWN: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

    /// Potential energy of gravity and of a constant force on the left foot, in J.
    fn potential(robot: &Robot, q: &[f64], force: &Vector3<f64>) -> f64 {
        let mut poses = Vec::new();
        link_poses(robot, &robot.start, q, &mut poses);
        let foot = poses[22] * Point3::new(0.05, 0.01, -0.05);
        -DOWN.dot(&center_of_mass(robot, &poses).coords) * robot.mass_kg() - force.dot(&foot.coords)
    }

    proptest! {
        /// Virtual work: the torque that holds a joint is the slope of the potential along it.
        #[test]
        fn holding_torques_are_the_slope_of_the_potential(
            q in prop::collection::vec(-1.0..1.0f64, 22),
            force in prop::array::uniform3(-20.0..20.0f64),
        ) {
            let robot = nao();
            let force = Vector3::from(force);
            let mut poses = Vec::new();
            link_poses(&robot, &robot.start, &q, &mut poses);
            let push = Push { link: 22, at_m: poses[22] * Point3::new(0.05, 0.01, -0.05), force_n: force };
            let mut torques = vec![0.0; 22];
            holding_torques(&robot, &poses, &DOWN, &[push], &mut torques);
            for i in 0..22 {
                let [before, after] = [-1e-5, 1e-5].map(|step| {
                    let mut moved = q.clone();
                    moved[i] += step;
                    potential(&robot, &moved, &force)
                });
                prop_assert!((torques[i] - (after - before) / 2e-5).abs() < 1e-6, "joint {i}");
            }
        }
    }

    #[test]
    fn lowering_the_arms_lowers_the_center_of_mass() {
        let robot = nao();
        let mut poses = Vec::new();
        let mut q = vec![0.0; robot.movable().count()];
        link_poses(&robot, &robot.start, &q, &mut poses);
        let before = center_of_mass(&robot, &poses);
        for (i, _) in robot.movable().enumerate().filter(|(_, (_, link))| link.name.ends_with("ShoulderPitch")) {
            q[i] = std::f64::consts::FRAC_PI_2;
        }
        link_poses(&robot, &robot.start, &q, &mut poses);
        let after = center_of_mass(&robot, &poses);
        // Per arm: 0.11 kg at 0.02 m, 0.03 kg at 0.09 m and 0.06 kg at 0.14 m in front of the shoulder, the last two
        // 0.01 m above it; turned down, forward becomes down and up becomes forward.
        let forward = 0.11 * 0.02 + 0.03 * 0.09 + 0.06 * 0.14;
        let up = (0.03 + 0.06) * 0.01;
        assert!((after.z - before.z - 2.0 * (-forward - up) / 4.34).abs() < 1e-12);
        assert!((after.x - before.x - 2.0 * (up - forward) / 4.34).abs() < 1e-12);
        assert!(after.y.abs() < 1e-12);
    }
}
