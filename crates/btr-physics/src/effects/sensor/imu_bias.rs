//! Constant bias of an inertial sensor, in its own axes.

use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use btr_core::log::Log;

pub(in crate::effects) struct ImuBias;

static SPEC: EffectSpec = EffectSpec {
    name: "imu_bias",
    law: "the bias is added to the readings of gyroscope and accelerometer",
    site: SiteKind::Base,
    cite: "Titterton and Weston, Strapdown Inertial Navigation Technology, 2004",
    symptom: "a constant error on an axis of the gyroscope or the accelerometer, whatever the motion",
    params: &[
        Param::new("gyro_x", "rad/s", (-0.5, 0.5), 0.02),
        Param::new("gyro_y", "rad/s", (-0.5, 0.5), 0.02),
        Param::new("gyro_z", "rad/s", (-0.5, 0.5), 0.02),
        Param::new("acc_x", "m/s^2", (-3.0, 3.0), 0.2),
        Param::new("acc_y", "m/s^2", (-3.0, 3.0), 0.2),
        Param::new("acc_z", "m/s^2", (-3.0, 3.0), 0.2),
    ],
    starts: &[],
    similar: &[],
    nested: &[],
};

impl Effect for ImuBias {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn sense(&self, p: &[f64], _site: &str, log: &mut Log) {
        for (param, bias) in self.spec().params.iter().zip(p) {
            if let Some(values) = log.values_mut(&format!("imu_{}", param.name)) {
                values.iter_mut().for_each(|value| *value += bias);
            }
        }
    }
}
