//! A motor that gets weaker as it gets warm: its magnets fade, its winding resists.
//!
//! The energy is what it has put into the joint or taken from it since the start; nothing cools it down.

use crate::effects::effect::{EffectSpec, Effect, Param, SiteKind};
use crate::actuation::{JointInput, MotorTorque};

pub(in crate::effects) struct ThermalFade;

static SPEC: EffectSpec = EffectSpec {
    name: "thermal_fade",
    law: "the motor's torque and its limit times exp(-rate·∫|torque·dq|dt)",
    site: SiteKind::Joint,
    cite: "a constant decay per energy: the simplest law of a winding that heats up",
    symptom: "the error grows in the course of a run while the motion repeats itself",
    params: &[Param::new("rate", "1/J", (0.0, 10.0), 0.1)],
    starts: &[],
    similar: &[],
    nested: &[],
};

/// The memory is the energy so far, in J.
impl Effect for ThermalFade {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn memory(&self, _p: &[f64], _dt_s: f64) -> usize {
        1
    }

    fn motor(&self, p: &[f64], memory: &mut [f64], motor: &mut MotorTorque, state: &JointInput) {
        let [spent] = memory else { return };
        *spent += (state.torque * state.dq).abs() * state.dt_s;
        motor.scale((-p[0] * *spent).exp());
    }
}
