//! Sensor errors: white noise and quantisation of the readings.

use btr_core::random::Rng;
use btr_core::signal::noise;
use indexmap::IndexMap;
use rand::RngExt;

/// Standard deviations of the sensors' noise, by kind and by channel; all zero by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SensorNoise {
    /// Of joint positions, in rad (m).
    pub position: f64,
    /// Of joint velocities, in rad/s (m/s).
    pub velocity: f64,
    /// Of motor torques, in N·m (N).
    pub torque: f64,
    /// Of the gyroscope, in rad/s.
    pub gyro_rad_s: f64,
    /// Of the accelerometer, in m/s².
    pub accelerometer_m_s2: f64,
    /// Of foot forces, in N.
    pub foot_n: f64,
    /// Step of the joint encoders, in rad (m); 0 for none. Positions are rounded to it after the noise.
    pub position_quantum: f64,
    /// Of single channels, in their units, instead of that of their kind.
    pub channels: IndexMap<String, f64>,
}

impl SensorNoise {
    /// Noise floor of a channel with these readings: the model's stated noise, or else an estimate from the readings.
    /// `None` for channels with too few readings to estimate it.
    pub fn floor(&self, channel: &str, readings: &[f64]) -> Option<f64> {
        self.stated(channel).or_else(|| noise::NoiseEstimate::of(readings).map(|estimate| estimate.floor()))
    }

    /// The same beside a simulation of the channel; see [`noise::floor_beside`].
    pub fn floor_beside(&self, channel: &str, readings: &[f64], simulated: &[f64]) -> Option<f64> {
        self.stated(channel).or_else(|| noise::floor_beside(readings, simulated))
    }

    /// The model's stated sensor noise, by channel name pattern.
    pub fn by_channel(&self) -> IndexMap<String, f64> {
        let kinds = ["q_", "dq_", "tau_", "imu_gyro_", "imu_acc_", "foot_"];
        let by_kind = kinds.iter().filter_map(|kind| Some((format!("{kind}*"), self.stated(kind)?)));
        self.channels.clone().into_iter().chain(by_kind).collect()
    }

    /// Whether the noise floor is unknown: the model states none, and the readings show no noise.
    pub fn is_assumed(&self, channel: &str, readings: &[f64]) -> bool {
        self.stated(channel).is_none()
            && noise::NoiseEstimate::of(readings).is_some_and(|estimate| estimate.is_negligible())
    }

    /// The model's stated noise of a channel's sensor, quantisation included; `None` where it states none.
    pub fn stated(&self, channel: &str) -> Option<f64> {
        let (white, quantum) = match self.channels.get(channel) {
            Some(white) => (*white, 0.0),
            None => self.of_kind(channel),
        };
        let given = (white * white + quantum * quantum / 12.0).sqrt();
        (given > 0.0).then_some(given)
    }

    /// White noise and quantisation of a channel's kind; zero where they are unknown.
    fn of_kind(&self, channel: &str) -> (f64, f64) {
        match () {
            () if channel.starts_with("q_") => (self.position, self.position_quantum),
            () if channel.starts_with("dq_") => (self.velocity, 0.0),
            () if channel.starts_with("tau_") => (self.torque, 0.0),
            () if channel.starts_with("imu_gyro_") => (self.gyro_rad_s, 0.0),
            () if channel.starts_with("imu_acc_") => (self.accelerometer_m_s2, 0.0),
            () if channel.starts_with("foot_") => (self.foot_n, 0.0),
            () => (0.0, 0.0),
        }
    }
}

/// Adds noise of this standard deviation, then rounds to multiples of `quantum` where that is positive.
pub fn add_noise(values: &mut [f64], deviation: f64, quantum: f64, rng: &mut Rng) {
    for value in values {
        if deviation > 0.0 {
            *value += deviation * gaussian(rng);
        }
        if quantum > 0.0 {
            *value = (*value / quantum).round() * quantum;
        }
    }
}

/// A standard normal number (Box and Muller 1958).
fn gaussian(rng: &mut Rng) -> f64 {
    let (u, v): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}
