//! Scale of the commands in a log: they are in other units than the readings, or a servo's range is another than
//! assumed, as with hobby servos that take pulse widths.

use crate::actuation::JointInput;
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};

pub(in crate::effects) struct CommandScale;

static SPEC: EffectSpec = EffectSpec {
    name: "command_scale",
    law: "the servo sees (1 + error)·cmd",
    site: SiteKind::Joint,
    cite: "a servo with another range than assumed, commands and readings in different units",
    symptom: "a difference between command and reading that grows with the distance from zero, at any load",
    params: &[Param::new("error", "1", (-0.5, 1.0), 0.05)],
    starts: &[],
    similar: &["encoder_scale", "command_offset", "parallel_spring"],
    nested: &[],
};

impl Effect for CommandScale {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn is_of_motor(&self) -> bool {
        true
    }

    /// Units are wrong by much; by half a percent, this looks like a small load or spring.
    fn is_suspected(&self) -> bool {
        false
    }

    fn command(&self, p: &[f64], _memory: &mut [f64], state: &JointInput) -> f64 {
        (1.0 + p[0]) * state.command
    }
}
