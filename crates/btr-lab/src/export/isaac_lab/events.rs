//! Event terms of Isaac Lab that randomise what is uncertain.

use super::super::facts::JointFacts;
use super::super::randomize::middle;
use super::super::request::{Request, number};
use std::fmt::Write;

/// Least share of a value by which it must vary to be randomised.
const VARIES: f64 = 1e-3;

/// The names that the terms import.
pub(super) const IMPORTS: &str =
    "from isaaclab.envs import mdp\nfrom isaaclab.managers import EventTermCfg, SceneEntityCfg\n";

/// Event terms, and what is uncertain and in none of them, a line each.
#[derive(Default)]
pub(super) struct Terms {
    text: String,
    pub(super) left: Vec<String>,
}

/// The terms of all joints and links; `drawn` are the joints at each draw.
pub(super) fn terms(request: &Request, joints: &[JointFacts], drawn: &[Vec<JointFacts>]) -> Terms {
    let mut terms = Terms::default();
    for (k, joint) in joints.iter().enumerate() {
        let drawn: Vec<&JointFacts> = drawn.iter().filter_map(|draw| draw.get(k)).collect();
        terms.of_joint(joint, &drawn);
    }
    for (k, link) in request.outline.robot.links.iter().enumerate() {
        let masses = request.drawn.iter().filter_map(|draw| Some(draw.robot.links.get(k)?.mass_kg));
        let range = Some(middle(masses)).filter(|range| varies(*range, link.mass_kg));
        let term = [("mass_distribution_params", range)];
        push(&mut terms.text, &link.name, "mass", "randomize_rigid_body_mass", ("body_names", "abs"), &term);
    }
    terms
}

impl Terms {
    /// The terms as a Python dictionary; `None` where there are none.
    pub(super) fn dictionary(&self) -> Option<String> {
        let text = &self.text;
        (!text.is_empty()).then(|| format!("# The middle 95 % of what the fit leaves.\nEVENTS = {{\n{text}}}\n"))
    }

    fn of_joint(&mut self, joint: &JointFacts, drawn: &[&JointFacts]) {
        let range = |of: &dyn Fn(&JointFacts) -> f64| {
            Some(middle(drawn.iter().map(|joint| of(joint)))).filter(|range| varies(*range, of(joint)))
        };
        let kp = |joint: &JointFacts| joint.gains.map_or(0.0, |gains| gains.0);
        let kd = |joint: &JointFacts| joint.gains.map_or(0.0, |gains| gains.1);
        let gains = [("stiffness_distribution_params", range(&kp)), ("damping_distribution_params", range(&kd))];
        push(&mut self.text, &joint.name, "gains", "randomize_actuator_gains", ("joint_names", "abs"), &gains);
        let mut scaled = |what: &str, of: &dyn Fn(&JointFacts) -> f64| {
            let [low, high] = range(of)?;
            let value = of(joint);
            if value == 0.0 {
                let name = &joint.name;
                self.left.push(format!(
                    "{name}: {what} from {low:.4} to {high:.4}: it is 0, and Isaac Lab's terms only scale it"
                ));
                return None;
            }
            Some([low / value, high / value])
        };
        // Isaac Lab draws static, dynamic and viscous friction by one range of factors.
        let of_friction = [
            scaled("friction", &|joint| joint.static_friction.max(joint.coulomb)),
            scaled("dynamic_friction", &|joint| joint.coulomb),
            scaled("viscous_friction", &|joint| joint.viscous),
        ];
        let friction = of_friction.into_iter().flatten().reduce(|[a, b], [c, d]| [a.min(c), b.max(d)]);
        let armature = scaled("armature", &|joint| joint.armature);
        let ranges = [("friction_distribution_params", friction), ("armature_distribution_params", armature)];
        let (what, function) = ("friction and rotor", "randomize_joint_parameters");
        push(&mut self.text, &joint.name, what, function, ("joint_names", "scale"), &ranges);
    }
}

/// Whether a range is wide enough to be said.
fn varies([low, high]: [f64; 2], value: f64) -> bool {
    (high - low).is_finite() && high - low > VARIES * value.abs()
}

/// One term, unless it has no range.
fn push(
    text: &mut String,
    name: &str,
    what: &str,
    function: &str,
    (of, operation): (&str, &str),
    ranges: &[(&str, Option<[f64; 2]>)],
) {
    if ranges.iter().all(|(_, range)| range.is_none()) {
        return;
    }
    let key = serde_json::Value::from(format!("{name} {what}"));
    let expression = serde_json::Value::from(escaped(name));
    let _ = write!(
        text,
        "    {key}: EventTermCfg(\n        func=mdp.{function},\n        mode=\"reset\",\n        params={{\n            \
         \"asset_cfg\": SceneEntityCfg(\"robot\", {of}=[{expression}]),\n"
    );
    for (field, [low, high]) in ranges.iter().filter_map(|(field, range)| Some((field, (*range)?))) {
        let _ = writeln!(text, "            \"{field}\": ({}, {}),", number(low), number(high));
    }
    let _ = write!(
        text,
        "            \"operation\": \"{operation}\",\n            \"distribution\": \"uniform\",\n        }},\n    ),\n"
    );
}

/// A name as a regular expression that matches it alone.
pub(super) fn escaped(name: &str) -> String {
    name.chars().flat_map(|c| (!c.is_alphanumeric() && c != '_').then_some('\\').into_iter().chain([c])).collect()
}
