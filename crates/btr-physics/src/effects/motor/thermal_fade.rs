//! Motor that weakens as it heats up: its magnets lose flux, its winding's resistance rises.
//!
//! The energy is the mechanical work delivered to or absorbed from the joint since the start; there is no cooling.

use crate::actuation::{JointInput, MotorTorque};
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};

pub(in crate::effects) struct ThermalFade;

static SPEC: EffectSpec = EffectSpec {
    name: "thermal_fade",
    law: "the motor's torque and its limit times exp(-rate·∫|torque·dq|dt)",
    site: SiteKind::Joint,
    cite: "constant decay per energy, the simplest law of a winding that heats up",
    symptom: "the error grows over the run while the motion repeats",
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

    fn is_of_motor(&self) -> bool {
        true
    }

    fn memory(&self, _p: &[f64], _dt_s: f64) -> usize {
        1
    }

    fn motor(&self, p: &[f64], memory: &mut [f64], motor: &mut MotorTorque, state: &JointInput) {
        let [energy_j] = memory else { return };
        *energy_j += (state.torque * state.dq).abs() * state.dt_s;
        motor.scale((-p[0] * *energy_j).exp());
    }
}
