//! A base that does not stand level: seen from the robot, gravity is tilted the other way.
//!
//! Roll and pitch are those of URDF: first about x, then about y. A floor tilts along.

use crate::effects::effect::{EffectSpec, Effect, Param, SiteKind};
use crate::setup::Setup;
use nalgebra::UnitQuaternion;

pub(in crate::effects) struct GravityTilt;

static SPEC: EffectSpec = EffectSpec {
    name: "gravity_tilt",
    law: "the world under the robot is rolled about x, then pitched about y",
    site: SiteKind::Base,
    cite: "URDF's roll and pitch",
    symptom: "static errors that follow the posture, as if everything hung a little aside",
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
