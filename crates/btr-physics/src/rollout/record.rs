//! Recording a log during a rollout; every series is allocated before the run.

use super::control::Control;
use crate::engine::Dynamics;
use crate::robot::{Base, Joint, Robot};
use crate::sensor::{SensorNoise, add_noise};
use crate::setup::{Sensors, Setup};
use btr_core::log::{Log, Role};
use btr_core::random::stream;
use btr_core::world::WorldError;
use indexmap::IndexMap;
use nalgebra::Vector3;

/// Channels of one kind: their names, units and values.
struct ChannelGroup {
    names: Vec<String>,
    units: Vec<&'static str>,
    role: Role,
    deviation: f64,
    quantum: f64,
    /// Sample-major: hundreds of separate series that grow at once would evict each other from the cache.
    values: Vec<f64>,
}

impl ChannelGroup {
    fn new(names: Vec<String>, units: Vec<&'static str>, role: Role, samples: usize) -> Self {
        let values = Vec::with_capacity(names.len() * samples);
        ChannelGroup { names, units, role, deviation: 0.0, quantum: 0.0, values }
    }

    fn noise(mut self, deviation: f64) -> Self {
        self.deviation = deviation;
        self
    }

    /// Appends a sample's values, one per channel; ignored where there are no channels.
    fn push(&mut self, values: impl IntoIterator<Item = f64>) {
        self.values.extend(values.into_iter().take(self.names.len()));
    }

    /// The values of the last sample.
    fn last_mut(&mut self) -> &mut [f64] {
        let from = self.values.len().saturating_sub(self.names.len());
        &mut self.values[from..]
    }

    /// The channels: name, unit and values.
    fn channels(self) -> impl Iterator<Item = (String, &'static str, Vec<f64>)> {
        let (values, count) = (self.values, self.names.len());
        let channels = self.names.into_iter().zip(self.units).enumerate();
        channels.map(move |(i, (name, unit))| (name, unit, values.iter().skip(i).step_by(count).copied().collect()))
    }
}

/// Recorder of a rollout's log.
pub(crate) struct Recorder {
    commands: ChannelGroup,
    positions: ChannelGroup,
    velocities: ChannelGroup,
    torques: ChannelGroup,
    gyro: ChannelGroup,
    accelerometer: ChannelGroup,
    feet: ChannelGroup,
    base: ChannelGroup,
    ball: ChannelGroup,
    samples: usize,
    /// Noise of single channels, instead of that of their kind.
    of_channels: IndexMap<String, f64>,
    sensors: Sensors,
    /// Inputs of the accelerometer: gravity, the time step, the velocity before the step.
    gravity_m_s2: Vector3<f64>,
    dt_s: f64,
    velocity_before_m_s: Vector3<f64>,
}

impl Recorder {
    pub(crate) fn new(robot: &Robot, setup: &Setup, samples: usize) -> Self {
        let SensorNoise {
            position, velocity, torque, gyro_rad_s, accelerometer_m_s2, foot_n, position_quantum, ..
        } = setup.noise;
        let sensors = setup.sensors;
        let joint = |prefix: &str, on: bool, unit: fn(&Joint) -> &'static str, role: Role| {
            let joints = robot.movable().filter(|_| on).map(|(_, link)| &link.joint);
            let (names, units) = joints.map(|j| (format!("{prefix}_{}", j.name), unit(j))).unzip();
            ChannelGroup::new(names, units, role, samples)
        };
        let axes = |prefix: &str, axes: &[&str], unit: &'static str, on: bool, role: Role| {
            let names: Vec<String> = axes.iter().filter(|_| on).map(|axis| format!("{prefix}_{axis}")).collect();
            let units = vec![unit; names.len()];
            ChannelGroup::new(names, units, role, samples)
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
            of_channels: setup.noise.channels.clone(),
            sensors,
            gravity_m_s2: setup.gravity_m_s2,
            dt_s: setup.dt_s,
            velocity_before_m_s: Vector3::zeros(),
        }
    }

    /// Must be called before every step.
    pub(crate) fn before_step(&mut self, engine: &dyn Dynamics) {
        if self.sensors.imu {
            self.velocity_before_m_s = engine.base().velocity_m_s;
        }
    }

    /// Records the state at a sample.
    pub(crate) fn state(&mut self, engine: &dyn Dynamics, control: &Control) {
        let joints = self.commands.names.len();
        self.commands.push((0..joints).map(|i| control.command(i)));
        self.positions.push(engine.positions().iter().copied());
        self.velocities.push(engine.velocities().iter().copied());
        let base = engine.base();
        if self.sensors.imu {
            let gyro = base.pose.rotation.inverse() * base.angular_rad_s;
            self.gyro.push(gyro.iter().copied());
        }
        let (p, q) = (base.pose.translation.vector, base.pose.rotation);
        self.base.push([p.x, p.y, p.z, q.w, q.i, q.j, q.k]);
        if let Some(ball) = engine.ball() {
            self.ball.push(ball.iter().copied());
        }
    }

    /// Records the forces of the last step.
    pub(crate) fn forces(&mut self, engine: &dyn Dynamics, control: &Control) {
        let torque = |i: usize| {
            let computed = || control.torque(i, engine.positions()[i], engine.velocities()[i]);
            control.known_torque(i).unwrap_or_else(computed)
        };
        let motors = self.torques.names.len();
        self.torques.push((0..motors).map(torque));
        if self.sensors.imu {
            let base = engine.base();
            let acceleration = (base.velocity_m_s - self.velocity_before_m_s) / self.dt_s;
            let specific_force = base.pose.rotation.inverse() * (acceleration - self.gravity_m_s2);
            self.accelerometer.push(specific_force.iter().copied());
        }
        let feet = self.feet.names.len();
        self.feet.push((0..feet).map(|foot| engine.foot_force_n(foot)));
    }

    /// Corrects the torques of the sample at which the last prepared step begins: the torque that a digital servo
    /// computes at an instant is logged at that instant.
    pub(crate) fn correct_torques(&mut self, control: &Control) {
        for (i, last) in self.torques.last_mut().iter_mut().enumerate() {
            if let Some(torque) = control.known_torque(i) {
                *last = torque;
            }
        }
    }

    /// The log: the readings after `sense`, with noise if there is a seed.
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
                let deviation = self.of_channels.get(name).copied().unwrap_or(series.deviation);
                noise.push((name.clone(), [kind as u64, i as u64], deviation, series.quantum));
            }
            let role = series.role;
            for (name, unit, values) in series.channels() {
                log.insert(name, unit, role, values)?;
            }
        }
        sense(&mut log)?;
        let Some(seed) = noise_seed else { return Ok(log) };
        for (name, key, deviation, quantum) in noise {
            if let Some(values) = log.values_mut(&name) {
                add_noise(values, deviation, quantum, &mut stream(seed, &key));
            }
        }
        Ok(log)
    }
}
