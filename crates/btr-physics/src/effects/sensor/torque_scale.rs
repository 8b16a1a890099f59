//! Scale error of a logged torque: a torque constant, a gear ratio or a sign that is not the drive's.

use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::robot::{Actuator, Robot};
use btr_core::log::Log;

pub(in crate::effects) struct TorqueScale;

static SPEC: EffectSpec = EffectSpec {
    name: "torque_scale",
    law: "the reading is (1 + error)·tau; with the wrong sign, the error is -2",
    site: SiteKind::Joint,
    cite: "Gautier and Briot, New Method for Global Identification of the Joint Drive Gains of Robots using a Known \
           Payload Mass, IROS 2011",
    symptom: "a torque error in proportion to the torque, for the weight of known links as for friction",
    params: &[Param::new("error", "1", (-3.0, 3.0), 0.1)],
    starts: &[],
    similar: &["payload", "armature"],
    nested: &[],
};

impl Effect for TorqueScale {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn is_for_prescribed_motion(&self) -> bool {
        true
    }

    /// Where the motion is simulated, the torque follows from it, and its reading is compared with nothing else.
    fn acts_on(&self, robot: &Robot, link: usize) -> bool {
        robot.links.get(link).is_some_and(|link| link.joint.actuator == Actuator::Prescribed)
    }

    fn sense(&self, p: &[f64], joint: &str, log: &mut Log) {
        if let Some(torques) = log.values_mut(&format!("tau_{joint}")) {
            torques.iter_mut().for_each(|torque| *torque *= 1.0 + p[0]);
        }
    }
}
