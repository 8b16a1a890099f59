//! Recorder whose clock runs fast or slow against the robot's: the shift of the measurements grows with time.
//!
//! Beyond the end of a run (a clock that runs slow), positions go on at the last velocity.

use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::effects::readings::resample_measured;
use btr_core::log::Log;

pub(in crate::effects) struct ClockSkew;

static SPEC: EffectSpec = EffectSpec {
    name: "clock_skew",
    law: "what the log shows at t was measured at t/(1 + skew)",
    site: SiteKind::Robot,
    cite: "drift between two quartz clocks",
    symptom: "an error like a delay's that grows over the run",
    params: &[Param::new("skew", "1", (-0.05, 0.05), 0.01)],
    starts: &[],
    similar: &["encoder_delay", "encoder_lead"],
    nested: &[],
};

impl Effect for ClockSkew {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn sense(&self, p: &[f64], _site: &str, log: &mut Log) {
        let measured_s: Vec<f64> = log.clock_s().iter().map(|t| t / (1.0 + p[0])).collect();
        resample_measured(log, &measured_s);
    }
}
