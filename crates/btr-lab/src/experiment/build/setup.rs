//! Time steps, ground, ball, gravity, sensors.

use super::builder::Builder;
use crate::experiment::file::NoiseSection;
use crate::experiment::source::FileError;
use crate::log_quality::usable::is_coarser;
use btr_core::log::Log;
use btr_physics::model::Scenario;
use btr_physics::robot::{Base, Robot};
use btr_physics::sensor::{SensorNoise, Unpredictable};
use btr_physics::setup::{Ball, Ground, Sensors, Setup};
use nalgebra::{Point3, Vector3};

/// The paper's time between two references.
const PAPERS_CONTROL_S: f64 = 0.055;

impl Builder<'_> {
    pub(super) fn setup(&self, robot: &Robot, recorded: &[Log]) -> Result<Setup, FileError> {
        let s = &self.file.simulation;
        let control_s = s.control_s.or_else(|| tick_of(recorded)).unwrap_or(PAPERS_CONTROL_S);
        let positive = [("control_s", control_s), ("duration_s", s.duration_s)];
        if let Some((key, value)) = positive.iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
            return Err(self.error(&["simulation", key], format!("{key} = {value} must be positive"), None));
        }
        let steps = s.steps(control_s, robot);
        let counts = [("steps_per_control", steps), ("sample_every", s.sample_every)];
        if let Some((key, _)) = counts.iter().find(|(_, count)| *count == 0) {
            return Err(self.error(&["simulation", key], format!("{key} must be at least 1"), None));
        }
        let dt_s = control_s / f64::from(steps);
        let control_s = control_period(recorded, control_s, dt_s);
        let floating = robot.base == Base::Floating;
        Ok(Setup {
            dt_s,
            substeps: 1,
            duration_s: s.duration_s,
            begins_s: 0.0,
            rest_s: 0.0,
            control_s,
            interpolate: s.interpolate,
            sample_s: Some(dt_s * f64::from(s.sample_every)),
            sensors: Sensors { velocities: true, torques: true, imu: floating, feet: floating },
            ground: floating.then(|| Ground::hard(s.ground_friction)),
            ball: s.ball.as_ref().map(|b| Ball {
                radius_m: b.radius_m,
                mass_kg: b.mass_kg,
                start_m: Point3::new(b.position_m[0], b.position_m[1], b.radius_m),
                friction: b.friction,
                restitution: b.restitution,
                rolling_damping_per_s: b.rolling_damping_per_s,
            }),
            noise: noise(&self.file.noise),
            gravity_m_s2: Vector3::new(0.0, 0.0, s.gravity),
            engine: s.engine,
            max_steps: s.max_steps,
            start_velocities: Vec::new(),
        })
    }
}

/// The sampling period of the fastest log, without jitter.
fn tick_of(recorded: &[Log]) -> Option<f64> {
    const GRAIN: f64 = 1e5;
    let fastest = recorded.iter().filter_map(Log::usual_step_s).min_by(f64::total_cmp)?;
    Some((fastest * GRAIN).round() / GRAIN).filter(|tick| *tick > 0.0)
}

/// The control period of the model. If the commands of logs change with every sample, more often than the file states,
/// they already contain the interpolation between references and are applied at their own rate, at most once per step.
fn control_period(recorded: &[Log], control_s: f64, dt_s: f64) -> f64 {
    match tick_of(recorded) {
        Some(tick_s) if is_coarser(control_s, tick_s) && recorded.iter().all(changes_with_every_sample) => {
            dt_s * (tick_s / dt_s).round().max(1.0)
        }
        _ => control_s,
    }
}

/// Whether a command changes between most of a log's samples.
fn changes_with_every_sample(log: &Log) -> bool {
    let commands: Vec<&[f64]> =
        log.channels().filter(|(name, _)| name.starts_with("cmd_")).map(|(_, channel)| &channel.values[..]).collect();
    let samples = log.clock_s().len();
    let changes =
        (1..samples).filter(|&k| commands.iter().any(|values| (values[k] - values[k - 1]).abs() > 0.0)).count();
    2 * changes > samples
}

impl Builder<'_> {
    /// Checks that every scenario can be simulated in the time and memory that there is.
    pub(super) fn check_durations(
        &self,
        robot: &Robot,
        setup: &Setup,
        scenarios: &[Scenario],
    ) -> Result<(), FileError> {
        for scenario in scenarios {
            let setup = Setup { duration_s: scenario.duration_s, ..setup.clone() };
            setup.check(robot).map_err(|e| {
                let help = "see duration_s, control_s, steps_per_control, sample_every and max_steps in [simulation]";
                self.error(&["simulation", "duration_s"], e, Some(help.into()))
            })?;
        }
        Ok(())
    }

    /// The noise of the sensors that the file states.
    pub(crate) fn noise(&self) -> SensorNoise {
        noise(&self.file.noise)
    }
}

pub(super) fn noise(section: &NoiseSection) -> SensorNoise {
    SensorNoise {
        position: section.position_rad,
        velocity: section.velocity_rad_s,
        torque: section.torque_n_m,
        gyro_rad_s: section.gyro_rad_s,
        accelerometer_m_s2: section.acceleration_m_s2,
        foot_n: section.force_n,
        position_quantum: section.position_quantum_rad,
        channels: section.channels.clone(),
        unpredictable: Unpredictable {
            position: section.model_rad,
            torque: section.model_n_m,
            ..Unpredictable::default()
        },
    }
}
