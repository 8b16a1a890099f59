//! A robot in its world as the engine needs it: bodies in a tree, shapes on them, the floor, the ball.

use super::impulses::Impulses;
use super::touch::{self, Hull, Round};
use super::tree::{Body, Carrier, Posture, Tree};
use super::{Articulated, Floor, Scratch};
use crate::assemble;
use crate::engine::Dof;
use crate::robot::{Base, JointKind, Robot};
use crate::sim::{Ball, Compliance, Setup};
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, Unit, Vector3};
use std::f64::consts::TAU;

/// A hard floor is as stiff as makes the whole robot bounce at this frequency on one point, critically damped.
const HARD_HZ: f64 = 30.0;

impl Articulated {
    /// The robot in its start state.
    pub(crate) fn new(robot: &Robot, setup: &Setup) -> Self {
        let assembled = assemble::bodies(robot);
        let floats = robot.base == Base::Floating;
        let start = Translation3::new(0.0, 0.0, assemble::lift_m(robot, &assembled, setup)) * robot.start;
        let mut bodies: Vec<Body> = carried(robot, &assembled);
        let mut poses = if floats { vec![start] } else { Vec::new() };
        let ball = setup.ball.as_ref().map(|ball| {
            bodies.push(Body::of_ball(ball, poses.len()));
            poses.push(Isometry3::translation(ball.start_m.x, ball.start_m.y, ball.start_m.z));
            let friction = 0.5 * (ball.friction + setup.ground.map_or(0.0, |ground| ground.friction));
            Round { body: bodies.len() - 1, radius: ball.radius_m, friction, restitution: 0.5 * ball.restitution }
        });
        let hulls = hulls(robot, &assembled);
        let joints = || robot.movable().map(|(_, link)| &link.joint);
        let (tree, root, many) = (Tree::new(bodies, start), if floats { 6 } else { 0 }, joints().count());
        let mut u = vec![0.0; tree.freedom()];
        for (u, &velocity) in u[root..root + many].iter_mut().zip(&setup.start_velocities) {
            *u = velocity;
        }
        let now = Posture { q: joints().map(|joint| joint.start).collect(), poses, u };
        let touchable = setup.ground.is_some() || ball.is_some();
        Articulated {
            before: now.u.clone(),
            root,
            fixed: start,
            dofs: vec![Dof::default(); many],
            limits: joints().map(|joint| joint.limits).collect(),
            names: joints().map(|joint| joint.name.clone()).collect(),
            gravity: setup.gravity_m_s2,
            dt_s: setup.dt_s / setup.substeps as f64,
            substeps: setup.substeps,
            floor: touchable.then(|| Floor::new(setup, robot.mass_kg())),
            impulses: Impulses::new(touch::slots(&hulls)),
            hulls: if touchable { hulls } else { Vec::new() },
            ball,
            rolling_damping: setup.ball.map_or(0.0, |ball| ball.rolling_damping_per_s),
            foot_impulses: vec![0.0; robot.links.iter().filter(|link| link.foot).count()],
            scratch: Scratch::new(&now),
            tree,
            now,
        }
    }
}

impl Floor {
    fn new(setup: &Setup, mass_kg: f64) -> Self {
        let angular_frequency = TAU * HARD_HZ;
        let hard =
            Compliance { stiffness: mass_kg * angular_frequency.powi(2), damping: 2.0 * mass_kg * angular_frequency };
        let Compliance { stiffness, damping } = setup.ground.and_then(|ground| ground.compliance).unwrap_or(hard);
        Floor { friction: setup.ground.map(|ground| ground.friction), stiffness, damping }
    }
}

impl Body {
    fn new(body: &assemble::Body, parent: Option<usize>, carrier: Carrier) -> Self {
        Body {
            parent,
            carrier,
            rotation: body.origin.rotation.to_rotation_matrix(),
            place: body.origin.translation.vector,
            mass: body.mass_kg,
            com: body.com_m.coords,
            inertia: body.inertia_kg_m2,
        }
    }

    fn of_ball(ball: &Ball, pose: usize) -> Self {
        Body {
            parent: None,
            carrier: Carrier::Free { pose },
            rotation: Rotation3::identity(),
            place: Vector3::zeros(),
            mass: ball.mass_kg,
            com: Vector3::zeros(),
            inertia: Matrix3::identity() * (0.4 * ball.mass_kg * ball.radius_m.powi(2)),
        }
    }
}

/// The bodies that can move: a root that is bolted down is none.
fn carried(robot: &Robot, assembled: &[assemble::Body]) -> Vec<Body> {
    let bolted = usize::from(robot.base == Base::Fixed);
    let body = |(index, body): (usize, &assemble::Body)| {
        let Some(joint) = index.checked_sub(1) else { return Body::new(body, None, Carrier::Free { pose: 0 }) };
        let along = robot.links[body.link].joint.axis;
        let carrier = match robot.links[body.link].joint.kind {
            JointKind::Prismatic => Carrier::Slide { joint, axis: along.normalize() },
            JointKind::Revolute | JointKind::Fixed => Carrier::Hinge { joint, axis: Unit::new_normalize(along) },
        };
        Body::new(body, body.parent.checked_sub(bolted), carrier)
    };
    assembled.iter().enumerate().skip(bolted).map(body).collect()
}

/// The shapes of the bodies that can move.
fn hulls(robot: &Robot, assembled: &[assemble::Body]) -> Vec<Hull> {
    let bolted = usize::from(robot.base == Base::Fixed);
    let foot =
        |link: usize| robot.links[link].foot.then(|| robot.links[..link].iter().filter(|link| link.foot).count());
    let moving = assembled.iter().skip(bolted).enumerate();
    let shapes =
        moving.flat_map(|(body, assembled)| assembled.shapes.iter().map(move |(link, shape)| (body, *link, shape)));
    shapes.map(|(body, link, shape)| Hull::new(body, foot(link), shape.pose, shape.geometry.clone())).collect()
}

impl Scratch {
    fn new(now: &Posture) -> Self {
        let n = now.u.len();
        Scratch {
            middle: now.clone(),
            matrix: vec![0.0; n * n],
            next: vec![0.0; n],
            share: vec![0.5; n],
            touches: Vec::new(),
            known: Vec::with_capacity(n),
        }
    }
}
