//! Rapier's reduced-coordinate multibody behind [`Dynamics`], in f64 with enhanced determinism.
//!
//! This file adapts to the following of Rapier's properties, each tested by a law in `tests/`. Bodies have their frames
//! at the centre of mass (a floating root would move wrongly otherwise). Default joint damping is cleared. Servos are
//! implicit springs, not motor rows. Bodies never sleep. Self-contacts are off. A body without inertia gets a small
//! one.

mod build;
mod convert;

use super::assemble;
use super::assemble::MovingBody;
use super::{BaseState, Dof, Dynamics, RobotState};
use crate::robot::{Base, JointKind, Robot};
use crate::setup::Setup;
use convert::{from_pose, from_vector, pose, vector};
use nalgebra::{Point3, Translation3, Vector3};
use rapier3d_f64::dynamics::{Multibody, MultibodyIndex, RigidBodyHandle};
use rapier3d_f64::geometry::ColliderHandle;
use rapier3d_f64::pipeline::PhysicsWorld;

/// Stiffness of the spring that applies a constant torque (N·m/rad): its rest position is offset so that only its force
/// counts.
const LEAST_STIFFNESS: f64 = 1e-9;
/// Displacements below this (m, rad) are rounding.
const UNMOVED: f64 = 1e-12;
/// A speed above this (m/s, rad/s) counts as divergence.
const ABSURD_SPEED: f64 = 1e4;

/// A robot on Rapier.
pub struct Rapier {
    world: PhysicsWorld,
    root: RigidBodyHandle,
    root_com_m: Vector3<f64>,
    floating: bool,
    multibody: Option<MultibodyIndex>,
    joints: Vec<JointSlot>,
    positions: Vec<f64>,
    velocities: Vec<f64>,
    feet: Vec<Vec<ColliderHandle>>,
    ball: Option<RigidBodyHandle>,
}

/// A joint's indices in the multibody.
struct JointSlot {
    link: usize,
    dof: usize,
    /// Rapier's index of the free axis: 0 is translation along x, 3 rotation about x.
    axis: usize,
    name: String,
}

impl Rapier {
    /// Builds the world of `setup` with the robot in its start state.
    pub fn new(robot: &Robot, setup: &Setup) -> Self {
        let bodies = assemble::bodies(robot);
        let mut world = PhysicsWorld::new();
        world.gravity = vector(&setup.gravity_m_s2);
        build::configure(&mut world, setup, robot.mass_kg());
        if let Some(ground) = &setup.ground {
            build::add_ground(&mut world, ground);
        }
        let friction = setup.ground.as_ref().map_or(0.0, |ground| ground.friction);
        let lift = assemble::lift_m(robot, &bodies, setup);
        let start = Translation3::new(0.0, 0.0, lift) * robot.start;
        let handles = build::add_bodies(&mut world, robot.base, start, &bodies);
        let feet = build::add_shapes(&mut world, robot, &bodies, &handles, friction);
        let ball = setup.ball.as_ref().map(|ball| build::add_ball(&mut world, ball));
        let mut engine = Rapier {
            world,
            root: handles[0],
            root_com_m: bodies[0].com_m.coords,
            floating: robot.base == Base::Floating,
            multibody: None,
            joints: Vec::new(),
            positions: vec![0.0; bodies.len() - 1],
            velocities: vec![0.0; bodies.len() - 1],
            feet,
            ball,
        };
        engine.connect(robot, &bodies, &handles);
        engine.start(robot, &bodies, &setup.start_velocities);
        engine
    }

