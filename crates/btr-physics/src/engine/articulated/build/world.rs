//! A robot in its world, body by body: the input from which the engine is built.

use crate::engine::articulated::tree::Carrier;
use crate::engine::assemble;
use crate::robot::{Base, Follower, Geometry, JointKind, Robot};
use crate::setup::{Compliance, Setup};
use nalgebra::{Isometry3, Matrix3, Translation3, Vector3};
use std::f64::consts::TAU;

/// Stiffness of a hard floor: with it the whole robot would bounce at this frequency on one contact point, critically
/// damped.
const HARD_HZ: f64 = 30.0;

/// The plain numbers of a robot in its world.
pub(in crate::engine::articulated) struct World {
    pub(in crate::engine::articulated) bodies: Vec<WorldBody>,
    pub(in crate::engine::articulated) poses: Vec<Isometry3<f64>>,
    pub(in crate::engine::articulated) start: Isometry3<f64>,
    pub(in crate::engine::articulated) hulls: Vec<WorldShape>,
    pub(in crate::engine::articulated) q: Vec<f64>,
    pub(in crate::engine::articulated) dq: Vec<f64>,
    pub(in crate::engine::articulated) limits: Vec<(f64, f64)>,
    pub(in crate::engine::articulated) names: Vec<String>,
    pub(in crate::engine::articulated) followers: Vec<Follower>,
    pub(in crate::engine::articulated) root: usize,
    pub(in crate::engine::articulated) feet: usize,
    pub(in crate::engine::articulated) mass_kg: f64,
    pub(in crate::engine::articulated) setup: Setup,
}

/// A body of one robot; see [`TreeBody`].
pub(in crate::engine::articulated) struct WorldBody {
    pub(in crate::engine::articulated) parent: Option<usize>,
    pub(in crate::engine::articulated) carrier: Carrier,
    /// In the joint's frame; zero for free bodies.
    pub(in crate::engine::articulated) axis: Vector3<f64>,
    pub(in crate::engine::articulated) origin: Isometry3<f64>,
    pub(in crate::engine::articulated) mass_kg: f64,
    pub(in crate::engine::articulated) com_m: Vector3<f64>,
    pub(in crate::engine::articulated) inertia_kg_m2: Matrix3<f64>,
}

/// A shape on a body of one robot; see [`Hull`].
pub(in crate::engine::articulated) struct WorldShape {
    pub(in crate::engine::articulated) body: usize,
    pub(in crate::engine::articulated) foot: Option<usize>,
    pub(in crate::engine::articulated) pose: Isometry3<f64>,
    pub(in crate::engine::articulated) geometry: Geometry,
}

impl World {
    pub(in crate::engine::articulated) fn new(robot: &Robot, setup: &Setup) -> Self {
        let assembled = assemble::bodies(robot);
        let floats = robot.base == Base::Floating;
        let start = Translation3::new(0.0, 0.0, assemble::lift_m(robot, &assembled, setup)) * robot.start;
        let mut bodies = carried(robot, &assembled);
        let mut poses = if floats { vec![start] } else { Vec::new() };
        if let Some(ball) = &setup.ball {
            bodies.push(WorldBody::of_ball(ball.mass_kg, ball.radius_m, poses.len()));
            poses.push(Isometry3::translation(ball.start_m.x, ball.start_m.y, ball.start_m.z));
        }
        let joints = || robot.movable().map(|(_, link)| &link.joint);
        let touchable = setup.ground.is_some() || setup.ball.is_some();
        let many = joints().count();
        let moving = setup.start_velocities.iter().copied().chain(std::iter::repeat(0.0));
        let followers = robot.followers();
        let mut dq: Vec<f64> = moving.take(many).collect();
        followers.iter().for_each(|follower| dq[follower.joint] = follower.ratio * dq[follower.leader]);
        World {
            bodies,
            poses,
            start,
            hulls: if touchable { shapes(robot, &assembled) } else { Vec::new() },
            q: joints().map(|joint| joint.start).collect(),
            dq,
            limits: joints().map(|joint| joint.limits).collect(),
            names: joints().map(|joint| joint.name.clone()).collect(),
            followers,
            root: if floats { 6 } else { 0 },
            feet: robot.links.iter().filter(|link| link.foot).count(),
            mass_kg: robot.mass_kg(),
            setup: setup.clone(),
        }
    }

