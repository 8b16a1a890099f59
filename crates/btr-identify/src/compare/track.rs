//! A joint in one log: its motion, its command, and its residual.

use super::clue::Clue;
use super::pair::{ChannelResidual, LogPair, on_clock};
use super::quantile::quantile;
use super::regime::Regime;
use btr_core::signal::noise::NoiseEstimate;
use btr_core::signal::smooth::{Motion, smooth};

/// One joint in one log, sample by sample on the log's clock.
#[derive(Clone, Debug)]
pub struct JointTrack {
    /// The log, counted from 0.
    pub log: usize,
    /// The joint.
    pub joint: String,
    /// In s.
    pub clock_s: Vec<f64>,
    /// Measured minus simulated position, in rad (m); of a joint whose motion is prescribed, torque in N·m (N). NaN
    /// where missing.
    pub error: Vec<f64>,
    /// Standard deviation of the sensor's error, in the same unit.
    pub floor: f64,
    /// The measured motion, smoothed.
    pub motion: Vec<Motion>,
    /// Speed below which the joint counts as resting, in rad/s (m/s).
    pub still: f64,
    /// The joint's command; empty where the log has none. NaN switches the torque off.
    pub command: Vec<f64>,
    /// The motor's load: the measured torque, or else the simulated one, or else the command minus the simulated
    /// position; zero where there is no command either.
    pub load: Vec<f64>,
    /// Which of these the load is.
    pub load_label: &'static str,
    /// Whether the load may reach a motor's limit: not the torque that a prescribed motion requires.
    pub is_limited: bool,
    /// The mask of each regime.
    pub regimes: Vec<(Regime, Vec<bool>)>,
    /// The series of each clue.
    pub clues: Vec<(Clue, Vec<f64>)>,
}

impl JointTrack {
    /// The joint that a residual belongs to, without regimes and clues; `None` for residuals of anything but positions
    /// and torques.
    pub(super) fn new(residual: &ChannelResidual, episode: &LogPair) -> Option<Self> {
        let of_position = residual.channel.strip_prefix("q_");
        let joint = of_position.or_else(|| residual.channel.strip_prefix("tau_"))?.to_owned();
        let clock_s = episode.real.clock_s();
        let position = &episode.real.channel(&format!("q_{joint}"))?.values;
        let command = episode.real.channel(&format!("cmd_{joint}")).map(|c| c.values.clone()).unwrap_or_default();
        let torque = format!("tau_{joint}");
        let measured = || episode.real.channel(&torque).map(|c| c.values.clone()).filter(|tau| varies(tau));
        let simulated = || on_clock(episode.simulated, &torque, clock_s).filter(|tau| varies(tau));
        // The simulated position: the noise of the measured one would be both in the load and in the residual. So would
        // that of a measured torque which is compared itself.
        let ahead = || command.iter().zip(&residual.simulated).map(|(command, position)| command - position).collect();
        let (load, load_label) = match (measured().filter(|_| of_position.is_some()), simulated()) {
            (Some(tau), _) => (tau, "measured torque"),
            (None, Some(tau)) => (tau, "simulated torque"),
            (None, None) if command.is_empty() => (vec![0.0; clock_s.len()], "no load"),
            (None, None) => (ahead(), "command minus simulated position"),
        };
        let motion = smooth(clock_s, position);
        let noise = match of_position {
            Some(_) => residual.floor,
            None => NoiseEstimate::of(position).map_or(0.0, |noise| noise.sigma()),
        };
        Some(JointTrack {
            log: residual.log,
            joint,
            clock_s: clock_s.to_vec(),
            error: residual.error.clone(),
            floor: residual.floor,
            still: still(clock_s, &motion, noise),
            motion,
            command,
            load,
            load_label,
            is_limited: of_position.is_some(),
            regimes: Vec::new(),
            clues: Vec::new(),
        })
    }

    /// The direction of the motion, -1 or 1; while the joint rests, that of its last motion. 0 before the first.
    ///
    /// A direction counts only once the joint moves faster than its noise would suggest; it then counts from the sample
    /// where the velocity passed through zero.
    pub fn directions(&self) -> Vec<f64> {
        let mut directions = vec![0.0; self.motion.len()];
        let mut last = 0.0;
        for i in 0..self.motion.len() {
            let v = self.motion[i].velocity;
            if v.abs() > self.still && v * last <= 0.0 {
                last = v.signum();
                let since = self.motion[..i].iter().rposition(|m| m.velocity.is_nan() || m.velocity * last <= 0.0);
                directions[since.map_or(0, |before| before + 1)..i].fill(last);
            }
            directions[i] = last;
        }
        directions
    }

    /// The samples at which the direction of the motion has changed.
    pub fn reversals(&self) -> Vec<usize> {
        let directions = self.directions();
        let changed = directions.windows(2).enumerate().filter(|(_, pair)| pair[0] * pair[1] < 0.0);
        changed.map(|(i, _)| i + 1).collect()
    }
}

/// The speed below which a joint counts as resting: four deviations of the smoothed velocity, at least a twentieth of
/// its top speed.
fn still(clock_s: &[f64], motion: &[Motion], noise: f64) -> f64 {
    let top = quantile(motion.iter().map(|m| m.velocity.abs()), 0.95).unwrap_or(0.0);
    let step = clock_s.windows(2).map(|pair| pair[1] - pair[0]).sum::<f64>() / clock_s.len().max(2) as f64;
    // The slope of n points over 2·reach has the deviation sigma/(reach·sqrt(n/3)).
    let reach = (4.0 * step).max(0.02);
    let points = (2.0 * reach / step.max(1e-9) + 1.0).max(4.0);
    (0.05 * top).max(4.0 * noise / (reach * (points / 3.0).sqrt()))
}

fn varies(values: &[f64]) -> bool {
    let present = values.iter().filter(|x| x.is_finite());
    let (low, high) = present.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
    high > low
}
