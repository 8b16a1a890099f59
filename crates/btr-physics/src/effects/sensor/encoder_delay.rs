//! Delay of the logged readings; the servo's readings are not delayed.
//!
//! Before the start of a run, the joint moved at its first velocity: a log may begin in motion.

use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::effects::readings::resample;
use btr_core::log::Log;

pub(in crate::effects) struct EncoderDelay;

static SPEC: EffectSpec = EffectSpec {
    name: "encoder_delay",
    law: "the log's position and velocity are those of t - delay; before the start, it moved at the first velocity",
    site: SiteKind::Joint,
    cite: "transport delay",
    symptom: "the measured motion trails the simulated one by the same time at every speed, while the torque does not",
    params: &[Param::new("delay", "s", (0.0, 0.2), 0.02)],
    starts: &[],
    similar: &["command_delay", "motor_lag"],
    nested: &[],
};

impl Effect for EncoderDelay {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn changes_readings(&self) -> bool {
        true
    }

    fn is_common(&self) -> bool {
        true
    }

    fn sense(&self, p: &[f64], joint: &str, log: &mut Log) {
        let measured_s: Vec<f64> = log.clock_s().iter().map(|t| t - p[0]).collect();
        for channel in ["q", "dq"] {
            resample(log, &format!("{channel}_{joint}"), &measured_s);
        }
    }
}
