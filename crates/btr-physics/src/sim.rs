//! The simulation loop: a robot, what is put into its world, a drive; out comes a log.

pub use crate::articulated::forward_dynamics;

use crate::abreast::{self, Lead, Run, unled};
use crate::drive::Drive;
use crate::effect::{Placed, SiteKind};
use crate::engine::Dynamics;
use crate::robot::Robot;
use crate::sensor::Noise;
use btr_core::log::Log;
use btr_core::world::WorldError;
use nalgebra::{Point3, Vector3};
use std::borrow::Cow;

/// The floor: the plane z = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Coulomb coefficient against everything that touches it.
    pub friction: f64,
    /// How it gives way; as hard as the engine can make it when absent.
    pub compliance: Option<Compliance>,
}

impl Ground {
    /// A hard floor of this Coulomb coefficient.
    pub fn hard(friction: f64) -> Self {
        Ground { friction, compliance: None }
    }
}

/// A spring and a damper at every point that touches the floor. Rapier has them as they would be under the robot's
/// whole mass, and softer where a contact feels only a share of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compliance {
    /// N/m.
    pub stiffness: f64,
    /// N·s/m.
    pub damping: f64,
}

/// A ball to be kicked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// m.
    pub radius_m: f64,
    /// kg.
    pub mass_kg: f64,
    /// Centre at the start, in the world.
    pub start_m: Point3<f64>,
    /// Coulomb coefficient; averaged with that of what it touches.
    pub friction: f64,
    /// Speed kept in a central impact; averaged with that of what it touches, which is 0.
    pub restitution: f64,
    /// Rate at which its spin decays, in 1/s.
    pub rolling_damping_per_s: f64,
}

/// The physics engines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum EngineName {
    /// btr's own: minimal coordinates, of second order where nothing touches, with contacts as springs, dampers and friction.
    #[default]
    Auto,
    /// Rapier's multibody, always.
    Rapier,
}

/// Which sensors are logged. Commands and joint positions always are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sensors {
    /// `dq_<joint>`.
    pub velocities: bool,
    /// `tau_<joint>`: the motors' torques.
    pub torques: bool,
    /// `imu_gyro_{x,y,z}` and `imu_acc_{x,y,z}` at the root's frame, in its axes.
    pub imu: bool,
    /// `foot_<link>`: normal forces.
    pub feet: bool,
}

/// Everything about a run but the robot and its drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// Length of a physics step, in s.
    pub dt_s: f64,
    /// Solver steps in each, for accuracy; forces are held over them.
    pub substeps: usize,
    /// Simulated time, in s.
    pub duration_s: f64,
    /// When it begins, in s on the clock by which laws count time; drives and logs count from zero.
    pub begins_s: f64,
    /// How long the robot holds the first references before time zero, in s. One that is free is put on the floor for it.
    pub rest_s: f64,
    /// Time between two references of the drive, in s.
    pub control_s: f64,
    /// Whether joints are led linearly from one reference to the next; held otherwise. Prescribed joints are always led.
    pub interpolate: bool,
    /// Time between two samples of the log, in s: a multiple of `dt_s`, and `dt_s` itself when absent.
    pub sample_s: Option<f64>,
    /// What is logged.
    pub sensors: Sensors,
    /// The floor, if any.
    pub ground: Option<Ground>,
    /// A ball, if any.
    pub ball: Option<Ball>,
    /// Errors of the sensors; applied only when a run is given a noise seed.
    pub noise: Noise,
    /// In the world's axes, in m/s².
    pub gravity_m_s2: Vector3<f64>,
    /// What computes the motion.
    pub engine: EngineName,
    /// Joint velocities at the start, in the order of the movable joints; at rest where absent.
    pub start_velocities: Vec<f64>,
}

impl Default for Setup {
    /// Two seconds at 1 ms on a floor, references every 55 ms as in the paper.
    fn default() -> Self {
        Setup {
            dt_s: 0.001,
            substeps: 1,
            duration_s: 2.0,
            begins_s: 0.0,
            rest_s: 0.0,
            control_s: 0.055,
            interpolate: false,
            sample_s: None,
            sensors: Sensors { velocities: true, torques: true, imu: false, feet: true },
            ground: Some(Ground::hard(0.8)),
            ball: None,
            noise: Noise::default(),
            gravity_m_s2: Vector3::new(0.0, 0.0, -9.81),
            engine: EngineName::Auto,
            start_velocities: Vec::new(),
        }
    }
}

impl Setup {
    /// Samples of the log and physics steps from one to the next.
    pub(crate) fn samples(&self) -> Result<(usize, usize), WorldError> {
        let positive = [self.dt_s, self.duration_s, self.control_s].iter().all(|&t| t > 0.0 && t.is_finite());
        if !positive || self.substeps == 0 {
            return Err(setup_error(format!(
                "dt_s = {}, duration_s = {}, control_s = {} and substeps = {} must be positive",
                self.dt_s, self.duration_s, self.control_s, self.substeps
            )));
        }
        let ratio = self.sample_s.map_or(1.0, |sample| sample / self.dt_s);
        let every = ratio.round();
        if !(every >= 1.0 && (ratio - every).abs() < 1e-6 * every) {
            return Err(setup_error(format!("sample_s must be a multiple of dt_s, not {ratio} times it")));
        }
        let samples = (self.duration_s / (self.dt_s * every) + 1e-9).floor() as usize;
        if samples == 0 {
            return Err(setup_error(format!("duration_s = {} is shorter than one sample", self.duration_s)));
        }
        Ok((samples + 1, every as usize))
    }
}

pub(crate) fn setup_error(what: String) -> WorldError {
    WorldError::Setup { what }
}

