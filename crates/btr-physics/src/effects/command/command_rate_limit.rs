//! Rate limit of the command: a ramp in the servo's firmware, a motion profile.

use crate::actuation::JointInput;
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind, follow};

pub(in crate::effects) struct CommandRateLimit;

static SPEC: EffectSpec = EffectSpec {
    name: "command_rate_limit",
    law: "the servo sees a value that moves towards cmd with at most ±rate; it starts at the first command",
    site: SiteKind::Joint,
    cite: "slew-rate limit, as in servo firmware",
    symptom: "large steps become ramps of constant slope; small motions are unchanged",
    params: &[Param::limit("rate", "rad/s", (0.01, 100.0), 1.5)],
    starts: &[],
    similar: &["motor_lag", "torque_limit"],
    nested: &[],
};

/// The memory holds whether there was a command, and the last value that the servo saw.
impl Effect for CommandRateLimit {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn is_of_motor(&self) -> bool {
        true
    }

    fn is_common(&self) -> bool {
        true
    }

    fn memory(&self, _p: &[f64], _dt_s: f64) -> usize {
        2
    }

    fn command(&self, p: &[f64], memory: &mut [f64], state: &JointInput) -> f64 {
        let max_change = p[0] * state.dt_s;
        let (before, after) = follow(memory, state.command, |error| error.clamp(-max_change, max_change));
        let moved = after - before;
        // Mean of a ramp that may reach the command before the step ends.
        before + moved * (1.0 - 0.5 * moved.abs() / max_change)
    }
}
