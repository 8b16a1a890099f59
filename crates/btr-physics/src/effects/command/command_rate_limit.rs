//! A command that changes no faster than so: a ramp in the servo's firmware, a profile that the motion is fitted into.

use crate::effects::effect::{EffectSpec, Effect, Param, SiteKind, follow};
use crate::actuation::JointInput;

pub(in crate::effects) struct CommandRateLimit;

static SPEC: EffectSpec = EffectSpec {
    name: "command_rate_limit",
    law: "the servo sees a value that moves towards cmd with at most ±rate; it starts at the first command",
    site: SiteKind::Joint,
    cite: "slew-rate limit, as in servo firmware",
    symptom: "large steps become ramps of one slope, small motions are untouched",
    params: &[Param::limit("rate", "rad/s", (0.01, 100.0), 1.5)],
    starts: &[],
    similar: &["motor_lag", "torque_limit"],
    nested: &[],
};

/// The memory says whether there was a command, and holds what the servo was told last.
impl Effect for CommandRateLimit {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn memory(&self, _p: &[f64], _dt_s: f64) -> usize {
        2
    }

    fn command(&self, p: &[f64], memory: &mut [f64], state: &JointInput) -> f64 {
        let most = p[0] * state.dt_s;
        let (before, after) = follow(memory, state.command, |error| error.clamp(-most, most));
        let moved = after - before;
        // The mean of a ramp that may arrive before the step ends.
        before + moved * (1.0 - 0.5 * moved.abs() / most)
    }
}
