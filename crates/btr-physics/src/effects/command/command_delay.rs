//! Delay of the commands: a bus, a buffer, a filter before the servo.

use crate::actuation::JointInput;
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};

pub(in crate::effects) struct CommandDelay;

static SPEC: EffectSpec = EffectSpec {
    name: "command_delay",
    law: "the servo sees cmd(t - delay); before that, the first command",
    site: SiteKind::Joint,
    cite: "transport delay",
    symptom: "the measured motion trails the simulated one by the same time at every speed",
    params: &[Param::new("delay", "s", (0.0, 0.2), 0.02)],
    starts: &[],
    similar: &["motor_lag", "encoder_delay"],
    nested: &[],
};

/// Longest delay, in s. Longer ones are clamped to it, which bounds the memory.
const LONGEST_S: f64 = 10.0;

/// The delay in steps.
fn steps(p: &[f64], dt_s: f64) -> f64 {
    p[0].clamp(0.0, LONGEST_S) / dt_s
}

/// The memory is a counter of the commands so far, followed by a ring buffer of the latest ones.
impl Effect for CommandDelay {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn is_of_motor(&self) -> bool {
        true
    }

    fn is_common(&self) -> bool {
        true
    }

    fn memory(&self, p: &[f64], dt_s: f64) -> usize {
        1 + steps(p, dt_s).ceil() as usize + 1
    }

    fn command(&self, p: &[f64], memory: &mut [f64], state: &JointInput) -> f64 {
        let Some((count, ring)) = memory.split_first_mut() else { return state.command };
        if *count < 1.0 {
            ring.fill(state.command);
        }
        let now = *count as usize;
        ring[now % ring.len()] = state.command;
        *count += 1.0;
        // The command is interpolated linearly between steps.
        let delay_steps = steps(p, state.dt_s);
        let whole = delay_steps.floor() as usize;
        let fraction = delay_steps - delay_steps.floor();
        let past = |steps: usize| ring[(now + ring.len() - steps % ring.len()) % ring.len()];
        if fraction > 0.0 { past(whole) + fraction * (past(whole + 1) - past(whole)) } else { past(whole) }
    }
}
