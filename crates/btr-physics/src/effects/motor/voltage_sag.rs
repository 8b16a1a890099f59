//! Supply voltage that drops under load: the more torque all motors deliver together, the less each motor has.
//!
//! The load is the sum of the magnitudes of all motors' torques in the last step.

use crate::actuation::{JointInput, MotorTorque};
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};

pub(in crate::effects) struct VoltageSag;

static SPEC: EffectSpec = EffectSpec {
    name: "voltage_sag",
    law: "the motor's torque and its limit times 1/(1 + sag·load)",
    site: SiteKind::Robot,
    cite: "a source with an internal resistance, as in any textbook on circuits",
    symptom: "joints weaken while others deliver high torque, and recover afterwards",
    params: &[Param::new("sag", "1/(N·m)", (0.0, 10.0), 0.1)],
    starts: &[],
    similar: &["load_dependent_friction"],
    nested: &[],
};

impl Effect for VoltageSag {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn is_of_motor(&self) -> bool {
        true
    }

    fn joins_limbs(&self) -> bool {
        true
    }

    fn motor(&self, p: &[f64], _memory: &mut [f64], motor: &mut MotorTorque, state: &JointInput) {
        motor.scale(1.0 / (1.0 + p[0] * state.load));
    }
}
