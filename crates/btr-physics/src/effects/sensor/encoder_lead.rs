//! Log whose rows hold readings that are newer than its commands.
//!
//! Beyond the end of a run, positions go on at the last velocity.

use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::effects::readings::resample_measured;
use btr_core::log::Log;

pub(in crate::effects) struct EncoderLead;

static SPEC: EffectSpec = EffectSpec {
    name: "encoder_lead",
    law: "what the log shows at t was measured at t + lead",
    site: SiteKind::Robot,
    cite: "rows that hold a command and what was measured after it",
    symptom: "the measured motion is ahead of the simulated one by the same time at every speed",
    params: &[Param::new("lead", "s", (0.0, 0.2), 0.01)],
    starts: &[],
    similar: &["clock_skew"],
    nested: &[],
};

impl Effect for EncoderLead {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn sense(&self, p: &[f64], _site: &str, log: &mut Log) {
        let measured_s: Vec<f64> = log.clock_s().iter().map(|t| t + p[0]).collect();
        resample_measured(log, &measured_s);
    }
}
