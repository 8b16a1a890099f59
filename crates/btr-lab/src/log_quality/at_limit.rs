//! Torques of the model that stand at their limit.

use btr_core::log::Log;
use btr_physics::effects::PlacedEffect;
use btr_physics::model::Model;
use btr_physics::robot::{Actuator, Joint};

/// Share of the samples of a log from which on it is told.
const WORTH_TELLING: f64 = 0.02;
/// A torque this close to its limit, as a share of it, is at it.
const CLOSE: f64 = 1e-6;

/// A limit of a joint's torque.
struct Limit {
    torque: f64,
    /// Where the model states it.
    setting: String,
}

/// A warning for each joint whose torque is at its limit in a good part of a log; `simulated` are the model's motions
/// in its scenarios.
pub(crate) fn warnings(model: &Model, simulated: &[Option<Log>]) -> Vec<String> {
    let Ok(outline) = model.outline() else { return Vec::new() };
    let joints = outline.robot.movable().map(|(_, link)| &link.joint).zip(&outline.joints);
    let warning = |(joint, effects): (&Joint, &Vec<PlacedEffect>)| {
        let limit = limit(joint, effects)?;
        let shares =
            simulated.iter().enumerate().filter_map(|(k, log)| Some((k, share(log.as_ref()?, joint, &limit)?)));
        let (k, share) = shares.max_by(|(_, a), (_, b)| a.total_cmp(b)).filter(|(_, share)| *share > WORTH_TELLING)?;
        Some(format!(
            "{}: the model is at its limit of {} {} for {:.0} % of {}: if the robot can do more, raise {} \
             before an effect is added for the errors there",
            joint.name,
            limit.torque,
            joint.torque_unit(),
            100.0 * share,
            model.scenarios[k].name,
            limit.setting
        ))
    };
    joints.filter_map(warning).collect()
}

/// The lowest limit of a joint's torque, if it has one.
fn limit(joint: &Joint, effects: &[PlacedEffect]) -> Option<Limit> {
    let of_motor = match joint.actuator {
        Actuator::Position { max_torque, .. } | Actuator::Torque { max_torque } => max_torque,
        Actuator::Passive | Actuator::Prescribed | Actuator::Voltage { .. } => f64::INFINITY,
    };
    let of_motor = Limit { torque: of_motor, setting: format!("max_torque of {} in [actuators]", joint.name) };
    let of_effect = |placed: &PlacedEffect| match (placed.effect.spec().name, placed.values.as_slice()) {
        ("torque_limit", [torque]) => {
            Some(Limit { torque: *torque, setting: format!("torque of the effect torque_limit@{}", joint.name) })
        }
        _ => None,
    };
    let all = effects.iter().filter_map(of_effect).chain([of_motor]).filter(|limit| limit.torque.is_finite());
    all.min_by(|a, b| a.torque.total_cmp(&b.torque))
}

/// The share of a log's samples in which a joint's torque is at its limit.
fn share(log: &Log, joint: &Joint, limit: &Limit) -> Option<f64> {
    let torques = log.values(&format!("tau_{}", joint.name)).ok()?;
    let is_at = |torque: &&f64| torque.abs() >= (1.0 - CLOSE) * limit.torque;
    Some(torques.iter().filter(is_at).count() as f64 / torques.len().max(1) as f64)
}
