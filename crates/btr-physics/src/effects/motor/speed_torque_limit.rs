//! Torque-speed line of a motor: the faster it turns, the less voltage its back-EMF leaves for torque. While braking,
//! the back-EMF helps, and the whole torque is available.

use crate::actuation::{JointInput, MotorTorque};
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::robot::Robot;

/// The speed without load, in multiples of the largest measured speed, from which a search starts: a joint that this
/// limits comes close to it.
const OF_TOP_SPEED: [f64; 4] = [1.02, 1.4, 2.5, 6.0];

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

    fn starts(&self, _robot: &Robot, _link: usize, top_speed: Option<f64>) -> Vec<Vec<f64>> {
        match top_speed {
            Some(top) => OF_TOP_SPEED.iter().map(|factor| vec![factor * top]).collect(),
            None => SPEC.starts.iter().map(|values| values.to_vec()).collect(),
        }
    }

    fn motor(&self, p: &[f64], _memory: &mut [f64], motor: &mut MotorTorque, _state: &JointInput) {
        motor.limit_to_line(p[0], p[1]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Actuator;

    #[test]
    fn a_search_begins_where_the_joint_gets_little_torque_at_its_largest_speed() {
        let robot = crate::presets::pendulum::pendulum(1.0, 0.5, Actuator::Passive);
        let starts = SpeedTorqueLimit.starts(&robot, 1, Some(2.8));
        assert!(starts.iter().all(|values| values[0] > 2.8) && starts[0][0] < 1.1 * 2.8, "{starts:?}");
        assert_eq!(SpeedTorqueLimit.starts(&robot, 1, None).len(), SPEC.starts.len());
    }
}
