//! Digital servos: at fixed sampling instants they read the position, compute a torque or a voltage, and hold it until
//! the next one (zero-order hold).
//!
//! K. J. Astrom and B. Wittenmark, "Computer-Controlled Systems", Prentice Hall 1997. The hold delays the output by
//! half a period on average, and so does a velocity that is the difference of two readings. A servo in continuous time
//! lacks this delay, which matters at short periods too.

use super::joint_input::JointInput;
use crate::robot::Sampling;

/// Internal state of a digital servo.
#[derive(Clone, Debug)]
pub(crate) struct SampledServo {
    period_s: f64,
    /// Index of the last sampling instant; `usize::MAX` before the first.
    instant: usize,
    /// The last readings, newest first.
    readings: Vec<f64>,
    held: f64,
}

/// Inputs of a digital servo at a sampling instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reading {
    /// Sampling period, in s.
    pub(crate) period_s: f64,
    /// Position.
    pub(crate) q: f64,
    /// Velocity, as a difference of readings.
    pub(crate) dq: f64,
}

impl SampledServo {
    pub(crate) fn new(sampling: &Sampling) -> Self {
        let readings = vec![0.0; sampling.velocity_over as usize + 1];
        SampledServo { period_s: sampling.period_s, instant: usize::MAX, readings, held: 0.0 }
    }

    /// The output held during the coming step; `law` computes it from the readings at every sampling instant.
    pub(crate) fn hold(&mut self, state: &JointInput, law: impl FnOnce(&Reading) -> f64) -> f64 {
        // The offset absorbs rounding, as for references.
        let instant = (state.time_s / self.period_s + 1e-6).floor() as usize;
        if instant != self.instant {
            self.read(state);
            self.instant = instant;
            let periods = (self.readings.len() - 1) as f64;
            let oldest = self.readings.last().copied().unwrap_or(state.q);
            let dq = (state.q - oldest) / (periods * self.period_s);
            self.held = law(&Reading { period_s: self.period_s, q: state.q, dq });
        }
        self.held
    }

    /// Resets the readings, for a servo that is switched off.
    pub(crate) fn reset(&mut self) {
        self.instant = usize::MAX;
    }

    fn read(&mut self, state: &JointInput) {
        if self.instant == usize::MAX {
            // Extrapolates to before the first instant at the present velocity.
            let ago = |k: usize| state.q - k as f64 * self.period_s * state.dq;
            self.readings.iter_mut().enumerate().for_each(|(k, reading)| *reading = ago(k));
        } else {
            self.readings.rotate_right(1);
            self.readings[0] = state.q;
        }
    }
}