/// Runs `drive` on `robot` with `effects` and logs what happens, from the start state on.
///
/// The first sample is the start state; torques there are those of the first command, foot forces and accelerations those
/// of the first step. The same arguments give the same bits, on any thread.
///
/// # Errors
/// [`WorldError::Setup`] for sites that match nothing and times that do not fit; [`WorldError::BlewUp`] when the state stops
/// being finite or moves absurdly fast.
pub fn simulate(
    robot: &Robot,
    effects: &[Placed],
    setup: &Setup,
    drive: &dyn Drive,
    noise_seed: Option<u64>,
) -> Result<Log, WorldError> {
    simulate_led(robot, effects, setup, drive, noise_seed, unled())
}

/// A robot in its world, and what it is told.
#[derive(Clone, Copy)]
pub struct Candidate<'a> {
    /// In its start state.
    pub robot: &'a Robot,
    /// What acts beside it.
    pub effects: &'a [Placed],
    /// Everything else about the run.
    pub setup: &'a Setup,
    /// What the joints are told.
    pub drive: &'a dyn Drive,
    /// For noisy sensors.
    pub noise_seed: Option<u64>,
}

/// What [`simulate`] gives for each candidate, bit by bit, on the calling thread. Candidates that follow each other and
/// only differ in numbers (of the robot, of effects, of the world) and in what they are told are simulated side by side
/// in the machine's vector registers, as far as they run on the default engine and no joint's motion is prescribed:
/// hand over eight or more at once.
pub fn simulate_all(candidates: &[Candidate]) -> Vec<Result<Log, WorldError>> {
    let runs = candidates.iter().map(|c| Run::new(c.robot, c.effects, c.setup, c.drive, c.noise_seed, unled()));
    abreast::simulate_all(runs.collect())
}

/// The same where somebody may move the robot to another state: `lead` is called after every step with the time in s, once the
/// sensors have been read; and once before the first.
pub(crate) fn simulate_led(
    robot: &Robot,
    effects: &[Placed],
    setup: &Setup,
    drive: &dyn Drive,
    noise_seed: Option<u64>,
    lead: Lead,
) -> Result<Log, WorldError> {
    let run = Run::new(robot, effects, setup, drive, noise_seed, lead)?;
    let mut engine = run.engine();
    abreast::together(engine.as_mut(), vec![run])
        .pop()
        .unwrap_or_else(|| Err(setup_error("nothing was simulated".to_owned())))
}

/// Servos act between two steps, never within one.
pub(crate) fn check_sampling(robot: &Robot, setup: &Setup) -> Result<(), WorldError> {
    for joint in robot.movable().map(|(_, link)| &link.joint) {
        let steps = joint.sampling.map_or(1.0, |sampling| sampling.period_s / setup.dt_s);
        if !(steps.round() >= 1.0 && (steps - steps.round()).abs() < 1e-6 * steps) {
            let name = &joint.name;
            return Err(setup_error(format!(
                "the servo of `{name}` samples every {steps} physics steps, not a whole number"
            )));
        }
    }
    Ok(())
}

/// Only the own engine knows linkages.
pub(crate) fn check_linkages(robot: &Robot, setup: &Setup) -> Result<(), WorldError> {
    let followers = robot.followers();
    for (i, (_, link)) in robot.movable().enumerate() {
        let Some(mimic) = &link.joint.mimic else { continue };
        let (name, leader) = (&link.joint.name, &mimic.leader);
        if followers.iter().all(|follower| follower.joint != i) {
            return Err(setup_error(format!("`{name}` mimics `{leader}`, which is no joint that moves")));
        }
        if setup.engine == EngineName::Rapier {
            let what = format!("`{name}` mimics `{leader}`, which the reference engine cannot simulate");
            return Err(setup_error(format!("{what}; leave out engine = \"rapier\"")));
        }
    }
    Ok(())
}

/// Lets the effects that sit on sensors change what those say.
pub(crate) fn sense(robot: &Robot, effects: &[Placed], log: &mut Log) -> Result<(), WorldError> {
    for placed in effects {
        match placed.effect.card().site {
            SiteKind::Joint => {
                let joints = placed.joints(robot)?;
                for (_, (_, link)) in robot.movable().enumerate().filter(|(i, _)| joints.contains(i)) {
                    placed.effect.sense(&placed.values, &link.joint.name, log);
                }
            }
            _ => placed.effect.sense(&placed.values, &placed.site, log),
        }
    }
    Ok(())
}

/// The robot and the setup after the effects that act on them before the run.
pub(crate) fn planted<'a>(
    robot: &'a Robot,
    effects: &[Placed],
    setup: &'a Setup,
) -> Result<(Cow<'a, Robot>, Cow<'a, Setup>), WorldError> {
    if !robot.is_tree() {
        return Err(setup_error(format!("the links of `{}` are not a tree with parents first", robot.name)));
    }
    let (mut robot, mut setup) = (Cow::Borrowed(robot), Cow::Borrowed(setup));
    if !robot.followers().is_empty() {
        robot.to_mut().settle_followers();
    }
    for placed in effects {
        match placed.effect.card().site {
            SiteKind::Joint => {}
            SiteKind::Link => {
                for link in placed.links(&robot)? {
                    placed.effect.link(&placed.values, robot.to_mut(), link);
                }
            }
            SiteKind::Base | SiteKind::Ground | SiteKind::Robot => {
                placed.effect.world(&placed.values, setup.to_mut());
            }
        }
    }
    Ok((robot, setup))
}

pub(crate) fn check(engine: &dyn Dynamics, time_s: f64) -> Result<(), WorldError> {
    engine.trouble().map_or(Ok(()), |what| Err(WorldError::BlewUp { time_s, what }))
}
