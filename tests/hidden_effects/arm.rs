//! The desk arm of `robots/arm.toml`. Its turret turns about the vertical and does nothing else, so that a single
//! number says all of its inertia: that of the motor below it, `armature@yaw`, as well.

use crate::excite;
use crate::reality::Subject;
use btr_physics::effects::FormulaTarget;

/// It has encoders only, and its base does not move.
pub(crate) static ARM: Subject = Subject {
    file: "../robots/arm.toml",
    prepare: |_| {},
    training: excite::training,
    held_out: excite::held_out,
    seen: &["q_", "cmd_"],
    silent: &["imu_bias"],
    one_number: &[("link_inertia", "turret"), ("com_offset", "turret")],
    max_rollouts: usize::MAX,
    outside: &[
        (FormulaTarget::Torque, "-8*max(0,q-0.2)^2"),
        (FormulaTarget::Torque, "0.35*sin(19*t)"),
        (FormulaTarget::Torque, "-0.25*sign(dq)*max(0,sin(5*t))"),
        (FormulaTarget::Torque, "-1.2*dq*max(0,q)"),
        (FormulaTarget::Command, "cmd+0.08*sin(3*t)*cmd"),
        (FormulaTarget::Torque, "-0.6*min(1,t/4)*sin(4*q)"),
    ],
};
