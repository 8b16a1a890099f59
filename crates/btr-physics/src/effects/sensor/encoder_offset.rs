//! Zero offset of an encoder: the servo and the log use its reading.

use crate::actuation::JointInput;
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::engine::{Affine, Dof};
use btr_core::log::Log;

pub(in crate::effects) struct EncoderOffset;

static SPEC: EffectSpec = EffectSpec {
    name: "encoder_offset",
    law: "the reading is q + offset",
    site: SiteKind::Joint,
    cite: "a horn or a magnet that is mounted one tooth off",
    symptom: "a constant position error, and a gravity torque that does not match the reading",
    params: &[Param::new("offset", "rad", (-0.5, 0.5), 0.03)],
    starts: &[],
    similar: &["com_offset", "gravity_tilt"],
    nested: &[],
};

impl Effect for EncoderOffset {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn changes_readings(&self) -> bool {
        true
    }

    fn encoder(&self, p: &[f64], _memory: &mut [f64], state: &JointInput) -> (f64, f64) {
        (state.q + p[0], state.dq)
    }

    fn transmit(&self, p: &[f64], _memory: &mut [f64], motor: Affine, _dof: &mut Dof, _state: &JointInput) -> Affine {
        Affine { constant: motor.constant - motor.stiffness * p[0], ..motor }
    }

    fn start(&self, p: &[f64], reading: f64) -> f64 {
        reading - p[0]
    }

    fn sense(&self, p: &[f64], joint: &str, log: &mut Log) {
        if let Some(q) = log.values_mut(&format!("q_{joint}")) {
            q.iter_mut().for_each(|q| *q += p[0]);
        }
    }
}
