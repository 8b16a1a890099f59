//! What a format cannot say.

use super::facts::JointFacts;
use btr_physics::effects::{Param, PlacedEffect};
use serde_json::{Map, Value, json};

/// A line for each effect that is left.
pub(super) fn lines(joints: &[JointFacts], others: &[PlacedEffect]) -> Vec<String> {
    let of_joints = joints.iter().flat_map(|joint| joint.left.iter().map(|placed| (joint.name.as_str(), placed)));
    let all = of_joints.chain(others.iter().map(|placed| (placed.site.as_str(), placed)));
    all.map(|(site, placed)| format!("{site}: {}", said(placed))).collect()
}

/// An effect with its values.
fn said(placed: &PlacedEffect) -> String {
    let values = placed.effect.spec().params.iter().zip(&placed.values);
    let unit = |unit: &'static str| if unit == "1" { String::new() } else { format!(" {unit}") };
    let value = |(param, value): (&Param, &f64)| format!("{} {value:.4}{}", param.name, unit(param.unit));
    let values: Vec<String> = values.map(value).collect();
    format!("{} ({})", placed.effect.spec().name, values.join(", "))
}

/// The gains of a joint's servo, for formats that have no place for them.
pub(super) fn gains(joint: &JointFacts) -> Option<String> {
    joint.gains.map(|(kp, kd)| format!("{}: gains of its servo, kp {kp:.4} and kd {kd:.4}", joint.name))
}

/// The effects that are left, as JSON: those of each joint in the order in which they act, with their parameters in SI
/// units. `None` without any.
pub(super) fn document(joints: &[JointFacts], others: &[PlacedEffect]) -> Option<String> {
    let with_effects = joints.iter().filter(|joint| !joint.left.is_empty());
    let of_joints: Map<String, Value> =
        with_effects.map(|joint| (joint.name.clone(), effects_of(joint).into())).collect();
    if of_joints.is_empty() && others.is_empty() {
        return None;
    }
    let others: Vec<Value> = others.iter().map(|placed| Value::Object(values(placed))).collect();
    let document = json!({ "joints": of_joints, "robot": others });
    serde_json::to_string_pretty(&document).ok().map(|text| text + "\n")
}

/// The effects of a joint that are left. Those with a rotor say its inertia, unless it is the joint's armature, which
/// the one next to the motor has.
fn effects_of(joint: &JointFacts) -> Vec<Value> {
    let mut armature = joint.armature;
    let effect = |placed: &PlacedEffect| {
        let mut values = values(placed);
        if placed.has_rotor() && std::mem::take(&mut armature) <= 0.0 {
            values.insert("rotor_inertia".to_owned(), json!(joint.unknown_rotor));
        }
        Value::Object(values)
    };
    let mut effects: Vec<Value> = joint.left.iter().rev().map(effect).collect();
    effects.reverse();
    effects
}

/// An effect's name and values.
fn values(placed: &PlacedEffect) -> Map<String, Value> {
    let values = placed.effect.spec().params.iter().zip(&placed.values);
    let named = std::iter::once(("effect".to_owned(), json!(placed.effect.spec().name)));
    named.chain(values.map(|(param, value)| (param.name.to_owned(), json!(value)))).collect()
}
