//! Joint angles of a biped for given positions of its centre of mass and soles.

use super::cart_table::GRAVITY;
use super::leg::{Leg, LegError};
use crate::robot::kinematics::{Push, center_of_mass, holding_torques, link_poses};
use crate::robot::{Actuator, Geometry, Robot};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

/// Number of iterations. Each leaves about a third of the error, due to the mass of the legs.
const ROUNDS: usize = 4;

/// Target of the body, in the world. Sides are left, then right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stance {
    /// Centre of mass, in m.
    pub com_m: Point3<f64>,
    /// Middle of each sole, in m; soles stay level.
    pub soles_m: [Point3<f64>; 2],
    /// Pitch of the torso, forward positive, in rad.
    pub lean_rad: f64,
}

/// Computes the joint angles of stances; the last torso pose is the initial guess of the next one.
pub struct Posture<'a> {
    robot: &'a Robot,
    legs: [Leg; 2],
    /// From the foot's frame to the middle of its sole.
    soles: [Vector3<f64>; 2],
    root: Isometry3<f64>,
    poses: Vec<Isometry3<f64>>,
    torques: Vec<f64>,
}

impl<'a> Posture<'a> {
    /// For a robot with the Nao's legs, named as in [`crate::presets::nao`].
    ///
    /// # Errors
    /// Legs with another structure, or a foot without a box to stand on.
    pub fn new(robot: &'a Robot) -> Result<Self, LegError> {
        let legs = [leg(robot, "L")?, leg(robot, "R")?];
        let soles = [sole(robot, &legs[0])?, sole(robot, &legs[1])?];
        let torques = vec![0.0; robot.movable().count()];
        Ok(Posture { robot, legs, soles, root: robot.start, poses: Vec::new(), torques })
    }

    /// Writes the legs' joints into `q` (in the order of [`Robot::movable`]); the other joints are read from `q`.
    /// Returns false if a sole is out of reach: the legs then come as close as they can.
    pub fn solve(&mut self, stance: &Stance, q: &mut [f64]) -> bool {
        self.root.rotation = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), stance.lean_rad);
        for _ in 0..ROUNDS {
            self.solve_legs(stance, q);
            link_poses(self.robot, &self.root, q, &mut self.poses);
            self.root.translation.vector += stance.com_m - center_of_mass(self.robot, &self.poses);
        }
        self.solve_legs(stance, q)
    }

    /// Moves the references `q` of the last stance so that position servos, which deflect under load, hold it: by
    /// `share` of torque / kp. The ground carries the weight at `zmp_m`, distributed over the soles by lateral
    /// distance.
    pub fn stiffen(&mut self, stance: &Stance, zmp_m: &Point3<f64>, share: f64, q: &mut [f64]) {
        link_poses(self.robot, &self.root, q, &mut self.poses);
        let weight = self.robot.mass_kg() * GRAVITY;
        let [left, right] = stance.soles_m;
        let on_left = ((zmp_m.y - right.y) / (left.y - right.y)).clamp(0.0, 1.0);
        let pushes = [(0, on_left), (1, 1.0 - on_left)].map(|(side, carried)| Push {
            link: self.legs[side].foot,
            at_m: Point3::new(zmp_m.x, stance.soles_m[side].y, 0.0),
            force_n: Vector3::z() * (carried * weight),
        });
        let down = Vector3::z() * -GRAVITY;
        holding_torques(self.robot, &self.poses, &down, &pushes, &mut self.torques);
        for ((q, torque), (_, link)) in q.iter_mut().zip(&self.torques).zip(self.robot.movable()) {
            if let Actuator::Position { kp, .. } = link.joint.actuator {
                *q += share * torque / kp;
            }
        }
    }

    /// Pose of the root at the last stance.
    pub fn root(&self) -> &Isometry3<f64> {
        &self.root
    }

    /// Middle of each sole in the robot's start pose, in the world.
    pub fn soles_at_start(&mut self) -> [Point3<f64>; 2] {
        let q: Vec<f64> = self.robot.movable().map(|(_, link)| link.joint.start).collect();
        link_poses(self.robot, &self.robot.start, &q, &mut self.poses);
        [0, 1].map(|side| self.poses[self.legs[side].foot] * Point3::from(self.soles[side]))
    }

    fn solve_legs(&self, stance: &Stance, q: &mut [f64]) -> bool {
        let up = self.root.rotation.inverse() * Vector3::z();
        let mut reached = true;
        for side in 0..2 {
            let foot = self.root.inverse_transform_point(&(stance.soles_m[side] - self.soles[side]));
            let pose = self.legs[side].solve(&foot, &up);
            reached &= pose.reached;
            for (&joint, angle) in self.legs[side].joints.iter().zip(pose.q) {
                q[joint] = angle;
            }
        }
        reached
    }
}

/// The leg whose link names begin with `side`.
fn leg(robot: &Robot, side: &str) -> Result<Leg, LegError> {
    let names = ["HipRoll", "HipPitch", "KneePitch", "AnklePitch", "AnkleRoll"].map(|part| format!("{side}{part}"));
    Leg::new(robot, [&names[0], &names[1], &names[2], &names[3], &names[4]])
}

/// From the foot's frame to the middle of the lower side of its box.
fn sole(robot: &Robot, leg: &Leg) -> Result<Vector3<f64>, LegError> {
    let foot = &robot.links[leg.foot];
    let boxed = foot.shapes.iter().find_map(|shape| match shape.geometry {
        Geometry::Box { half_m } => Some(shape.pose.translation.vector - Vector3::z() * half_m.z),
        _ => None,
    });
    boxed.ok_or_else(|| LegError::Shape { link: foot.name.clone(), why: "it has no collision box as a sole" })
}
