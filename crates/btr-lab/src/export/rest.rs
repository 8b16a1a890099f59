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
    let effect = |placed: &PlacedEffect| {
        let values = placed.effect.spec().params.iter().zip(&placed.values);
        let named = std::iter::once(("effect".to_owned(), json!(placed.effect.spec().name)));
        Value::Object(named.chain(values.map(|(param, value)| (param.name.to_owned(), json!(value)))).collect())
    };
    let effects = |left: &[PlacedEffect]| left.iter().map(effect).collect::<Vec<_>>();
    let with_effects = joints.iter().filter(|joint| !joint.left.is_empty());
    let of_joints: Map<String, Value> =
        with_effects.map(|joint| (joint.name.clone(), effects(&joint.left).into())).collect();
    if of_joints.is_empty() && others.is_empty() {
        return None;
    }
    let document = json!({ "joints": of_joints, "robot": effects(others) });
    serde_json::to_string_pretty(&document).ok().map(|text| text + "\n")
}