    /// Whether both robots and worlds have the same structure and differ only in values.
    pub(in crate::engine::articulated) fn is_like(&self, other: &World) -> bool {
        let body = |a: &WorldBody, b: &WorldBody| a.parent == b.parent && a.carrier == b.carrier;
        let shape = |a: &WorldShape, b: &WorldShape| {
            let form = std::mem::discriminant(&a.geometry) == std::mem::discriminant(&b.geometry);
            a.body == b.body && a.foot == b.foot && form
        };
        fn pairs(world: &World) -> impl Iterator<Item = (usize, usize)> {
            world.followers.iter().map(|follower| (follower.joint, follower.leader))
        }
        let world = |s: &Setup| (s.dt_s.to_bits(), s.substeps, s.ground.is_some(), s.ball.is_some());
        self.bodies.len() == other.bodies.len()
            && self.hulls.len() == other.hulls.len()
            && self.root == other.root
            && self.feet == other.feet
            && self.names == other.names
            && pairs(self).eq(pairs(other))
            && world(&self.setup) == world(&other.setup)
            && self.bodies.iter().zip(&other.bodies).all(|(a, b)| body(a, b))
            && self.hulls.iter().zip(&other.hulls).all(|(a, b)| shape(a, b))
    }

    /// Stiffness and damping of the floor.
    pub(in crate::engine::articulated) fn compliance(&self) -> Compliance {
        let (mass, angular_frequency) = (self.mass_kg, TAU * HARD_HZ);
        let hard = Compliance { stiffness: mass * angular_frequency.powi(2), damping: 2.0 * mass * angular_frequency };
        self.setup.ground.and_then(|ground| ground.compliance).unwrap_or(hard)
    }
}

impl WorldBody {
    fn new(body: &assemble::MovingBody, parent: Option<usize>, carrier: Carrier, axis: Vector3<f64>) -> Self {
        WorldBody {
            parent,
            carrier,
            axis,
            origin: body.origin,
            mass_kg: body.mass_kg,
            com_m: body.com_m.coords,
            inertia_kg_m2: body.inertia_kg_m2,
        }
    }

    fn of_ball(mass_kg: f64, radius_m: f64, pose: usize) -> Self {
        WorldBody {
            parent: None,
            carrier: Carrier::Free { pose },
            axis: Vector3::zeros(),
            origin: Isometry3::identity(),
            mass_kg,
            com_m: Vector3::zeros(),
            inertia_kg_m2: Matrix3::identity() * (0.4 * mass_kg * radius_m.powi(2)),
        }
    }
}

/// The bodies that can move; a fixed root is not one of them.
fn carried(robot: &Robot, assembled: &[assemble::MovingBody]) -> Vec<WorldBody> {
    let bolted = usize::from(robot.base == Base::Fixed);
    let body = |(index, body): (usize, &assemble::MovingBody)| {
        let Some(joint) = index.checked_sub(1) else {
            return WorldBody::new(body, None, Carrier::Free { pose: 0 }, Vector3::zeros());
        };
        let own = &robot.links[body.link].joint;
        let carrier = match own.kind {
            JointKind::Prismatic => Carrier::Slide { joint },
            JointKind::Revolute | JointKind::Fixed => Carrier::Hinge { joint },
        };
        WorldBody::new(body, body.parent.checked_sub(bolted), carrier, own.axis.normalize())
    };
    assembled.iter().enumerate().skip(bolted).map(body).collect()
}

/// The shapes of the bodies that can move.
fn shapes(robot: &Robot, assembled: &[assemble::MovingBody]) -> Vec<WorldShape> {
    let bolted = usize::from(robot.base == Base::Fixed);
    let foot =
        |link: usize| robot.links[link].foot.then(|| robot.links[..link].iter().filter(|link| link.foot).count());
    let moving = assembled.iter().skip(bolted).enumerate();
    let all =
        moving.flat_map(|(body, assembled)| assembled.shapes.iter().map(move |(link, shape)| (body, *link, shape)));
    all.map(|(body, link, shape)| WorldShape {
        body,
        foot: foot(link),
        pose: shape.pose,
        geometry: shape.geometry.clone(),
    })
    .collect()
}