    /// Inserts the joints and stores their indices.
    fn connect(&mut self, robot: &Robot, bodies: &[MovingBody], handles: &[RigidBodyHandle]) {
        for (body, &handle) in bodies.iter().zip(handles).skip(1) {
            let joint = build::rapier_joint(&robot.links[body.link].joint, body, &bodies[body.parent]);
            self.world.insert_multibody_joint(handles[body.parent], handle, joint);
        }
        let Some(&link) = handles.get(1).and_then(|&first| self.world.multibody_joints.rigid_body_link(first)) else {
            return;
        };
        self.multibody = Some(link.multibody);
        let Some(multibody) = self.world.multibody_joints.get_multibody_mut(link.multibody) else { return };
        multibody.forward_kinematics(&self.world.bodies, true);
        multibody.set_self_contacts_enabled(false);
        multibody.damping_mut().fill(0.0);
        for (body, &handle) in bodies.iter().zip(handles).skip(1) {
            let found = multibody.links().find(|link| link.rigid_body_handle() == handle);
            let Some(link) = found else { continue };
            let joint = &robot.links[body.link].joint;
            let axis = if joint.kind == JointKind::Prismatic { 0 } else { 3 };
            self.joints.push(JointSlot {
                link: link.link_id(),
                dof: link.assembly_id(),
                axis,
                name: joint.name.clone(),
            });
        }
    }

    /// Moves the joints to their start positions and velocities.
    fn start(&mut self, robot: &Robot, bodies: &[MovingBody], velocities: &[f64]) {
        let Some(index) = self.multibody else { return };
        let Some(multibody) = self.world.multibody_joints.get_multibody_mut(index) else { return };
        let mut displacement = vec![0.0; multibody.ndofs()];
        for (slot, body) in self.joints.iter().zip(&bodies[1..]) {
            displacement[slot.dof] = robot.links[body.link].joint.start;
        }
        multibody.apply_displacements(&displacement);
        for (slot, &velocity) in self.joints.iter().zip(velocities) {
            multibody.generalized_velocity_mut()[slot.dof] = velocity;
        }
        multibody.forward_kinematics(&self.world.bodies, false);
        multibody.update_rigid_bodies(&mut self.world.bodies, true);
        self.read();
    }

    /// Moves shapes to their bodies. Rapier does so only after a step, so the next step would detect contacts at the
    /// old poses.
    fn carry_shapes(&mut self) {
        for (_, collider) in self.world.colliders.iter_mut() {
            let body = collider.parent().map(|handle| *self.world.bodies[handle].position());
            if let Some((body, in_body)) = body.zip(collider.position_wrt_parent().copied()) {
                collider.set_position(body * in_body);
            }
        }
    }

    /// Copies the joint states out of the multibody.
    fn read(&mut self) {
        let Some(multibody) = self.multibody.and_then(|i| self.world.multibody_joints.get_multibody(i)) else {
            return;
        };
        let velocities = multibody.generalized_velocity();
        for (i, slot) in self.joints.iter().enumerate() {
            self.positions[i] = multibody.link(slot.link).map_or(f64::NAN, |link| link.joint().coords()[slot.axis]);
            self.velocities[i] = velocities[slot.dof];
        }
    }

    /// Velocity of the root's centre of mass and its angular velocity.
    fn root_velocity(&self) -> (Vector3<f64>, Vector3<f64>) {
        if !self.floating {
            return (Vector3::zeros(), Vector3::zeros());
        }
        let multibody: Option<&Multibody> = self.multibody.and_then(|i| self.world.multibody_joints.get_multibody(i));
        match multibody {
            // A multibody's rigid bodies have the velocities of the step's beginning, its coordinates those of its end.
            Some(multibody) => {
                let v = multibody.generalized_velocity();
                (Vector3::new(v[0], v[1], v[2]), Vector3::new(v[3], v[4], v[5]))
            }
            None => {
                let body = &self.world.bodies[self.root];
                (from_vector(body.linvel()), from_vector(body.angvel()))
            }
        }
    }
}

impl Dynamics for Rapier {
    fn positions(&self) -> &[f64] {
        &self.positions
    }

    fn velocities(&self) -> &[f64] {
        &self.velocities
    }

