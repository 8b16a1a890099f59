//! Hysteresis of a servo's goal: it keeps its goal until the command has moved away by more than a band, then takes the
//! command over. Cheap servos do so against the jitter of their input.

use crate::actuation::JointInput;
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};

pub(in crate::effects) struct CommandHysteresis;

static SPEC: EffectSpec = EffectSpec {
    name: "command_hysteresis",
    law: "the servo keeps its goal while |cmd - goal| <= band, and takes cmd as its goal beyond",
    site: SiteKind::Joint,
    cite: "dead band width, as in the data sheets of hobby servos",
    symptom: "slow motions become small steps; large steps are unchanged",
    params: &[Param::new("band", "rad", (0.0, 0.5), 0.03)],
    starts: &[],
    similar: &["command_deadband", "coulomb_friction", "stribeck_friction", "backlash"],
    nested: &[],
};

/// The memory holds whether there was a command, and the goal.
impl Effect for CommandHysteresis {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn memory(&self, _p: &[f64], _dt_s: f64) -> usize {
        2
    }

    fn command(&self, p: &[f64], memory: &mut [f64], state: &JointInput) -> f64 {
        let [started, goal] = memory else { return state.command };
        // A motor that is switched off (NaN) forgets its goal.
        if *started == 0.0 || state.command.is_nan() || (state.command - *goal).abs() > p[0] {
            *goal = state.command;
        }
        *started = f64::from(u8::from(!state.command.is_nan()));
        *goal
    }
}
