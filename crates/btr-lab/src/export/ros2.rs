//! ROS 2: `joint_limits.yaml`, as MoveIt and ros2_control read it.

use super::facts::{JointFacts, joints};
use super::request::{Exported, Request, number};
use super::rest;
use std::fmt::Write;

pub(super) fn write(request: &Request) -> Result<Exported, String> {
    let mut facts = joints(request.outline);
    let mut exported =
        Exported { text: format!("# From {} by btr. SI units.\njoint_limits:\n", request.name), ..Exported::default() };
    for joint in &mut facts {
        push(&mut exported, joint);
        joint.leave_dynamics();
        joint.leave_friction();
    }
    exported.left = rest::lines(&facts, &request.outline.others);
    exported.left.extend(facts.iter().filter_map(rest::gains));
    exported.effects = rest::document(&facts, &request.outline.others);
    Ok(exported)
}

/// A number that YAML reads as a real one: ROS refuses an integer.
fn real(x: f64) -> String {
    let text = number(x);
    if text.contains(['.', 'e']) { text } else { text + ".0" }
}

fn push(exported: &mut Exported, joint: &JointFacts) {
    let (lower, upper) = joint.limits;
    let limits = [
        (
            "position",
            lower.is_finite() && upper.is_finite(),
            format!("    min_position: {}\n    max_position: {}\n", real(lower), real(upper)),
        ),
        ("velocity", joint.speed_limit.is_finite(), format!("    max_velocity: {}\n", real(joint.speed_limit))),
        ("effort", joint.torque_limit.is_finite(), format!("    max_effort: {}\n", real(joint.torque_limit))),
    ];
    let _ = writeln!(exported.text, "  {}:", serde_json::Value::from(joint.name.as_str()));
    for (what, has, values) in limits {
        let _ = write!(exported.text, "    has_{what}_limits: {has}\n{}", if has { values.as_str() } else { "" });
        if has && what == "effort" {
            exported.carried.push(format!("{}: max_effort {:.4}", joint.name, joint.torque_limit));
        }
    }
}
