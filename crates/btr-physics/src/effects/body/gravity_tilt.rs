//! Base that is not level: in the robot's frame, gravity is tilted the opposite way.
//!
//! Roll and pitch follow URDF: first about x, then about y. The floor tilts with gravity.

use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::setup::Setup;
use nalgebra::UnitQuaternion;

pub(in crate::effects) struct GravityTilt;

static SPEC: EffectSpec = EffectSpec {
    name: "gravity_tilt",
    law: "the world under the robot is rolled about x, then pitched about y",
    site: SiteKind::Base,
    cite: "URDF's roll and pitch",
    symptom: "static errors that follow the posture, as if gravity were not vertical",
    params: &[Param::new("roll", "rad", (-0.5, 0.5), 0.05), Param::new("pitch", "rad", (-0.5, 0.5), 0.05)],
    starts: &[],
    similar: &["com_offset", "encoder_offset"],
    nested: &[],
};

impl Effect for GravityTilt {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn world(&self, p: &[f64], setup: &mut Setup) {
        let mounting = UnitQuaternion::from_euler_angles(p[0], p[1], 0.0);
        setup.gravity_m_s2 = mounting.inverse() * setup.gravity_m_s2;
    }
}
