//! Benchmark scenes: the ant's tripod gait and the Nao's walk, with the sensors of the paper's robots, and an arm of
//! four joints.

use btr_core::log::Log;
use btr_core::world::WorldError;
use btr_physics::drive::{Drive, MotionError, NaoWalk};
use btr_physics::presets::ant;
use btr_physics::presets::nao::{CONTROL_S, nao};
use btr_physics::robot::{Actuator, Base, Joint, JointKind, Link, Robot};
use btr_physics::rollout::{RolloutRequest, simulate_all};
use btr_physics::setup::{EngineName, Setup};
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

/// The scenes by name.
pub(crate) const NAMES: [&str; 3] = ["ant", "nao", "arm"];
/// The physics engines as model files name them.
pub(crate) const ENGINES: [&str; 2] = ["auto", "rapier"];

/// A robot in its start state, its world and its drive.
pub(crate) struct Scene {
    pub(crate) robot: Robot,
    pub(crate) setup: Setup,
    pub(crate) drive: Box<dyn Drive>,
}

impl Scene {
    /// The Nao for the name `nao`, an arm for `arm`, otherwise the ant; on the reference engine for `rapier`, otherwise
    /// on btr's own.
    pub(crate) fn new(name: &str, engine: &str, dt_s: f64, duration_s: f64) -> Result<Self, MotionError> {
        let engine = if engine == "rapier" { EngineName::Rapier } else { EngineName::Auto };
        let mut setup = Setup { dt_s, duration_s, control_s: CONTROL_S, interpolate: true, engine, ..Setup::default() };
        let (mut robot, drive): (Robot, Box<dyn Drive>) = match name {
            "nao" => (nao(), walk(duration_s)?),
            "arm" => {
                setup.ground = None;
                (arm(), Box::new(Swing))
            }
            _ => (ant(), Box::new(ant::tripod())),
        };
        drive.place(&mut robot);
        Ok(Scene { robot, setup, drive })
    }

    /// The robot of a candidate, with masses varied by up to a tenth. The first has the nominal masses.
    fn robot_of(&self, number: usize) -> Robot {
        let mut robot = self.robot.clone();
        for (i, link) in robot.links.iter_mut().enumerate() {
            link.mass_kg *= 1.0 + 0.1 * ((number * (i + 1)) as f64).sin();
        }
        robot
    }

    /// Simulates a population of such robots at once, from building their worlds to their logs, which have one sample
    /// before the first step and one per step.
    pub(crate) fn run_all(&self, population: usize) -> Result<Vec<Log>, WorldError> {
        let robots: Vec<Robot> = (0..population).map(|number| self.robot_of(number)).collect();
        let candidate = |robot| RolloutRequest::new(robot, &*self.drive).setup(&self.setup);
        simulate_all(robots.iter().map(candidate).collect()).into_iter().collect()
    }
}

fn walk(duration_s: f64) -> Result<Box<dyn Drive>, MotionError> {
    let controller = NaoWalk::space()?.nominal();
    Ok(Box::new(NaoWalk::new(&nao(), &controller, duration_s)?))
}

/// Every joint oscillates at its own rate.
struct Swing;

impl Drive for Swing {
    fn command(&self, time_s: f64, command: &mut [f64]) {
        for (i, command) in command.iter_mut().enumerate() {
            *command = 0.5 * ((2.0 + i as f64) * time_s).sin();
        }
    }
}

/// A fixed arm with servos: a turret, two links that lift and one that rolls.
fn arm() -> Robot {
    let link = |number: usize, axis: Vector3<f64>, length_m: f64| {
        let origin = Isometry3::translation(0.0, 0.0, if number == 1 { 0.1 } else { 0.2 });
        let joint = Joint {
            actuator: Actuator::Position { kp: 20.0, ki: 0.0, kd: 0.5, max_torque: f64::INFINITY },
            armature: 0.002,
            ..Joint::new(format!("joint{number}"), JointKind::Revolute, origin, axis)
        };
        Link {
            name: format!("link{number}"),
            parent: Some(number - 1),
            joint,
            mass_kg: 0.5,
            com_m: Point3::new(0.01, 0.0, 0.5 * length_m),
            inertia_kg_m2: Matrix3::from_diagonal(&Vector3::new(0.002, 0.002, 0.0004)),
            shapes: Vec::new(),
            mesh_boxes: vec![],
            foot: false,
        }
    };
    let fixed = Joint::new("fixed", JointKind::Fixed, Isometry3::identity(), Vector3::z());
    let base = Link { name: "base".to_owned(), parent: None, joint: fixed, ..link(1, Vector3::z(), 0.2) };
    let (z, y) = (Vector3::z(), Vector3::y());
    Robot {
        name: "arm".to_owned(),
        links: vec![base, link(1, z, 0.2), link(2, y, 0.2), link(3, y, 0.2), link(4, z, 0.1)],
        base: Base::Fixed,
        start: Isometry3::identity(),
    }
}

/// The ant without the integral gain of its servos, which MuJoCo's position servos lack.
fn ant() -> Robot {
    let mut robot = ant::ant();
    for link in &mut robot.links {
        if let Actuator::Position { ki, .. } = &mut link.joint.actuator {
            *ki = 0.0;
        }
    }
    robot
}
