//! What is timed: the ant's tripod gait and the Nao's walk, with the sensors that the paper's robots have.

use btr_core::log::Log;
use btr_core::world::WorldError;
use btr_physics::ant;
use btr_physics::drive::{Drive, MotionError, NaoWalk};
use btr_physics::nao::{CONTROL_S, nao};
use btr_physics::robot::{Actuator, Robot};
use btr_physics::sim::{EngineName, Setup, simulate};

/// The scenes by name.
pub(crate) const NAMES: [&str; 2] = ["ant", "nao"];
/// The physics engines as model files name them.
pub(crate) const ENGINES: [&str; 2] = ["auto", "rapier"];

/// A robot where its motion begins, its world and its drive.
pub(crate) struct Scene {
    pub(crate) robot: Robot,
    pub(crate) setup: Setup,
    pub(crate) drive: Box<dyn Drive>,
}

impl Scene {
    /// The Nao for the name `nao`, else the ant; on the reference engine for `rapier`, else on the own one.
    pub(crate) fn new(name: &str, engine: &str, dt_s: f64, duration_s: f64) -> Result<Self, MotionError> {
        let engine = if engine == "rapier" { EngineName::Rapier } else { EngineName::Auto };
        let setup = Setup { dt_s, duration_s, control_s: CONTROL_S, interpolate: true, engine, ..Setup::default() };
        let (mut robot, drive) = if name == "nao" { (nao(), walk(duration_s)?) } else { (ant(), tripod()) };
        drive.place(&mut robot);
        Ok(Scene { robot, setup, drive })
    }

    /// Simulates it once, from building the world to the log, which has a sample per step and one before them.
    pub(crate) fn run(&self) -> Result<Log, WorldError> {
        simulate(&self.robot, &[], &self.setup, &*self.drive, None)
    }
}

fn walk(duration_s: f64) -> Result<Box<dyn Drive>, MotionError> {
    let controller = NaoWalk::space()?.nominal();
    Ok(Box::new(NaoWalk::new(&nao(), &controller, duration_s)?))
}

fn tripod() -> Box<dyn Drive> {
    Box::new(ant::tripod())
}

/// The ant without the integral part of its servos, which MuJoCo's position servos do not have.
fn ant() -> Robot {
    let mut robot = ant::ant();
    for link in &mut robot.links {
        if let Actuator::Position { ki, .. } = &mut link.joint.actuator {
            *ki = 0.0;
        }
    }
    robot
}
