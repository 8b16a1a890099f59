//! Hysteresis of a servo's goal: a command that differs little from the goal is ignored, any other becomes the goal.
//!
//! Unlike a [dead band of the error](crate::effects::command::command_deadband), which is centred on the position, it
//! depends on commands alone: a load does not move it, and a large step arrives whole.

use crate::actuation::JointInput;
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};

pub(in crate::effects) struct CommandHysteresis;

static SPEC: EffectSpec = EffectSpec {
    name: "command_hysteresis",
    law: "the servo keeps its goal while |cmd - goal| <= band; a command beyond becomes the goal, whole",
    site: SiteKind::Joint,
    cite: "Miskowicz, Send-On-Delta Concept, Sensors 6(1), 2006; the dead band of the command of hobby servos",
    symptom: "slow motions become steps of the band's size; large steps are unchanged, and a load moves nothing",
    params: &[Param::new("band", "rad", (0.0, 0.5), 0.02)],
    starts: &[],
    similar: &[],
    nested: &[],
};

/// The memory holds whether there was a command, and the goal.
impl Effect for CommandHysteresis {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn is_of_motor(&self) -> bool {
        true
    }

    fn is_common(&self) -> bool {
        true
    }

    fn is_of_command(&self) -> bool {
        true
    }

    fn memory(&self, _p: &[f64], _dt_s: f64) -> usize {
        2
    }

    fn command(&self, p: &[f64], memory: &mut [f64], state: &JointInput) -> f64 {
        let [started, goal] = memory else { return state.command };
        // A motor that is switched off (NaN) has no goal; the first command becomes one.
        if state.command.is_nan() {
            *started = 0.0;
            return state.command;
        }
        if *started == 0.0 || (state.command - *goal).abs() > p[0] {
            (*started, *goal) = (1.0, state.command);
        }
        *goal
    }
}
