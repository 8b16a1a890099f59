//! Rapier's reduced-coordinate multibody behind [`Dynamics`], in f64 with enhanced determinism.
//!
//! Rapier's habits that this file works around, each pinned by a law in `tests/`: bodies have their frames at the centre of
//! mass (a free root would move wrongly otherwise); default joint damping is cleared; servos are implicit springs, not
//! motor rows; nothing sleeps; self-contacts are off; a body without inertia gets [`LEAST_INERTIA`].

use crate::assemble::{self, Body};
use crate::engine::{BaseState, Dof, Dynamics};
use crate::robot::{Base, Geometry, Joint, JointKind, Robot, Shape};
use crate::sim::{Ball, Ground, Setup};
use nalgebra::{Isometry3, Matrix3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use rapier3d_f64::dynamics::{
    GenericJoint, GenericJointBuilder, JointAxesMask, JointAxis, MassProperties, Multibody, MultibodyIndex,
    RigidBodyBuilder, RigidBodyHandle,
};
use rapier3d_f64::geometry::{ColliderBuilder, ColliderHandle, SharedShape};
use rapier3d_f64::math::{Pose, Rotation, Vector};
use rapier3d_f64::pipeline::PhysicsWorld;
use std::f64::consts::{FRAC_PI_2, PI};

/// Principal moments below this (kg·m²) are raised to it: Rapier inverts them.
const LEAST_INERTIA: f64 = 1e-9;
/// Carries constant torques: as the spring's rest is moved accordingly, only its force counts (N·m/rad).
const LEAST_STIFFNESS: f64 = 1e-9;
/// Faster than this (m/s, rad/s) is a blow-up.
const ABSURD_SPEED: f64 = 1e4;

/// A robot on Rapier.
pub struct Rapier {
    world: PhysicsWorld,
    root: RigidBodyHandle,
    root_com_m: Vector3<f64>,
    floating: bool,
    multibody: Option<MultibodyIndex>,
    joints: Vec<Slot>,
    positions: Vec<f64>,
    velocities: Vec<f64>,
    feet: Vec<Vec<ColliderHandle>>,
    ball: Option<RigidBodyHandle>,
}

/// Where a joint lives in the multibody.
struct Slot {
    link: usize,
    dof: usize,
    /// Rapier's index of the free axis: 0 slides along x, 3 turns about x.
    axis: usize,
    name: String,
}

impl Rapier {
    /// Builds the world of `setup` with the robot in its start state.
    pub fn new(robot: &Robot, setup: &Setup) -> Self {
        let bodies = assemble::bodies(robot);
        let mut world = PhysicsWorld::new();
        world.gravity = vector(&setup.gravity_m_s2);
        configure(&mut world, setup);
        if let Some(ground) = &setup.ground {
            add_ground(&mut world, ground);
        }
        let friction = setup.ground.as_ref().map_or(0.0, |ground| ground.friction);
        let handles = add_bodies(&mut world, robot, &bodies);
        let feet = add_shapes(&mut world, robot, &bodies, &handles, friction);
        let ball = setup.ball.as_ref().map(|ball| add_ball(&mut world, ball));
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

    /// Inserts the joints and notes where they live.
    fn connect(&mut self, robot: &Robot, bodies: &[Body], handles: &[RigidBodyHandle]) {
        for (body, &handle) in bodies.iter().zip(handles).skip(1) {
            let joint = rapier_joint(&robot.links[body.link].joint, body, &bodies[body.parent]);
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
            self.joints.push(Slot { link: link.link_id(), dof: link.assembly_id(), axis, name: joint.name.clone() });
        }
    }

    /// Moves the joints to their start positions and velocities.
    fn start(&mut self, robot: &Robot, bodies: &[Body], velocities: &[f64]) {
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

    /// Copies the joint state out of the multibody.
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
            // A multibody's rigid bodies bear the velocities of the step's beginning, its coordinates those of its end.
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
                return Some(format!("joint `{}` moves at {} per second", slot.name, self.velocities[i]));
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

fn configure(world: &mut PhysicsWorld, setup: &Setup) {
    let parameters = &mut world.integration_parameters;
    parameters.dt = setup.dt_s;
    parameters.num_solver_iterations = setup.substeps;
    parameters.max_ccd_substeps = 0;
    parameters.contact_recycling = false;
    parameters.contact_clustering = false;
    // Robots are decimetres large: Rapier's 5 mm of tolerated penetration would be a soft floor.
    parameters.normalized_allowed_linear_error = 0.0005;
}

fn add_ground(world: &mut PhysicsWorld, ground: &Ground) {
    let floor = SharedShape::halfspace(Vector::Z);
    world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::new(floor).friction(ground.friction));
}

fn add_ball(world: &mut PhysicsWorld, ball: &Ball) -> RigidBodyHandle {
    let inertia = 0.4 * ball.mass_kg * ball.radius_m * ball.radius_m;
    let body = RigidBodyBuilder::dynamic()
        .translation(vector(&ball.start_m.coords))
        .can_sleep(false)
        .angular_damping(ball.rolling_damping_per_s)
        .additional_mass_properties(MassProperties::new(Vector::ZERO, ball.mass_kg, Vector::splat(inertia)));
    let shape = ColliderBuilder::ball(ball.radius_m).density(0.0).friction(ball.friction).restitution(ball.restitution);
    world.insert(body, shape).0
}

fn add_bodies(world: &mut PhysicsWorld, robot: &Robot, bodies: &[Body]) -> Vec<RigidBodyHandle> {
    let mut handles = Vec::with_capacity(bodies.len());
    for (index, body) in bodies.iter().enumerate() {
        let fixed = index == 0 && robot.base == Base::Fixed;
        let builder = if fixed { RigidBodyBuilder::fixed() } else { RigidBodyBuilder::dynamic() };
        let start = if index == 0 { robot.start } else { Isometry3::identity() };
        let builder = builder
            .pose(pose(&(start * Translation3::from(body.com_m))))
            .can_sleep(false)
            .allow_fast_rotation(true)
            .additional_mass_properties(mass_properties(body.mass_kg, &body.inertia_kg_m2));
        handles.push(world.insert_body(builder));
    }
    handles
}

/// Adds the shapes; gives back the colliders of every foot.
fn add_shapes(
    world: &mut PhysicsWorld,
    robot: &Robot,
    bodies: &[Body],
    handles: &[RigidBodyHandle],
    friction: f64,
) -> Vec<Vec<ColliderHandle>> {
    let mut of_link = vec![Vec::new(); robot.links.len()];
    for (body, &handle) in bodies.iter().zip(handles) {
        for (link, shape) in &body.shapes {
            let (builder, in_link) = collider(shape);
            let in_body = Translation3::from(-body.com_m.coords) * in_link;
            let collider = builder.position(pose(&in_body)).density(0.0).friction(friction);
            of_link[*link].push(world.insert_collider(collider, Some(handle)));
        }
    }
    robot.links.iter().zip(of_link).filter(|(link, _)| link.foot).map(|(_, colliders)| colliders).collect()
}

/// The collider of a shape, at its pose in the link's frame.
fn collider(shape: &Shape) -> (ColliderBuilder, Isometry3<f64>) {
    match shape.geometry {
        Geometry::Box { half_m } => (ColliderBuilder::cuboid(half_m.x, half_m.y, half_m.z), shape.pose),
        Geometry::Sphere { radius_m } => (ColliderBuilder::ball(radius_m), shape.pose),
        // Rapier's cylinders stand along y.
        Geometry::Cylinder { radius_m, half_length_m } => {
            let upright = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2);
            (ColliderBuilder::cylinder(half_length_m, radius_m), shape.pose * upright)
        }
        Geometry::Capsule { radius_m, half_length_m } => {
            (ColliderBuilder::capsule_z(half_length_m, radius_m), shape.pose)
        }
    }
}

fn rapier_joint(joint: &Joint, body: &Body, parent: &Body) -> GenericJoint {
    let (locked, axis) = match joint.kind {
        JointKind::Prismatic => (JointAxesMask::LOCKED_PRISMATIC_AXES, JointAxis::LinX),
        JointKind::Revolute | JointKind::Fixed => (JointAxesMask::LOCKED_REVOLUTE_AXES, JointAxis::AngX),
    };
    // Rapier's joints move along or about x.
    let towards_axis = UnitQuaternion::rotation_between(&Vector3::x(), &joint.axis)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), PI));
    let in_parent = Translation3::from(-parent.com_m.coords) * body.origin * towards_axis;
    let in_body = Translation3::from(-body.com_m.coords) * towards_axis;
    let mut builder = GenericJointBuilder::new(locked)
        .local_frame1(pose(&in_parent))
        .local_frame2(pose(&in_body))
        .contacts_enabled(false);
    if joint.limits.0.is_finite() || joint.limits.1.is_finite() {
        builder = builder.limits(axis, [joint.limits.0.max(-f64::MAX), joint.limits.1.min(f64::MAX)]);
    }
    builder.build()
}

fn mass_properties(mass_kg: f64, inertia: &Matrix3<f64>) -> MassProperties {
    let eigen = inertia.symmetric_eigen();
    let mut axes = eigen.eigenvectors;
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    let principal = eigen.eigenvalues.map(|moment| moment.max(LEAST_INERTIA));
    let rotation = UnitQuaternion::from_matrix(&axes);
    MassProperties::with_principal_inertia_frame(Vector::ZERO, mass_kg, vector(&principal), quaternion(&rotation))
}

fn vector(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

fn quaternion(q: &UnitQuaternion<f64>) -> Rotation {
    Rotation::from_xyzw(q.i, q.j, q.k, q.w)
}

fn pose(p: &Isometry3<f64>) -> Pose {
    Pose::from_parts(vector(&p.translation.vector), quaternion(&p.rotation))
}

fn from_vector(v: Vector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

fn from_pose(p: &Pose) -> Isometry3<f64> {
    let r = p.rotation;
    let rotation = UnitQuaternion::new_unchecked(Quaternion::new(r.w, r.x, r.y, r.z));
    Isometry3::from_parts(from_vector(p.translation).into(), rotation)
}
