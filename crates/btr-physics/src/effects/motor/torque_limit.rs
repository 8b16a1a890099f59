//! Upper limit of a motor's torque.

use crate::actuation::{JointInput, MotorTorque};
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};

pub(in crate::effects) struct TorqueLimit;

static SPEC: EffectSpec = EffectSpec {
    name: "torque_limit",
    law: "the motor's torque is clamped to ±torque",
    site: SiteKind::Joint,
    cite: "saturation, as in any servo's data sheet",
    symptom: "the joint falls behind in fast or heavily loaded motions only; its torque reaches a plateau",
    params: &[Param::limit("torque", "N·m", (0.01, 100.0), 1.0)],
    starts: &[],
    similar: &["speed_torque_limit"],
    nested: &[],
};

impl Effect for TorqueLimit {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn is_of_motor(&self) -> bool {
        true
    }

    fn is_common(&self) -> bool {
        true
    }

    fn motor(&self, p: &[f64], _memory: &mut [f64], motor: &mut MotorTorque, _state: &JointInput) {
        motor.limit_to(p[0]);
    }
}
