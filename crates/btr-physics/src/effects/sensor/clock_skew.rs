//! A recorder whose clock runs fast or slow against the robot's: the later, the further is everything measured out of
//! place.
//!
//! Beyond the end of a run (a clock that runs slow) the last readings are held.

use crate::effects::readings::taken_at;
use crate::effects::effect::{EffectSpec, Effect, Param, SiteKind};
use btr_core::log::{Log, Role};

pub(in crate::effects) struct ClockSkew;

static SPEC: EffectSpec = EffectSpec {
    name: "clock_skew",
    law: "what the log shows at t was measured at t/(1 + skew)",
    site: SiteKind::Robot,
    cite: "two quartzes that disagree",
    symptom: "an error like a delay's that grows in the course of a run",
    params: &[Param::new("skew", "1", (-0.05, 0.05), 0.01)],
    starts: &[],
    similar: &["encoder_delay"],
    nested: &[],
};

impl Effect for ClockSkew {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn sense(&self, p: &[f64], _site: &str, log: &mut Log) {
        let taken: Vec<f64> = log.clock_s().iter().map(|t| t / (1.0 + p[0])).collect();
        let measured = log.channels().filter(|(_, channel)| channel.role == Role::Measured);
        let names: Vec<String> = measured.map(|(name, _)| name.to_owned()).collect();
        // Positions before velocities, which say how they go on between samples.
        let (positions, others): (Vec<&String>, Vec<&String>) = names.iter().partition(|name| name.starts_with("q_"));
        positions.into_iter().chain(others).for_each(|name| taken_at(log, name, &taken));
    }
}
