//! Isaac Lab: an actuator configuration for each joint, in the fields of `isaaclab.actuators`. Friction is a torque in
//! Isaac Sim 5.0 and later.

mod events;

use super::facts::{JointFacts, joints};
use super::randomize::middle;
use super::request::{Exported, Request, number};
use super::rest;
use std::fmt::Write;

/// The classes of configurations: with a dead time of the command, and without.
const DELAYED: &str = "DelayedPDActuatorCfg";
const IMPLICIT: &str = "ImplicitActuatorCfg";

pub(super) fn write(request: &Request) -> Result<Exported, String> {
    let mut facts = joints(request.outline);
    let mut exported = Exported::default();
    let drawn: Vec<Vec<JointFacts>> = request.drawn.iter().map(joints).collect();
    for (k, joint) in facts.iter_mut().enumerate() {
        let delays = drawn.iter().filter_map(|draw| Some(draw.get(k)?.delay_s));
        let delays = if drawn.is_empty() { [joint.delay_s; 2] } else { middle(delays) };
        push(&mut exported, joint, delays, request.step_s);
    }
    let terms = events::terms(request, &facts, &drawn);
    let dictionary = terms.dictionary();
    exported.left.extend(terms.left);
    let imports = if dictionary.is_some() { events::IMPORTS } else { "" };
    let classes = [DELAYED, IMPLICIT].into_iter().filter(|class| exported.text.contains(*class));
    exported.text = format!(
        "\"\"\"Actuators from {}, written by btr. SI units; friction is a torque, as in Isaac Sim 5.0 and later.\"\"\"\n\n\
         from isaaclab.actuators import {}\n{imports}\nACTUATORS = {{\n{}}}\n{}",
        request.name.replace('\\', "/").replace('"', "'"),
        classes.collect::<Vec<_>>().join(", "),
        exported.text,
        dictionary.map_or_else(String::new, |terms| format!("\n{terms}"))
    );
    exported.left.extend(rest::lines(&facts, &request.outline.others));
    exported.effects = rest::document(&facts, &request.outline.others);
    Ok(exported)
}

fn push(exported: &mut Exported, joint: &mut JointFacts, delays_s: [f64; 2], step_s: f64) {
    let [least, most] = delays_s.map(|delay_s| (delay_s / step_s).round() as u64);
    let class = if most > 0 { DELAYED } else { IMPLICIT };
    let name = serde_json::Value::from(joint.name.as_str());
    let expression = serde_json::Value::from(events::escaped(&joint.name));
    let text = &mut exported.text;
    let _ = write!(text, "    {name}: {class}(\n        joint_names_expr=[{expression}],\n");
    // `None` leaves what the asset has.
    let unknown = if joint.is_driven_otherwise { Some(0.0) } else { None };
    let finite = |x: f64| Some(x).filter(|x| x.is_finite());
    let fields = [
        ("stiffness", joint.gains.map(|(kp, _)| kp).or(unknown)),
        ("damping", joint.gains.map(|(_, kd)| kd).or(unknown)),
        ("effort_limit", finite(joint.torque_limit)),
        ("velocity_limit", finite(joint.speed_limit)),
        ("armature", Some(joint.armature)),
        ("friction", Some(joint.static_friction.max(joint.coulomb))),
        ("dynamic_friction", Some(joint.coulomb)),
        ("viscous_friction", Some(joint.viscous)),
    ];
    for (field, value) in fields {
        let _ = writeln!(text, "        {field}={},", value.map_or_else(|| "None".to_owned(), number));
        if let Some(value) = value.filter(|value| *value != 0.0 && field != "velocity_limit") {
            exported.carried.push(format!("{}: {field} {value:.4}", joint.name));
        }
    }
    if most > 0 {
        let delay_s = joint.delay_s;
        let _ = writeln!(text, "        # {delay_s:.4} s in physics steps of {step_s} s");
        let _ = writeln!(text, "        min_delay={least},\n        max_delay={most},");
        let range = if least == most { most.to_string() } else { format!("{least} to {most}") };
        exported.carried.push(format!("{}: delay {range} steps", joint.name));
    } else if joint.delay_s > 0.0 {
        exported.left.push(format!("{}: a dead time of {:.4} s, below half a step", joint.name, joint.delay_s));
    }
    text.push_str("    ),\n");
    joint.leave_spring();
}
