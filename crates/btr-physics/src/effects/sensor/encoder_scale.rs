//! Scale error of an encoder, which counts too much or too little per turn: the servo and the log use its reading.

use crate::actuation::JointInput;
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::engine::{Affine, Dof};
use btr_core::log::Log;

pub(in crate::effects) struct EncoderScale;

static SPEC: EffectSpec = EffectSpec {
    name: "encoder_scale",
    law: "the reading is (1 + error)·q, and so is its velocity",
    site: SiteKind::Joint,
    cite: "gain error of a potentiometer, a wrong gear ratio",
    symptom: "a position error that grows with the distance from zero",
    params: &[Param::new("error", "1", (-0.5, 1.0), 0.05)],
    starts: &[],
    similar: &["encoder_offset"],
    nested: &[],
};

impl Effect for EncoderScale {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn changes_readings(&self) -> bool {
        true
    }

    fn encoder(&self, p: &[f64], _memory: &mut [f64], state: &JointInput) -> (f64, f64) {
        let gain = 1.0 + p[0];
        (gain * state.q, gain * state.dq)
    }

    fn transmit(&self, p: &[f64], _memory: &mut [f64], motor: Affine, _dof: &mut Dof, _state: &JointInput) -> Affine {
        let gain = 1.0 + p[0];
        Affine { constant: motor.constant, stiffness: gain * motor.stiffness, damping: gain * motor.damping }
    }

    fn start(&self, p: &[f64], reading: f64) -> f64 {
        reading / (1.0 + p[0])
    }

    fn sense(&self, p: &[f64], joint: &str, log: &mut Log) {
        for channel in ["q", "dq"] {
            if let Some(values) = log.values_mut(&format!("{channel}_{joint}")) {
                values.iter_mut().for_each(|value| *value *= 1.0 + p[0]);
            }
        }
    }
}
