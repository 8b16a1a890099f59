//! Cogging: a torque that is periodic in the position, from magnets attracted by the stator's teeth or from an
//! eccentric gear. Orders below 2 are left out: a torque that repeats once a turn is that of gravity on a link.

use crate::actuation::JointInput;
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind, TorqueLaw};
use crate::engine::Dof;
use std::f64::consts::PI;

/// A third of a turn.
const THIRD: f64 = 2.0 * PI / 3.0;

pub(in crate::effects) struct Cogging;

static SPEC: EffectSpec = EffectSpec {
    name: "cogging",
    law: "amplitude·sin(order·q + phase)",
    site: SiteKind::Joint,
    cite: "Krishnan, Permanent Magnet Synchronous and Brushless DC Motor Drives, 2010",
    symptom: "a ripple in the torque residual that repeats with the position, the same at every speed",
    params: &[
        Param::new("amplitude", "N·m", (0.0, 5.0), 0.1),
        Param::shape("order", "1", (2.0, 100.0), 6.0),
        Param::shape("phase", "rad", (-PI, PI), 0.0),
    ],
    // An amplitude is not negative: three phases reach every other one within a sixth of a turn. The orders of faster
    // ripples come from the error.
    starts: &[
        &[2.0, -THIRD],
        &[2.0, 0.0],
        &[2.0, THIRD],
        &[3.0, -THIRD],
        &[3.0, 0.0],
        &[3.0, THIRD],
        &[4.0, -THIRD],
        &[4.0, 0.0],
        &[4.0, THIRD],
        &[5.0, -THIRD],
        &[5.0, 0.0],
        &[5.0, THIRD],
        &[6.0, -THIRD],
        &[6.0, 0.0],
        &[6.0, THIRD],
    ],
    similar: &["com_offset", "parallel_spring"],
    nested: &[],
};

impl Effect for Cogging {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn torque_law(&self) -> TorqueLaw {
        TorqueLaw::Proportional
    }

    /// Magnets, slots, and every stage of a gear have orders of their own.
    fn instances(&self) -> usize {
        5
    }

    fn torque(&self, p: &[f64], _memory: &mut [f64], dof: &mut Dof, state: &JointInput) {
        dof.torque.constant += p[0] * (p[1] * state.q + p[2]).sin();
    }
}