    fn place(&mut self, state: &RobotState) {
        let BaseState { pose: base, velocity_m_s, angular_rad_s } = state.base;
        let centre = base * Translation3::from(self.root_com_m);
        let velocity = velocity_m_s + angular_rad_s.cross(&(base.rotation * self.root_com_m));
        let was = from_pose(self.world.bodies[self.root].position());
        let Some(multibody) = self.multibody.and_then(|i| self.world.multibody_joints.get_multibody_mut(i)) else {
            let body = &mut self.world.bodies[self.root];
            body.set_position(pose(&centre), true);
            body.set_linvel(vector(&velocity), true);
            body.set_angvel(vector(&angular_rad_s), true);
            return;
        };
        let mut displacement = vec![0.0; multibody.ndofs()];
        if self.floating {
            let moved = centre.translation.vector - was.translation.vector;
            let turned = (centre.rotation * was.rotation.inverse()).scaled_axis();
            displacement[..3].copy_from_slice(moved.as_slice());
            displacement[3..6].copy_from_slice(turned.as_slice());
            multibody.generalized_velocity_mut().as_mut_slice()[..3].copy_from_slice(velocity.as_slice());
            multibody.generalized_velocity_mut().as_mut_slice()[3..6].copy_from_slice(angular_rad_s.as_slice());
        }
        for ((slot, &(q, dq)), was) in self.joints.iter().zip(&state.joints).zip(&self.positions) {
            displacement[slot.dof] = q - was;
            multibody.generalized_velocity_mut()[slot.dof] = dq;
        }
        // Bodies that are reported as moved make Rapier sort its contacts anew, and its solver's few sweeps give
        // another result in another order. Setting the present state must change nothing.
        if displacement.iter().any(|x| x.abs() > UNMOVED) {
            multibody.apply_displacements(&displacement);
            multibody.forward_kinematics(&self.world.bodies, false);
            multibody.update_rigid_bodies(&mut self.world.bodies, true);
            self.carry_shapes();
        }
        self.read();
    }

    fn set_joint(&mut self, joint: usize, dof: &Dof) {
        let (slot, q) = (&self.joints[joint], self.positions[joint]);
        let Some(multibody) = self.multibody.and_then(|i| self.world.multibody_joints.get_multibody_mut(i)) else {
            return;
        };
        multibody.armature_mut()[slot.dof] = dof.armature;
        multibody.frictions_mut()[slot.dof] = dof.dry_friction;
        multibody.damping_mut()[slot.dof] = dof.torque.damping;
        let stiffness = dof.torque.stiffness.max(LEAST_STIFFNESS);
        let rest = q + (dof.torque.constant - dof.torque.stiffness * q) / stiffness;
        if let Some(link) = multibody.link_mut(slot.link) {
            link.joint.set_spring(slot.axis, stiffness, rest);
        }
    }

    fn step(&mut self) {
        self.world.step();
        self.read();
    }

    fn base(&self) -> BaseState {
        let body = self.world.bodies[self.root].position();
        let pose = from_pose(body) * Translation3::from(-self.root_com_m);
        let (velocity, angular) = self.root_velocity();
        let arm = pose.rotation * -self.root_com_m;
        BaseState { pose, velocity_m_s: velocity + angular.cross(&arm), angular_rad_s: angular }
    }

    fn foot_force_n(&self, foot: usize) -> f64 {
        let pairs = self.feet[foot].iter().flat_map(|&collider| self.world.contact_pairs_with(collider));
        let points = pairs.flat_map(|pair| pair.manifolds()).flat_map(|manifold| &manifold.points);
        points.map(|point| point.data.impulse).sum::<f64>() / self.world.integration_parameters.dt
    }

    fn ball(&self) -> Option<Point3<f64>> {
        self.ball.map(|handle| Point3::from(from_vector(self.world.bodies[handle].translation())))
    }

    fn trouble(&self) -> Option<String> {
        let wild = |x: f64| !x.is_finite() || x.abs() > ABSURD_SPEED;
        for (i, slot) in self.joints.iter().enumerate() {
            if wild(self.velocities[i]) || !self.positions[i].is_finite() {
                return Some(format!("joint `{}` moves at {:.1e} per second", slot.name, self.velocities[i]));
            }
        }
        let (velocity, angular) = self.root_velocity();
        if wild(velocity.norm()) || wild(angular.norm()) {
            return Some(format!("the base moves at {} m/s and turns at {} rad/s", velocity.norm(), angular.norm()));
        }
        let lost = self.world.quarantine().bodies();
        (!lost.is_empty()).then(|| format!("{} bodies have poses that are not numbers", lost.len()))
    }
}
