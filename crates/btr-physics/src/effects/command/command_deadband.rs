//! Dead band of a servo: errors within the band are ignored, larger errors are reduced by the band.
//!
//! For actuators that take position commands. The band is centred on the position that the servo reads at the start of
//! the step.

use crate::actuation::JointInput;
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};

pub(in crate::effects) struct CommandDeadband;

static SPEC: EffectSpec = EffectSpec {
    name: "command_deadband",
    law: "the servo sees no error while |cmd - q| <= band, and the error less the band beyond",
    site: SiteKind::Joint,
    cite: "dead band, as in the data sheets of hobby servos",
    symptom: "the joint stops short of its target from either side and is slack in between",
    params: &[Param::new("band", "rad", (0.0, 0.5), 0.03)],
    starts: &[],
    similar: &["coulomb_friction", "backlash"],
    nested: &[],
};

impl Effect for CommandDeadband {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn is_of_motor(&self) -> bool {
        true
    }

    fn command(&self, p: &[f64], _memory: &mut [f64], state: &JointInput) -> f64 {
        let error = state.command - state.q;
        // A motor that is switched off (NaN) stays off.
        if error.abs() <= p[0] { state.q } else { state.command - p[0].copysign(error) }
    }
}
