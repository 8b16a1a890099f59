//! Construction of Rapier's world: settings, bodies, shapes, joints.

use super::convert::{pose, quaternion, vector};
use crate::engine::assemble::MovingBody;
use crate::robot::{Base, Geometry, Joint, JointKind, Robot, Shape};
use crate::setup::{Ball, Compliance, Ground, Setup};
use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use rapier3d_f64::dynamics::{
    GenericJoint, GenericJointBuilder, JointAxesMask, JointAxis, MassProperties, RigidBodyBuilder, RigidBodyHandle,
    SpringCoefficients,
};
use rapier3d_f64::geometry::{ColliderBuilder, ColliderHandle, SharedShape};
use rapier3d_f64::math::Vector;
use rapier3d_f64::pipeline::PhysicsWorld;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Principal moments below this (kg·m²) are raised to it: Rapier inverts them.
const LEAST_INERTIA: f64 = 1e-9;

/// Lower limit of the floor's stiffness (N/m): a spring without stiffness has no frequency.
const LEAST_STIFFNESS: f64 = 1e-3;

/// Sets the integrator's parameters; a compliant floor has its compliance under `mass_kg`.
pub(super) fn configure(world: &mut PhysicsWorld, setup: &Setup, mass_kg: f64) {
    let parameters = &mut world.integration_parameters;
    parameters.dt = setup.dt_s;
    parameters.num_solver_iterations = setup.substeps;
    parameters.max_ccd_substeps = 0;
    parameters.contact_recycling = false;
    parameters.contact_clustering = false;
    // Robots measure decimetres: Rapier's default 5 mm of tolerated penetration would act as a soft floor.
    parameters.normalized_allowed_linear_error = 0.0005;
    if let Some(compliance) = setup.ground.and_then(|ground| ground.compliance) {
        parameters.static_contact_softness = softness(&compliance, mass_kg);
        // Stabilisation would stop contacts within the step, as a hard floor does.
        parameters.num_internal_stabilization_iterations = 0;
        // The spring force must not be limited at large penetrations.
        parameters.normalized_max_corrective_velocity = f64::MAX;
    }
}

/// Rapier's springs are defined by a frequency and a damping ratio, independent of the mass at a contact.
fn softness(compliance: &Compliance, mass_kg: f64) -> SpringCoefficients<f64> {
    let angular_frequency = (compliance.stiffness.max(LEAST_STIFFNESS) / mass_kg).sqrt();
    SpringCoefficients::new(angular_frequency / TAU, compliance.damping / (2.0 * mass_kg * angular_frequency))
}

pub(super) fn add_ground(world: &mut PhysicsWorld, ground: &Ground) {
    let floor = SharedShape::halfspace(Vector::Z);
    world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::new(floor).friction(ground.friction));
}

pub(super) fn add_ball(world: &mut PhysicsWorld, ball: &Ball) -> RigidBodyHandle {
    let inertia = 0.4 * ball.mass_kg * ball.radius_m * ball.radius_m;
    let body = RigidBodyBuilder::dynamic()
        .translation(vector(&ball.start_m.coords))
        .can_sleep(false)
        .angular_damping(ball.rolling_damping_per_s)
        .additional_mass_properties(MassProperties::new(Vector::ZERO, ball.mass_kg, Vector::splat(inertia)));
    let shape = ColliderBuilder::ball(ball.radius_m).density(0.0).friction(ball.friction).restitution(ball.restitution);
    world.insert(body, shape).0
}

pub(super) fn add_bodies(
    world: &mut PhysicsWorld,
    base: Base,
    start: Isometry3<f64>,
    bodies: &[MovingBody],
) -> Vec<RigidBodyHandle> {
    let mut insert = |index: usize, body: &MovingBody| {
        let fixed = index == 0 && base == Base::Fixed;
        let builder = if fixed { RigidBodyBuilder::fixed() } else { RigidBodyBuilder::dynamic() };
        // Only the root's pose matters: the joints place the others.
        let builder = builder
            .pose(pose(&(start * Translation3::from(body.com_m))))
            .can_sleep(false)
            .allow_fast_rotation(true)
            .additional_mass_properties(mass_properties(body.mass_kg, &body.inertia_kg_m2));
        world.insert_body(builder)
    };
    bodies.iter().enumerate().map(|(index, body)| insert(index, body)).collect()
}

/// Adds the shapes; returns the colliders of every foot.
pub(super) fn add_shapes(
    world: &mut PhysicsWorld,
    robot: &Robot,
    bodies: &[MovingBody],
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
        // Rapier's cylinders are aligned with y.
        Geometry::Cylinder { radius_m, half_length_m } => {
            let upright = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2);
            (ColliderBuilder::cylinder(half_length_m, radius_m), shape.pose * upright)
        }
        Geometry::Capsule { radius_m, half_length_m } => {
            (ColliderBuilder::capsule_z(half_length_m, radius_m), shape.pose)
        }
    }
}

pub(super) fn rapier_joint(joint: &Joint, body: &MovingBody, parent: &MovingBody) -> GenericJoint {
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
