//! A servo whose zero is not that of whoever commands it: it goes to another place than it is told.
//!
//! For actuators that take positions. Together with [`encoder_offset`](crate::effects::sensor::encoder_offset) of the
//! same size it is a log whose zero is not the robot's, while the servo's is.

use crate::effects::effect::{EffectSpec, Effect, Param, SiteKind};
use crate::actuation::JointInput;

pub(in crate::effects) struct CommandOffset;

static SPEC: EffectSpec = EffectSpec {
    name: "command_offset",
    law: "the servo is told cmd + offset",
    site: SiteKind::Joint,
    cite: "a servo whose middle was set by hand, or a log that counts from another zero",
    symptom: "a constant distance between command and reading, whatever the load",
    params: &[Param::new("offset", "rad", (-0.5, 0.5), 0.03)],
    starts: &[],
    similar: &["encoder_offset", "gravity_tilt", "parallel_spring"],
    nested: &[],
};

impl Effect for CommandOffset {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn command(&self, p: &[f64], _memory: &mut [f64], state: &JointInput) -> f64 {
        state.command + p[0]
    }
}
