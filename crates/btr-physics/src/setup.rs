//! Settings of a rollout other than robot and drive: times, sensors, ground, ball, engine.

use crate::robot::Robot;
use crate::sensor::SensorNoise;
use btr_core::limits::{LONGEST_S, MOST_STEPS, MOST_VALUES};
use btr_core::world::WorldError;
use nalgebra::{Point3, Vector3};
use std::cmp::Ordering;

/// The floor: the plane z = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Coulomb coefficient against everything that touches it.
    pub friction: f64,
    /// Its compliance; as hard as the engine can make it when absent.
    pub compliance: Option<Compliance>,
}

impl Ground {
    /// A hard floor with this Coulomb coefficient.
    pub fn hard(friction: f64) -> Self {
        Ground { friction, compliance: None }
    }
}

/// A spring and a damper at every contact point with the floor. In Rapier, their values hold under the robot's whole
/// mass; a contact that bears only a part of it is proportionally softer.
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
#[non_exhaustive]
pub enum EngineName {
    /// The default engine: minimal coordinates, second order without contacts; contacts are springs, dampers and
    /// friction.
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

/// Settings of a run other than its robot and drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// Length of a physics step, in s.
    pub dt_s: f64,
    /// Solver steps per physics step, for accuracy; forces are held constant over them.
    pub substeps: usize,
    /// Simulated time, in s.
    pub duration_s: f64,
    /// Start time in s, on the clock of time-dependent laws; drives and logs count from zero.
    pub begins_s: f64,
    /// Time for which the robot holds the first references before time zero, in s. A floating robot is first placed on
    /// the ground.
    pub rest_s: f64,
    /// Period of the drive's references, in s.
    pub control_s: f64,
    /// Whether references are interpolated linearly, instead of held. Those of prescribed joints are always
    /// interpolated.
    pub interpolate: bool,
    /// Sampling period of the log, in s: a multiple of `dt_s`; `dt_s` itself when absent.
    pub sample_s: Option<f64>,
    /// What is logged.
    pub sensors: Sensors,
    /// The floor, if any.
    pub ground: Option<Ground>,
    /// A ball, if any.
    pub ball: Option<Ball>,
    /// Sensor errors; applied only when a run has a noise seed.
    pub noise: SensorNoise,
    /// In the world's axes, in m/s².
    pub gravity_m_s2: Vector3<f64>,
    /// Physics engine.
    pub engine: EngineName,
    /// The most physics steps of a run; a longer one is refused.
    pub max_steps: u64,
    /// Joint velocities at the start, in the order of the movable joints; zero where absent.
    pub start_velocities: Vec<f64>,
}

impl Default for Setup {
    /// Two seconds at 1 ms on a floor, with references every 55 ms as in the paper.
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
            noise: SensorNoise::default(),
            gravity_m_s2: Vector3::new(0.0, 0.0, -9.81),
            engine: EngineName::Auto,
            max_steps: MOST_STEPS,
            start_velocities: Vec::new(),
        }
    }
}

/// Channels of a log per joint, ...
const MOST_PER_JOINT: usize = 4;
/// ... and those of the base and a ball.
const OF_BASE_AND_BALL: usize = 16;

impl Setup {
    /// Checks that a run of this robot is neither longer than `max_steps` nor gives a log of too many values.
    ///
    /// # Errors
    /// [`WorldError::Setup`], with the number and the limit; times that are not positive.
    pub fn check(&self, robot: &Robot) -> Result<(), WorldError> {
        self.samples(robot).map(|_| ())
    }

    /// Number of samples of the log, and physics steps per sample.
    pub(crate) fn samples(&self, robot: &Robot) -> Result<(usize, usize), WorldError> {
        let positive = [self.dt_s, self.duration_s, self.control_s].iter().all(|&t| t > 0.0 && t.is_finite());
        if !positive || self.substeps == 0 {
            return Err(setup_error(format!(
                "dt_s = {}, duration_s = {}, control_s = {} and substeps = {} must be positive",
                self.dt_s, self.duration_s, self.control_s, self.substeps
            )));
        }
        let ratio = self.sample_s.map_or(1.0, |sample| sample / self.dt_s);
        let steps = ratio.round();
        if !(steps >= 1.0 && (ratio - steps).abs() < 1e-6 * steps) {
            return Err(setup_error(format!("sample_s must be a multiple of dt_s, not {ratio} times it")));
        }
        self.check_steps()?;
        let samples = (self.duration_s / (self.dt_s * steps) + 1e-9).floor() as usize;
        if samples == 0 {
            return Err(setup_error(format!("duration_s = {} is shorter than one sample", self.duration_s)));
        }
        let channels = MOST_PER_JOINT * robot.movable().count() + robot.links.len() + OF_BASE_AND_BALL;
        if (samples + 1).saturating_mul(channels) > MOST_VALUES {
            let what = format!("the log of {:?} s would have {} samples", self.duration_s, samples + 1);
            return Err(setup_error(format!(
                "{what} of about {channels} channels; at most {MOST_VALUES} values are kept"
            )));
        }
        Ok((samples + 1, steps as usize))
    }

    fn check_steps(&self) -> Result<(), WorldError> {
        let time_s = self.duration_s + self.rest_s.max(0.0);
        if time_s > LONGEST_S {
            return Err(setup_error(format!("a run of {time_s:?} s; at most {LONGEST_S} s, a day, are simulated")));
        }
        let steps = time_s / self.dt_s * self.substeps as f64;
        // Also refuses what is no number.
        if steps.partial_cmp(&(self.max_steps as f64)).is_none_or(Ordering::is_gt) {
            let what = format!("{time_s:?} s in steps of {:?} s are {steps:.1e} physics steps", self.dt_s);
            return Err(setup_error(format!("{what}; at most {} are simulated", self.max_steps)));
        }
        Ok(())
    }
}

pub(crate) fn setup_error(what: String) -> WorldError {
    WorldError::Setup { what }
}
