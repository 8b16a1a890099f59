//! Commands that arrive late: a bus, a buffer, a filter ahead of the servo.

use crate::effects::effect::{EffectSpec, Effect, Param, SiteKind};
use crate::actuation::JointInput;

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

/// Longer delays than this (s) are taken as this, so that no value can ask for endless memory.
const LONGEST_S: f64 = 10.0;

/// The delay in steps.
fn steps(p: &[f64], dt_s: f64) -> f64 {
    p[0].clamp(0.0, LONGEST_S) / dt_s
}

/// The memory is a counter of the commands so far, then a ring of the latest ones.
impl Effect for CommandDelay {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
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
        // Between two steps the command is taken as linear.
        let late = steps(p, state.dt_s);
        let whole = late.floor() as usize;
        let share = late - late.floor();
        let past = |steps: usize| ring[(now + ring.len() - steps % ring.len()) % ring.len()];
        if share > 0.0 { past(whole) + share * (past(whole + 1) - past(whole)) } else { past(whole) }
    }
}
