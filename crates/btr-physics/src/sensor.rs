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
    /// What a model of the robot cannot predict, beyond the sensors' noise.
    pub unpredictable: Unpredictable,
}

/// What differs between runs of the same command, and so cannot be predicted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Unpredictable {
    /// Standard deviation of joint positions, as stated, in rad (m); 0 where it is not.
    pub position: f64,
    /// Of motor torques, in N·m (N).
    pub torque: f64,
    /// By channel, as measured: the whole spread of a run, the sensor's noise included.
    pub channels: IndexMap<String, RunNoise>,
}

/// The spread of the runs of a command, as measured in a channel.
#[derive(Clone, Debug, PartialEq)]
pub struct RunNoise {
    /// Standard deviation of a run, in the channel's unit; without its offset where that is known.
    pub sigma: f64,
    /// Standard deviation of the offset of a whole run, where that is a good part of what differs.
    pub offset: Option<f64>,
    /// Number of independent differences that it was estimated from.
    pub freedom: f64,
    /// Samples per independent one.
    pub memory: f64,
    /// Squared correlations with the departures of each channel that has a spread, in their order.
    pub shared: Vec<f64>,
}

impl Unpredictable {
    /// Whether a whole run of a channel has an offset of its own.
    pub fn has_offsets(&self, channel: &str) -> bool {
        self.channels.get(channel).is_some_and(|noise| noise.offset.is_some())
    }

    /// The standard deviation of a channel's readings from what the best model predicts, where its sensor has this
    /// noise floor. What the model states counts rather than what was measured.
    pub fn beside(&self, channel: &str, floor: f64) -> f64 {
        let stated = match channel.split_once('_') {
            Some(("q", _)) => self.position,
            Some(("tau", _)) => self.torque,
            _ => 0.0,
        };
        match self.channels.get(channel).filter(|_| stated <= 0.0) {
            Some(measured) => measured.sigma.max(floor),
            None => floor.hypot(stated),
        }
    }
}

impl SensorNoise {
    /// Noise floor of a channel with these readings: the model's stated noise, or else an estimate from the readings;
    /// an estimate stands for the part that is not stated as well, white noise or the encoders' step. `None` for
    /// channels with too few readings to estimate it.
    pub fn floor(&self, channel: &str, readings: &[f64]) -> Option<f64> {
        self.completed(channel, readings, || noise::NoiseEstimate::of(readings).map(|estimate| estimate.floor()))
    }

    /// The same beside a simulation of the channel; see [`noise::floor_beside`].
    pub fn floor_beside(&self, channel: &str, readings: &[f64], simulated: &[f64]) -> Option<f64> {
        self.completed(channel, readings, || noise::floor_beside(readings, simulated))
    }

    /// The stated noise, completed by an estimate of the whole noise or by the readings' own step.
    fn completed(&self, channel: &str, readings: &[f64], estimate: impl Fn() -> Option<f64>) -> Option<f64> {
        let Some(stated) = self.stated(channel) else { return estimate() };
        if !self.states_white(channel) {
            return Some(estimate().map_or(stated, |estimated| estimated.max(stated)));
        }
        let lacks_step = self.position_quantum <= 0.0 && channel.starts_with("q_");
        let shown = (lacks_step && !self.channels.contains_key(channel)).then(|| noise::NoiseEstimate::of(readings));
        Some(stated.hypot(shown.flatten().map_or(0.0, |shown| shown.quantum) / 12.0_f64.sqrt()))
    }

    /// Whether the model states a channel's white noise, so that the floor does not depend on an estimate of it.
    pub fn states_white(&self, channel: &str) -> bool {
        self.channels.get(channel).copied().unwrap_or_else(|| self.of_kind(channel).0) > 0.0
    }

    /// The model's stated sensor noise, by channel name pattern; without kinds of which it states the step alone.
    pub fn by_channel(&self) -> IndexMap<String, f64> {
        let kinds = ["q_", "dq_", "tau_", "imu_gyro_", "imu_acc_", "foot_"];
        let by_kind = kinds.iter().filter(|kind| self.states_white(kind));
        let by_kind = by_kind.filter_map(|kind| Some((format!("{kind}*"), self.stated(kind)?)));
        self.channels.clone().into_iter().chain(by_kind).collect()
    }

    /// Whether the noise floor is unknown: the model states none, and the readings show no noise.
    pub fn is_assumed(&self, channel: &str, readings: &[f64]) -> bool {
        self.stated(channel).is_none()
            && noise::NoiseEstimate::of(readings).is_some_and(|estimate| estimate.is_negligible())
    }

    /// The model's stated noise of a channel's sensor, quantisation included; a part that it does not state counts as
    /// none. `None` where it states neither.
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use btr_core::random::stream;

    const WHITE: f64 = 0.002;
    const STEP: f64 = 0.0015;

    /// A slow motion with noise and an encoder's step, and the motion itself.
    fn readings() -> (Vec<f64>, Vec<f64>) {
        let motion: Vec<f64> = (0..4000).map(|i| (0.002 * f64::from(i)).sin()).collect();
        let mut readings = motion.clone();
        add_noise(&mut readings, WHITE, STEP, &mut stream(3, &[0]));
        (readings, motion)
    }

    #[test]
    fn an_estimate_stands_for_the_part_of_the_noise_that_is_not_stated() {
        let (readings, motion) = readings();
        let whole = WHITE.hypot(STEP / 12.0_f64.sqrt());
        let is_whole = |noise: &SensorNoise| {
            let floors = [noise.floor("q_a", &readings), noise.floor_beside("q_a", &readings, &motion)];
            floors.into_iter().all(|floor| (floor.unwrap() / whole - 1.0).abs() < 0.06)
        };
        let (step, white) = (STEP, WHITE);
        assert!(is_whole(&SensorNoise { position_quantum: step, ..SensorNoise::default() }), "the step alone");
        assert!(is_whole(&SensorNoise { position: white, ..SensorNoise::default() }), "white noise alone");
        assert!(is_whole(&SensorNoise { position: white, position_quantum: step, ..SensorNoise::default() }), "both");
    }

    #[test]
    fn a_stated_noise_counts_whatever_the_readings_show() {
        let (readings, _) = readings();
        let both = SensorNoise { position: 1e-5, position_quantum: 1e-5, ..SensorNoise::default() };
        assert_eq!(both.floor("q_a", &readings), both.stated("q_a"));
        let channels = IndexMap::from([("q_a".to_owned(), 1e-4)]);
        assert_eq!(SensorNoise { channels, ..SensorNoise::default() }.floor("q_a", &readings), Some(1e-4));
        let coarse = SensorNoise { position_quantum: 0.1, ..SensorNoise::default() };
        assert_eq!(coarse.floor("q_a", &readings), coarse.stated("q_a"));
    }
}
