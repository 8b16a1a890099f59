//! A model: a robot with its effects, free parameters, drive and fitness. It defines the space of simulations that all
//! searches use.

mod accelerations;
mod outline;
pub mod parameter;
mod request;
mod rollouts;
mod standard;
pub mod task;

use crate::drive::{Drive, DrivePlan};
use crate::effects::PlacedEffect;
use crate::robot::{Joint, JointKind, Robot};
use crate::rollout::restart::Restart;
use crate::setup::{EngineName, Setup};
use btr_core::log::{Log, Role};
use btr_core::space::Space;
use btr_core::world::WorldError;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use parameter::Target;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use task::Fitness;

pub use outline::Outline;
pub use request::ModelRequest;

/// A scenario: the conditions of one rollout.
#[derive(Clone, Debug, Default)]
pub struct Scenario {
    /// Name in reports.
    pub name: String,
    /// Commands of a recorded log, instead of the model's drive.
    pub replay: Option<Arc<crate::drive::Replay>>,
    /// T_e in s.
    pub duration_s: f64,
    /// Start time in s, on the clock of time-dependent laws; later than 0 for a part of a log that follows a gap.
    pub begins_s: f64,
    /// How long the robot holds the first commands before the start, in s.
    pub rest_s: f64,
    /// Known values in this scenario: payload, gain, supply voltage, ...
    pub settings: Vec<(Target, f64)>,
    /// Joint positions and velocities at the start, by joint in the order of [`Robot::movable`]; the robot's own where
    /// empty.
    pub start: Vec<(f64, f64)>,
    /// States that the robot is set to during the rollout, in order of time: a chaotic motion is compared by multiple
    /// shooting.
    pub restarts: Arc<[Restart]>,
}

/// Everything that a simulation needs.
#[derive(Debug)]
pub struct Model {
    /// The robot at its nominal values.
    pub robot: Robot,
    /// Effects that are present.
    pub effects: Vec<PlacedEffect>,
    /// Time steps, ground, sensors.
    pub setup: Setup,
    /// Targets of the dimensions of S.
    pub targets: Vec<Target>,
    /// S.
    pub simulations: Space,
    /// For each dimension of S, the standard deviation that earlier logs leave, in its unit; `None` without such logs.
    pub prior_sds: Vec<Option<f64>>,
    /// The drive, with C.
    pub drive: DrivePlan,
    /// Scenarios, at least one. Those from `learn` on are held out: no search ever sees them.
    pub scenarios: Vec<Scenario>,
    /// Number of training scenarios.
    pub learn: usize,
    /// f(B).
    pub fitness: Fitness,
    /// Rollouts so far, for the progress display; no result depends on it.
    pub rollouts: AtomicU64,
}

impl Model {
    /// The standard deviation that earlier logs leave for a dimension of S, in its unit.
    pub fn prior_sd(&self, dim: usize) -> Option<f64> {
        self.prior_sds.get(dim).copied().flatten()
    }

    /// The same model with other scenarios, all for training.
    #[must_use]
    pub fn in_situations(&self, scenarios: Vec<Scenario>) -> Model {
        Model {
            robot: self.robot.clone(),
            effects: self.effects.clone(),
            setup: self.setup.clone(),
            targets: self.targets.clone(),
            simulations: self.simulations.clone(),
            prior_sds: self.prior_sds.clone(),
            drive: self.drive.clone(),
            learn: scenarios.len(),
            scenarios,
            fitness: self.fitness.clone(),
            rollouts: 0.into(),
        }
    }

    /// Whether there is a floor or a ball to touch.
    pub fn has_contact(&self) -> bool {
        self.setup.ground.is_some() || self.setup.ball.is_some()
    }

    /// Order of accuracy: the power of the time step with which the integrator's error falls.
    pub fn order(&self) -> i32 {
        if !self.has_contact() && self.setup.engine == EngineName::Auto { 2 } else { 1 }
    }

