//! Resolution of the command: the servo's goal is a whole number of steps.
//!
//! A register of 10 bits over 300° has steps of 0.29°, one of 12 bits over a turn steps of 0.088°.

use crate::actuation::JointInput;
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};

pub(in crate::effects) struct CommandResolution;

static SPEC: EffectSpec = EffectSpec {
    name: "command_resolution",
    law: "the servo sees step·round(cmd/step)",
    site: SiteKind::Joint,
    cite: "uniform quantisation, as in any textbook of digital control",
    symptom: "slow motions are stairs, always on the same positions; errors stay below half a step",
    params: &[Param::new("step", "rad", (0.0, 0.5), 0.02)],
    starts: &[],
    similar: &[],
    nested: &[],
};

impl Effect for CommandResolution {
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

    fn command(&self, p: &[f64], _memory: &mut [f64], state: &JointInput) -> f64 {
        // NaN, of a motor that is switched off, stays NaN.
        p[0] * (state.command / p[0]).round()
    }
}
