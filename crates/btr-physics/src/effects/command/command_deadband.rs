//! A servo that does not care about small errors: within the band it does nothing, beyond it only the rest of the error
//! counts.
//!
//! For actuators that take positions: the band lies about the position that the servo reads when a step begins.

use crate::effects::effect::{EffectSpec, Effect, Param, SiteKind};
use crate::actuation::JointInput;

pub(in crate::effects) struct CommandDeadband;

static SPEC: EffectSpec = EffectSpec {
    name: "command_deadband",
    law: "the servo sees no error while |cmd - q| <= band, and the error less the band beyond",
    site: SiteKind::Joint,
    cite: "dead band, as in the data sheets of hobby servos",
    symptom: "the joint stops short of its goal from either side and is slack in between",
    params: &[Param::new("band", "rad", (0.0, 0.5), 0.03)],
    starts: &[],
    similar: &["coulomb_friction", "backlash"],
    nested: &[],
};

impl Effect for CommandDeadband {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn command(&self, p: &[f64], _memory: &mut [f64], state: &JointInput) -> f64 {
        let error = state.command - state.q;
        // A motor that is switched off (NaN) stays so.
        if error.abs() <= p[0] { state.q } else { state.command - p[0].copysign(error) }
    }
}
