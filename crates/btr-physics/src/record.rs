//! Filling a log while a robot moves; every series is allocated before the run.

use crate::control::Control;
use crate::engine::Dynamics;
use crate::robot::{Base, Joint, Robot};
use crate::sensor::{Noise, disturb};
use crate::sim::{Sensors, Setup};
use btr_core::log::{Log, Role};
use btr_core::random::stream;
use btr_core::world::WorldError;
use nalgebra::Vector3;

/// Channels of one kind: their names and their values.
struct Series {
    names: Vec<String>,
    units: Vec<&'static str>,
    role: Role,
    deviation: f64,
    quantum: f64,
    values: Vec<Vec<f64>>,
}

impl Series {
    fn new(names: Vec<String>, units: Vec<&'static str>, role: Role, samples: usize) -> Self {
        let values = names.iter().map(|_| Vec::with_capacity(samples)).collect();
        Series { names, units, role, deviation: 0.0, quantum: 0.0, values }
    }

    fn noise(mut self, deviation: f64) -> Self {
        self.deviation = deviation;
        self
    }

    fn push(&mut self, i: usize, value: f64) {
        self.values[i].push(value);
    }

    fn push_all(&mut self, values: &[f64]) {
        for (series, &value) in self.values.iter_mut().zip(values) {
            series.push(value);
        }
    }
}

/// A log in the making.
pub(crate) struct Recorder {
    commands: Series,
    positions: Series,
    velocities: Series,
    torques: Series,
    gyro: Series,
    accelerometer: Series,
    feet: Series,
    base: Series,
    ball: Series,
    samples: usize,
    sensors: Sensors,
    /// What the accelerometer needs: gravity, the step, the velocity before it.
    gravity_m_s2: Vector3<f64>,
    dt_s: f64,
    velocity_before_m_s: Vector3<f64>,
}

