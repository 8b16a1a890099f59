//! Small robots and helpers of the tests.

use btr_core::log::Log;
use btr_physics::drive::Drive;
use btr_physics::effects::{PlacedEffect, find};
use btr_physics::robot::{Actuator, Base, Geometry, Joint, JointKind, Link, Robot, Shape};
use btr_physics::rollout::{RolloutRequest, simulate};
use btr_physics::setup::{EngineName, Setup};
use nalgebra::{Isometry3, Point3, Vector3};

pub(crate) const G: f64 = 9.81;

/// Btr's own engine and the reference.
pub(crate) const ENGINES: [EngineName; 2] = [EngineName::Auto, EngineName::Rapier];

/// The same setup on this engine.
pub(crate) fn on(engine: EngineName, setup: &Setup) -> Setup {
    Setup { engine, ..setup.clone() }
}

/// A drive from a function of time, the same for all joints.
pub(crate) struct Told<F>(pub(crate) F);

impl<F: Fn(f64) -> f64 + Send + Sync> Drive for Told<F> {
    fn command(&self, time_s: f64, command: &mut [f64]) {
        command.fill((self.0)(time_s));
    }
}

/// A constant command for every joint.
pub(crate) fn hold(value: f64) -> Told<impl Fn(f64) -> f64 + Send + Sync> {
    Told(move |_| value)
}

/// References at every step, no floor, on the reference engine.
pub(crate) fn setup(dt_s: f64, duration_s: f64) -> Setup {
    Setup { dt_s, duration_s, control_s: dt_s, ground: None, engine: EngineName::Rapier, ..Setup::default() }
}

pub(crate) fn weightless(dt_s: f64, duration_s: f64) -> Setup {
    Setup { gravity_m_s2: Vector3::zeros(), ..setup(dt_s, duration_s) }
}

/// The same on btr's own engine.
pub(crate) fn fast(dt_s: f64, duration_s: f64) -> Setup {
    Setup { engine: EngineName::Auto, ..setup(dt_s, duration_s) }
}

pub(crate) fn fast_weightless(dt_s: f64, duration_s: f64) -> Setup {
    Setup { engine: EngineName::Auto, ..weightless(dt_s, duration_s) }
}

pub(crate) fn run(robot: &Robot, setup: &Setup, drive: &dyn Drive) -> Log {
    simulate(RolloutRequest::new(robot, drive).setup(setup)).unwrap()
}

pub(crate) fn run_with(robot: &Robot, effects: &[PlacedEffect], setup: &Setup, drive: &dyn Drive) -> Log {
    simulate(RolloutRequest::new(robot, drive).setup(setup).effects(effects)).unwrap()
}

pub(crate) fn placed(name: &str, site: &str, values: &[f64]) -> PlacedEffect {
    PlacedEffect { effect: find(name).unwrap(), site: site.to_owned(), values: values.to_vec() }
}

pub(crate) fn last(log: &Log, channel: &str) -> f64 {
    *log.values(channel).unwrap().last().unwrap()
}

/// A desk-size arm of three joints (yaw, pitch, pitch) with PID servos, bolted to a table.
pub(crate) fn arm() -> Robot {
    let part = |name: &str, axis: Vector3<f64>, below_m: f64, mass_kg: f64, length_m: f64| {
        let half_m = Vector3::new(0.02, 0.02, 0.5 * length_m);
        let actuator = Actuator::Position { kp: 20.0, ki: 10.0, kd: 0.5, max_torque: f64::INFINITY };
        let origin = Isometry3::translation(0.0, 0.0, below_m);
        Link {
            name: name.to_owned(),
            parent: None,
            joint: Joint { actuator, start: 0.3, ..Joint::new(name, JointKind::Revolute, origin, axis) },
            mass_kg,
            com_m: Point3::new(0.01, 0.0, 0.5 * length_m),
            inertia_kg_m2: Geometry::Box { half_m }.inertia_kg_m2(mass_kg),
            shapes: vec![],
            mesh_boxes: vec![],
            foot: false,
        }
    };
    let mut links = vec![
        part("table", Vector3::z(), 0.0, 5.0, 0.1),
        part("waist", Vector3::z(), 0.1, 0.5, 0.1),
        part("shoulder", Vector3::y(), 0.1, 0.25, 0.15),
        part("elbow", Vector3::y(), 0.15, 0.2, 0.15),
    ];
    links.iter_mut().skip(1).enumerate().for_each(|(i, link)| link.parent = Some(i));
    Robot { name: "arm".to_owned(), base: Base::Fixed, start: Isometry3::identity(), links }
}

