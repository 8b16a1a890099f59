//! A base that does not stand level: seen from the robot, gravity is tilted the other way.
//!
//! Roll and pitch are those of URDF: first about x, then about y. A floor tilts along.

use crate::effects::effect::{EffectSpec, Effect, Param, SiteKind};
use crate::setup::Setup;
use nalgebra::UnitQuaternion;

pub(in crate::effects) struct GravityTilt;

static CARD: EffectSpec = EffectSpec {
    name: "gravity_tilt",
    law: "the world under the robot is rolled about x, then pitched about y",
    site: SiteKind::Base,
    cite: "URDF's roll and pitch",
    tell: "static errors that follow the posture, as if everything hung a little aside",
    params: &[Param::new("roll", "rad", (-0.5, 0.5), 0.05), Param::new("pitch", "rad", (-0.5, 0.5), 0.05)],
    starts: &[],
    alike: &["com_offset", "encoder_offset"],
    contains: &[],
};

impl Effect for GravityTilt {
    fn card(&self) -> &'static EffectSpec {
        &CARD
    }

    fn world(&self, p: &[f64], setup: &mut Setup) {
        let mounting = UnitQuaternion::from_euler_angles(p[0], p[1], 0.0);
        setup.gravity_m_s2 = mounting.inverse() * setup.gravity_m_s2;
    }
}
