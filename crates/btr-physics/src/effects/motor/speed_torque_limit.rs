//! The torque-speed line of a motor: its back-EMF leaves the less voltage for torque the faster it turns. Braking, the
//! back-EMF helps, and the whole torque is there.

use crate::effects::effect::{EffectSpec, Effect, Param, SiteKind};
use crate::actuation::{JointInput, MotorTorque};

pub(in crate::effects) struct SpeedTorqueLimit;

static SPEC: EffectSpec = EffectSpec {
    name: "speed_torque_limit",
    law: "the motor's torque is clamped to ±torque·(1 - |dq|/speed), never below 0, while it drives; to ±torque while it brakes",
    site: SiteKind::Joint,
    cite: "torque-speed line of a DC motor, as in any servo's data sheet",
    symptom: "the joint falls behind in fast stretches although its torque is far from what it gives at rest",
    params: &[Param::limit("torque", "N·m", (0.01, 100.0), 1.5), Param::shape("speed", "rad/s", (0.1, 200.0), 4.0)],
    starts: &[&[2.0], &[6.0], &[20.0]],
    similar: &["torque_limit", "viscous_friction"],
    nested: &[("torque_limit", &[1.0, 1e9])],
};

impl Effect for SpeedTorqueLimit {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn motor(&self, p: &[f64], _memory: &mut [f64], motor: &mut MotorTorque, _state: &JointInput) {
        motor.limit_to_line(p[0], p[1]);
    }
}
