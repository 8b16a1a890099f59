//! A recorder whose clock runs fast or slow against the robot's: the later, the further is everything measured out of place.
//!
//! Beyond the end of a run (a clock that runs slow) the last readings are held.

use super::{Card, Effect, Param, SiteKind};
use btr_core::log::{Log, Role, interpolate};

pub(super) struct ClockSkew;

static CARD: Card = Card {
    name: "clock_skew",
    law: "what the log shows at t was measured at t/(1 + skew)",
    site: SiteKind::Robot,
    cite: "two quartzes that disagree",
    tell: "an error like a delay's that grows in the course of a run",
    params: &[Param::new("skew", "1", (-0.05, 0.05), 0.01)],
    starts: &[],
    alike: &["encoder_delay"],
    contains: &[],
};

impl Effect for ClockSkew {
    fn card(&self) -> &'static Card {
        &CARD
    }

    fn sense(&self, p: &[f64], _site: &str, log: &mut Log) {
        let clock = log.clock_s().to_vec();
        let taken: Vec<f64> = clock.iter().map(|t| t / (1.0 + p[0])).collect();
        let measured = log.channels().filter(|(_, channel)| channel.role == Role::Measured);
        let names: Vec<String> = measured.map(|(name, _)| name.to_owned()).collect();
        for name in names {
            if let Some(values) = log.values_mut(&name) {
                let skewed = interpolate(&clock, values, &taken);
                values.copy_from_slice(&skewed);
            }
        }
    }
}