impl Recorder {
    pub(crate) fn new(robot: &Robot, setup: &Setup, samples: usize) -> Self {
        let Noise { position, velocity, torque, gyro_rad_s, accelerometer_m_s2, foot_n, position_quantum } =
            setup.noise;
        let sensors = setup.sensors;
        let joint = |prefix: &str, on: bool, unit: fn(&Joint) -> &'static str, role: Role| {
            let joints = robot.movable().filter(|_| on).map(|(_, link)| &link.joint);
            let (names, units) = joints.map(|j| (format!("{prefix}_{}", j.name), unit(j))).unzip();
            Series::new(names, units, role, samples)
        };
        let axes = |prefix: &str, axes: &[&str], unit: &'static str, on: bool, role: Role| {
            let names: Vec<String> = axes.iter().filter(|_| on).map(|axis| format!("{prefix}_{axis}")).collect();
            let units = vec![unit; names.len()];
            Series::new(names, units, role, samples)
        };
        let feet: Vec<&str> = robot.links.iter().filter(|link| link.foot).map(|link| link.name.as_str()).collect();
        let mut positions = joint("q", true, Joint::position_unit, Role::Measured).noise(position);
        positions.quantum = position_quantum;
        let xyz = ["x", "y", "z"];
        let mut base =
            axes("base", &["x", "y", "z", "qw", "qx", "qy", "qz"], "m", robot.base == Base::Floating, Role::Truth);
        base.units.iter_mut().skip(3).for_each(|unit| *unit = "1");
        Recorder {
            commands: joint("cmd", true, Joint::command_unit, Role::Command),
            positions,
            velocities: joint("dq", sensors.velocities, Joint::velocity_unit, Role::Measured).noise(velocity),
            torques: joint("tau", sensors.torques, Joint::torque_unit, Role::Measured).noise(torque),
            gyro: axes("imu_gyro", &xyz, "rad/s", sensors.imu, Role::Measured).noise(gyro_rad_s),
            accelerometer: axes("imu_acc", &xyz, "m/s²", sensors.imu, Role::Measured).noise(accelerometer_m_s2),
            feet: axes("foot", &feet, "N", sensors.feet, Role::Measured).noise(foot_n),
            base,
            ball: axes("ball", &xyz, "m", setup.ball.is_some(), Role::Truth),
            samples,
            sensors,
            gravity_m_s2: setup.gravity_m_s2,
            dt_s: setup.dt_s,
            velocity_before_m_s: Vector3::zeros(),
        }
    }

    /// To be called before every step.
    pub(crate) fn before_step(&mut self, engine: &dyn Dynamics) {
        if self.sensors.imu {
            self.velocity_before_m_s = engine.base().velocity_m_s;
        }
    }

    /// Samples what belongs to an instant.
    pub(crate) fn state(&mut self, engine: &dyn Dynamics, control: &Control) {
        for i in 0..self.commands.names.len() {
            self.commands.push(i, control.command(i));
        }
        self.positions.push_all(engine.positions());
        self.velocities.push_all(engine.velocities());
        let base = engine.base();
        if self.sensors.imu {
            let gyro = base.pose.rotation.inverse() * base.angular_rad_s;
            self.gyro.push_all(gyro.as_slice());
        }
        let (p, q) = (base.pose.translation.vector, base.pose.rotation);
        self.base.push_all(&[p.x, p.y, p.z, q.w, q.i, q.j, q.k]);
        if let Some(ball) = engine.ball() {
            self.ball.push_all(ball.coords.as_slice());
        }
    }

    /// Samples what belongs to the last step.
    pub(crate) fn forces(&mut self, engine: &dyn Dynamics, control: &Control) {
        for i in 0..self.torques.names.len() {
            let torque = || control.torque(i, engine.positions()[i], engine.velocities()[i]);
            self.torques.push(i, control.told(i).unwrap_or_else(torque));
        }
        if self.sensors.imu {
            let base = engine.base();
            let acceleration = (base.velocity_m_s - self.velocity_before_m_s) / self.dt_s;
            let felt = base.pose.rotation.inverse() * (acceleration - self.gravity_m_s2);
            self.accelerometer.push_all(felt.as_slice());
        }
        for foot in 0..self.feet.names.len() {
            self.feet.push(foot, engine.foot_force_n(foot));
        }
    }

    /// Puts right the torques of the sample at which the step begins that was prepared last: what a digital servo works out at
    /// an instant is logged at that instant.
    pub(crate) fn told(&mut self, control: &Control) {
        for (i, values) in self.torques.values.iter_mut().enumerate() {
            if let (Some(last), Some(torque)) = (values.last_mut(), control.told(i)) {
                *last = torque;
            }
        }
    }

    /// The log: what the sensors say after `sense`, disturbed if there is a seed.
    pub(crate) fn finish(
        self,
        sample_s: f64,
        noise_seed: Option<u64>,
        sense: impl FnOnce(&mut Log) -> Result<(), WorldError>,
    ) -> Result<Log, WorldError> {
        let mut log = Log::new((0..self.samples).map(|i| i as f64 * sample_s).collect())?;
        let kinds = [
            self.commands,
            self.positions,
            self.velocities,
            self.torques,
            self.gyro,
            self.accelerometer,
            self.feet,
            self.base,
            self.ball,
        ];
        let mut noise = Vec::new();
        for (kind, series) in kinds.into_iter().enumerate() {
            for (i, name) in series.names.iter().enumerate() {
                noise.push((name.clone(), [kind as u64, i as u64], series.deviation, series.quantum));
            }
            for ((name, unit), values) in series.names.into_iter().zip(series.units).zip(series.values) {
                log.insert(name, unit, series.role, values)?;
            }
        }
        sense(&mut log)?;
        let Some(seed) = noise_seed else { return Ok(log) };
        for (name, key, deviation, quantum) in noise {
            if let Some(values) = log.values_mut(&name) {
                disturb(values, deviation, quantum, &mut stream(seed, &key));
            }
        }
        Ok(log)
    }
}
