//! Torque-speed line of a motor: the faster it turns, the less voltage its back-EMF leaves for torque. While braking,
//! the back-EMF helps, and the whole torque is available.

use crate::actuation::{JointInput, MotorTorque};
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};

pub(in crate::effects) struct SpeedTorqueLimit;

static SPEC: EffectSpec = EffectSpec {
    name: "speed_torque_limit",
    law: "the motor's torque is clamped to ±torque·(1 - |dq|/speed), never below 0, while it drives; to ±torque while \
          it brakes",
    site: SiteKind::Joint,
    cite: "torque-speed line of a DC motor, as in any servo's data sheet",
    symptom: "the joint falls behind in fast sections although its torque is far below its stall torque",
    params: &[Param::limit("torque", "N·m", (0.01, 100.0), 1.5), Param::shape("speed", "rad/s", (0.1, 200.0), 4.0)],
    starts: &[&[2.0], &[6.0], &[20.0]],
    similar: &["torque_limit", "viscous_friction"],
    nested: &[("torque_limit", &[1.0, 1e9])],
};

impl Effect for SpeedTorqueLimit {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn is_of_motor(&self) -> bool {
        true
    }

    fn motor(&self, p: &[f64], _memory: &mut [f64], motor: &mut MotorTorque, _state: &JointInput) {
        motor.limit_to_line(p[0], p[1]);
    }
}
