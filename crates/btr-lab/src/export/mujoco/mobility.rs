//! How easily torques move the joints, on which MuJoCo's softness of dry friction and the needed time step depend.

use super::super::facts::JointFacts;
use btr_physics::engine::{BaseState, RobotState};
use btr_physics::model::Model;
use nalgebra::{Isometry3, Vector3};

/// The acceleration of each joint per torque that acts on it, in 1/(kg·m²) (1/kg), where all joints are at 0: MuJoCo's
/// `dof_invweight0`. `None` where it is not known.
pub(super) fn mobilities(model: &Model) -> Vec<Option<f64>> {
    let joints = model.robot.movable().count();
    let base =
        BaseState { pose: Isometry3::identity(), velocity_m_s: Vector3::zeros(), angular_rad_s: Vector3::zeros() };
    let state = RobotState { joints: vec![(0.0, 0.0); joints], base };
    let s = model.simulations.nominal();
    let accelerations = |torques: &[f64]| model.accelerations(&s, &state, torques).ok();
    let at_rest = accelerations(&vec![0.0; joints]);
    let of_joint = |joint: usize| {
        let mut torques = vec![0.0; joints];
        torques[joint] = 1.0;
        let (moved, at_rest) = (accelerations(&torques)?, at_rest.as_ref()?);
        // Those of a floating base come first.
        let at = at_rest.len() - joints + joint;
        Some(moved[at] - at_rest[at]).filter(|mobility| *mobility > 0.0)
    };
    (0..joints).map(of_joint).collect()
}

/// How fast a joint settles on its servo's command, in 1/s: its servo, springs and damping over its inertia.
pub(super) fn rate(joint: &JointFacts, mobility: f64) -> f64 {
    let (kp, kd) = joint.gains.unwrap_or_default();
    (mobility * (kd + joint.viscous)).max((mobility * (kp + joint.stiffness)).max(0.0).sqrt())
}

/// Creep of dry friction as MuJoCo's softness of it: `solreffriction` and `solimpfriction`.
///
/// MuJoCo's dry friction gives way at `dq + ddq/b = R/b·torque` with `b = 2/(dmax·time constant)` and
/// `R = (1 - d)/d·mobility`; no position acts, so d is the impedance at 0 (its documentation, chapter Computation). The
/// law of the effect `friction_creep` is the same, with its time constant for `1/b`. MuJoCo takes time constants below
/// two steps as two.
pub(super) fn softness(creep: f64, time_s: f64, mobility: f64, step_s: f64) -> [f64; 2] {
    const IMPEDANCES: (f64, f64) = (0.0001, 0.9999);
    let lag_s = time_s.max(step_s);
    let impedance = (1.0 / (1.0 + creep / (lag_s * mobility))).clamp(IMPEDANCES.0, IMPEDANCES.1);
    [2.0 * lag_s / impedance, impedance]
}
