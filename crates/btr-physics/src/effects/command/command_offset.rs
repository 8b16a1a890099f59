//! Offset between the command's zero and the servo's zero: the servo goes to another position than commanded.
//!
//! For actuators that take position commands. With an [`encoder_offset`](crate::effects::sensor::encoder_offset) of the
//! same size it describes a log whose zero differs from the robot's, while the servo's zero is the robot's.

use crate::actuation::JointInput;
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};

pub(in crate::effects) struct CommandOffset;

static SPEC: EffectSpec = EffectSpec {
    name: "command_offset",
    law: "the servo sees cmd + offset",
    site: SiteKind::Joint,
    cite: "a servo whose centre was set by hand, or a log with another zero",
    symptom: "a constant difference between command and reading, at any load",
    params: &[Param::new("offset", "rad", (-0.5, 0.5), 0.03)],
    starts: &[],
    similar: &["encoder_offset", "gravity_tilt", "parallel_spring"],
    nested: &[],
};

impl Effect for CommandOffset {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn is_of_motor(&self) -> bool {
        true
    }

    fn command(&self, p: &[f64], _memory: &mut [f64], state: &JointInput) -> f64 {
        state.command + p[0]
    }
}
