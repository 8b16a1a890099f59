//! A supply that gives way: the more all motors together ask of it, the less each gets.
//!
//! The load is the sum of the sizes of all motors' torques in the last step.

use crate::effects::effect::{EffectSpec, Effect, Param, SiteKind};
use crate::actuation::{JointInput, MotorTorque};

pub(in crate::effects) struct VoltageSag;

static SPEC: EffectSpec = EffectSpec {
    name: "voltage_sag",
    law: "the motor's torque and its limit times 1/(1 + sag·load)",
    site: SiteKind::Robot,
    cite: "a source with an inner resistance, as in any textbook of circuits",
    symptom: "joints get weak when others work hard, and recover with them",
    params: &[Param::new("sag", "1/(N·m)", (0.0, 10.0), 0.1)],
    starts: &[],
    similar: &["load_dependent_friction"],
    nested: &[],
};

impl Effect for VoltageSag {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn motor(&self, p: &[f64], _memory: &mut [f64], motor: &mut MotorTorque, state: &JointInput) {
        motor.scale(1.0 / (1.0 + p[0] * state.load));
    }
}