/// A free box with its frame away from its centre of mass.
pub(crate) fn brick(half_m: Vector3<f64>, mass_kg: f64, offset_m: Vector3<f64>) -> Robot {
    let geometry = Geometry::Box { half_m };
    let link = Link {
        name: "brick".to_owned(),
        parent: None,
        joint: Joint::new("root", JointKind::Fixed, Isometry3::identity(), Vector3::z()),
        mass_kg,
        com_m: Point3::from(offset_m),
        inertia_kg_m2: geometry.inertia_kg_m2(mass_kg),
        shapes: vec![Shape { pose: Isometry3::translation(offset_m.x, offset_m.y, offset_m.z), geometry }],
        mesh_boxes: vec![],
        foot: true,
    };
    Robot { name: "brick".to_owned(), base: Base::Floating, start: Isometry3::identity(), links: vec![link] }
}

/// A free body with a driven arm on its side.
pub(crate) fn swimmer(actuator: Actuator) -> Robot {
    let mut robot = brick(Vector3::new(0.1, 0.06, 0.03), 1.0, Vector3::new(0.03, -0.02, 0.01));
    let mut arm = robot.links[0].clone();
    let origin = Isometry3::new(Vector3::new(0.1, 0.05, 0.02), Vector3::new(0.3, -0.4, 0.2));
    arm.name = "arm".to_owned();
    arm.parent = Some(0);
    arm.mass_kg = 0.6;
    arm.com_m = Point3::new(0.02, 0.15, -0.03);
    arm.joint = Joint { actuator, ..Joint::new("shoulder", JointKind::Revolute, origin, Vector3::new(0.6, 0.0, 0.8)) };
    robot.links.push(arm);
    robot
}

/// Poses of all links in the world, from base pose and joint positions.
pub(crate) fn poses(robot: &Robot, base: Isometry3<f64>, q: &[f64]) -> Vec<Isometry3<f64>> {
    let mut q = q.iter();
    let mut poses = vec![base];
    for link in &robot.links[1..] {
        let joint = &link.joint;
        let moved = match joint.kind {
            JointKind::Fixed => Isometry3::identity(),
            JointKind::Revolute => Isometry3::rotation(joint.axis * *q.next().unwrap()),
            JointKind::Prismatic => Isometry3::from_parts((joint.axis * *q.next().unwrap()).into(), nalgebra::one()),
        };
        poses.push(poses[link.parent.unwrap()] * joint.origin * moved);
    }
    poses
}

/// The robot's centre of mass in sample `i` of a log.
pub(crate) fn centre_of_mass(robot: &Robot, log: &Log, i: usize) -> Vector3<f64> {
    let at = |name: &str| log.values(name).unwrap()[i];
    let rotation = nalgebra::Quaternion::new(at("base_qw"), at("base_qx"), at("base_qy"), at("base_qz"));
    let translation = nalgebra::Translation3::new(at("base_x"), at("base_y"), at("base_z"));
    let base = Isometry3::from_parts(translation, nalgebra::UnitQuaternion::from_quaternion(rotation));
    let q: Vec<f64> = robot.movable().map(|(_, link)| at(&format!("q_{}", link.joint.name))).collect();
    let poses = poses(robot, base, &q);
    let moments = robot.links.iter().zip(&poses).map(|(link, pose)| (pose * link.com_m).coords * link.mass_kg);
    moments.sum::<Vector3<f64>>() / robot.mass_kg()
}
