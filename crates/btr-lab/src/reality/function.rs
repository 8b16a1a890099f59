//! A function per test: another simulator, or any callable that drives a robot.

use super::commands::with_commands;
use super::revealed::Revealing;
use super::store::{Store, StoreError, outcome_of};
use crate::log_quality::usable;
use btr_core::log::Log;
use btr_core::world::{Outcome, Reality, Trial};
use btr_physics::model::Model;
use btr_physics::robot::Base;
use nalgebra::Isometry3;
use std::ops::ControlFlow;
use std::sync::Arc;

/// A test that a robot is to carry out.
pub struct TestRequest<'a> {
    /// The test.
    pub trial: &'a Trial,
    /// The names of the controller's parameters, in the order of the trial's values.
    pub names: Vec<&'a str>,
    /// The controller's references on the control clock.
    pub references: &'a Log,
    /// Initial position of each joint, at rest, in rad (m), in the order of the robot's joints.
    pub start: Vec<(&'a str, f64)>,
    /// Initial pose of a floating base: x, y, z in m and the quaternion w, x, y, z.
    pub base: Option<[f64; 7]>,
    /// Duration of the test, in s.
    pub duration_s: f64,
}

/// A pose in numbers: x, y, z in m and the quaternion w, x, y, z.
fn pose_of(pose: &Isometry3<f64>) -> [f64; 7] {
    let (at, turned) = (pose.translation, pose.rotation);
    [at.x, at.y, at.z, turned.w, turned.i, turned.j, turned.k]
}

/// Why a robot gave no log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TestFailure {
    /// The robot could not carry out the test; the test counts as spent.
    Failed(String),
    /// The outcome is unknown; the run stops, and requests the test again when it is resumed.
    Broken(String),
}

/// A robot or a stand-in: plays the references of a controller and returns the log.
pub type RobotFunction = Arc<dyn Fn(&TestRequest) -> Result<Log, TestFailure> + Send + Sync>;

/// Calls a function for every test.
pub struct FunctionReality {
    robot: RobotFunction,
    model: Arc<Model>,
    store: Store,
}

impl FunctionReality {
    /// Keeps tests in `store`; `model` computes the references of a controller.
    pub fn new(robot: RobotFunction, model: Arc<Model>, store: Store) -> Self {
        FunctionReality { robot, model, store }
    }

    fn perform(&self, trial: &Trial) -> Result<Outcome, StoreError> {
        let references = match self.store.known_or_asked(trial, &self.model)? {
            ControlFlow::Break(known) => return Ok(known),
            ControlFlow::Continue((_, references)) => references,
        };
        let names = self.model.drive.space().dims().iter().map(|dim| dim.name.as_str()).collect();
        let begins = self.model.beginning(&trial.controller, trial.scenario);
        let begins = begins.unwrap_or_else(|_| self.model.robot.clone());
        let start = begins.movable().map(|(_, link)| (link.joint.name.as_str(), link.joint.start)).collect();
        let base = (begins.base == Base::Floating).then(|| pose_of(&begins.start));
        let duration_s = self.model.scenarios[trial.scenario].duration_s;
        match (self.robot)(&TestRequest { trial, names, references: &references, start, base, duration_s }) {
            Ok(log) => match self.unusable(trial, &log) {
                Some(what) => Ok(Outcome::Pending { what: what.into() }),
                // The references are known even if the log has no commands.
                None => {
                    let log = self.store.on_the_tests_clock(log);
                    self.store.keep_or_put_aside(trial, &with_commands(&log, &references))
                }
            },
            Err(TestFailure::Failed(why)) => self.store.fail(trial, &why),
            Err(TestFailure::Broken(what)) => Ok(Outcome::Pending { what: what.into() }),
        }
    }
}

impl FunctionReality {
    /// Why a log cannot be kept. A real test is too expensive to spend on an unusable log.
    fn unusable(&self, trial: &Trial, log: &Log) -> Option<String> {
        let name = format!("the log of real test {}", trial.number);
        let (separator, error) = match usable::check_clock(log) {
            Err(error) => (": ", error),
            Ok(()) => (" ", usable::check_measures_robot(log, &self.model.robot).err()?),
        };
        let help = error.help.map_or_else(String::new, |help| format!("\nhelp: {help}"));
        Some(format!("{name}{separator}{}{help}", error.message))
    }
}

impl Reality for FunctionReality {
    fn test(&mut self, trial: &Trial) -> Outcome {
        outcome_of(self.perform(trial))
    }

    fn recall(&mut self, trial: &Trial) -> Outcome {
        self.store.recalled(trial)
    }
}

impl Revealing for FunctionReality {}
