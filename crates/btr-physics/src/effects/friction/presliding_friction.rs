//! Friction with presliding (P. R. Dahl's model): before the contacts slide they bend like a stiff spring. Bearings and
//! harmonic drives do so over milliradians.

use crate::actuation::JointInput;
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind, TorqueLaw};
use crate::engine::{Affine, Dof};

pub(in crate::effects) struct PreslidingFriction;

static SPEC: EffectSpec = EffectSpec {
    name: "presliding_friction",
    law: "a torque F against the motion, with dF/dq = stiffness·(1 - F/torque·sign(dq))",
    site: SiteKind::Joint,
    cite: "Dahl, Solid friction damping of spacecraft oscillations, The Aerospace Corporation, 1975 (DTIC ADA018650)",
    symptom: "as Coulomb friction in long motions; after each reversal the torque residual grows with the position, over a \
              short way",
    params: &[Param::new("torque", "N·m", (0.0, 5.0), 0.1), Param::shape("stiffness", "N·m/rad", (0.1, 1e5), 5.0)],
    starts: &[&[1.0], &[10.0], &[100.0]],
    similar: &["coulomb_friction", "stribeck_friction", "backlash"],
    nested: &[("coulomb_friction", &[0.1, 1e5])],
};

/// The memory holds whether there was a position, the position, and the torque F.
impl Effect for PreslidingFriction {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn torque_law(&self) -> TorqueLaw {
        TorqueLaw::OfMotion
    }

    fn memory(&self, _p: &[f64], _dt_s: f64) -> usize {
        3
    }

    fn torque(&self, p: &[f64], memory: &mut [f64], dof: &mut Dof, state: &JointInput) {
        let ([started, before, force], (torque, stiffness)) = (memory, (p[0], p[1])) else { return };
        if torque <= 0.0 {
            return;
        }
        if stiffness * state.dt_s.powi(2) > state.inertia {
            // A spring that a step does not resolve is Coulomb's law, which the engine solves exactly.
            dof.dry_friction += torque;
            return;
        }
        if *started > 0.0 {
            // The law's solution over a motion in one direction.
            let (motion, full) = (state.q - *before, torque.copysign(state.q - *before));
            *force = full - (full - *force) * (-stiffness * motion.abs() / torque).exp();
        }
        (*started, *before) = (1.0, state.q);
        let bends = stiffness * (1.0 - *force / torque.copysign(state.dq_midpoint())).max(0.0);
        dof.torque.add(&Affine { constant: bends * state.q - *force, stiffness: bends, damping: 0.0 });
    }
}