    /// The joint references of controller `c`, at the control ticks; no sensor readings are fed back. For a policy
    /// these are the references that it corrects.
    ///
    /// # Errors
    /// A point outside C.
    pub fn references(&self, c: &[f64], scenario: usize) -> Result<Log, WorldError> {
        self.drive.space().check(c)?;
        let drive = self.drive_at(c, &self.scenarios[scenario])?;
        // Including the reference at or after the end of the rollout, towards which the last interval interpolates.
        let ticks = (self.scenarios[scenario].duration_s / self.setup.control_s - 1e-6).ceil().max(0.0) as usize;
        let clock: Vec<f64> = (0..=ticks).map(|k| k as f64 * self.setup.control_s).collect();
        let joints: Vec<&Joint> = self.robot.movable().map(|(_, link)| &link.joint).collect();
        let mut rows = vec![Vec::with_capacity(clock.len()); joints.len()];
        let mut command = vec![0.0; joints.len()];
        for &t in &clock {
            drive.command(t, &mut command);
            rows.iter_mut().zip(&command).for_each(|(row, &x)| row.push(x));
        }
        let mut log = Log::new(clock)?;
        for (joint, row) in joints.iter().zip(rows) {
            log.insert(format!("cmd_{}", joint.name), joint.command_unit(), Role::Command, row)?;
        }
        Ok(log)
    }

    /// The robot in the controller's start state, which is the same in simulation and reality.
    ///
    /// # Errors
    /// A point outside C.
    pub fn beginning(&self, c: &[f64], scenario: usize) -> Result<Robot, WorldError> {
        let (mut robot, scenario) = (self.robot.clone(), &self.scenarios[scenario]);
        match scenario.replay {
            Some(_) => place(&mut robot, &scenario.start),
            None => self.drive_at(c, scenario)?.place(&mut robot),
        }
        Ok(robot)
    }

    /// The same model with the start state of its first scenario set: joints by name in rad (m), at rest; the base at
    /// x, y, z in m and the quaternion w, x, y, z; and the scenario's duration in s.
    #[must_use]
    pub fn begun(mut self, joints: &[(String, f64)], base: Option<[f64; 7]>, duration_s: f64) -> Self {
        for link in self.robot.links.iter_mut().skip(1) {
            if let Some((_, start)) = joints.iter().find(|(name, _)| *name == link.joint.name) {
                link.joint.start = *start;
            }
        }
        if let Some([x, y, z, w, i, j, k]) = base {
            // A unit quaternion is restored bit by bit.
            let turned = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
            self.robot.start = Isometry3::from_parts(Translation3::new(x, y, z), turned);
        }
        if let Some(scenario) = self.scenarios.first_mut() {
            // The joints' start positions are true values, not recorded readings.
            scenario.start.clear();
            scenario.duration_s = duration_s;
        }
        self
    }

    /// The robot, effects and setup of simulation `s` in a scenario. A scenario's known values override S.
    pub fn at(&self, s: &[f64], scenario: usize) -> (Robot, Vec<PlacedEffect>, Setup) {
        self.in_scenario(&self.scenarios[scenario], s, &[])
    }

    /// The same with values that replace the model's own.
    fn in_scenario(
        &self,
        scenario: &Scenario,
        s: &[f64],
        values: &[(Target, f64)],
    ) -> (Robot, Vec<PlacedEffect>, Setup) {
        let (mut robot, mut effects, mut setup) = (self.robot.clone(), self.effects.clone(), self.setup.clone());
        let known = values.iter().chain(&scenario.settings).map(|(target, value)| (target, *value));
        for (target, value) in self.targets.iter().zip(s.iter().copied()).chain(known) {
            target.set(value, &mut robot, &mut effects, &mut setup);
        }
        setup.duration_s = scenario.duration_s;
        setup.begins_s = scenario.begins_s;
        setup.rest_s = scenario.rest_s;
        setup.start_velocities = scenario.start.iter().map(|(_, dq)| *dq).collect();
        place(&mut robot, &scenario.start);
        (robot, effects, setup)
    }

    /// The drive of a scenario. References depend on the controller alone: they are computed for the robot at its
    /// nominal values, as a real robot's controller would, whatever is simulated.
    fn drive_at(&self, c: &[f64], scenario: &Scenario) -> Result<Box<dyn Drive>, WorldError> {
        match &scenario.replay {
            Some(replay) => Ok(Box::new(replay.clone())),
            None => self.drive.at(&self.robot, c, scenario.duration_s),
        }
    }
}

/// Sets the joint positions at the start, in the order of the movable joints.
fn place(robot: &mut Robot, start: &[(f64, f64)]) {
    let moving = robot.links.iter_mut().skip(1).filter(|link| link.joint.kind != JointKind::Fixed);
    moving.zip(start).for_each(|(link, (q, _))| link.joint.start = *q);
}
