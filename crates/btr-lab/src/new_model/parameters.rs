//! `[parameters]` of a new model file: a first set of free ones.

use super::description::JointFacts;
use super::gains::rounded;
use super::text::{Writer, key, number};
use super::words::Kind;
use crate::experiment::ActuatorSection;
use crate::model_text::GAINS_GUESS;
use btr_physics::robot::{Base, Joint, JointKind};

/// Links lighter than this share of the robot have no free mass.
const LIGHT: f64 = 0.02;

impl Writer<'_> {
    pub(super) fn parameters(&mut self) {
        self.line("\n[parameters]  # what a fit may change, and a diagnosis refits: remove what you know for sure");
        self.line(
            "# relative = [0.85, 1.15] is ±15 % of the value that the model states; bounds = [LOW, HIGH] are values",
        );
        for mass in self.heavy_links().into_iter().map(|link| key(&format!("mass@{link}"))) {
            self.line(&format!("{mass} = {{ relative = [0.8, 1.25] }}"));
        }
        self.gains();
        self.losses();
    }

    /// The links that move and make up a share of the robot's mass.
    fn heavy_links(&self) -> Vec<String> {
        let (links, least_kg) = (&self.built.links, LIGHT * self.built.mass_kg());
        let moves = |mut link: usize| loop {
            match links[link].parent {
                None => break self.built.base == Base::Floating,
                Some(_) if links[link].joint.kind != JointKind::Fixed => break true,
                Some(parent) => link = parent,
            }
        };
        let heavy = (0..links.len()).filter(|&i| moves(i) && links[i].mass_kg > least_kg);
        heavy.map(|i| links[i].name.clone()).collect()
    }

    fn gains(&mut self) {
        let (torques, follows) = (self.columns.has(Kind::TorqueCommand), self.columns.lead_without_commands());
        let unknown = |facts: &JointFacts| facts.actuator.is_none() && !torques && !follows;
        if self.joints().iter().any(|(_, _, facts)| unknown(facts)) {
            self.line(GAINS_GUESS);
        }
        for (_, joint, facts) in self.joints() {
            match &facts.actuator {
                Some(ActuatorSection::Position { .. }) => {
                    self.line(&format!("{} = {{ relative = [0.8, 1.25] }}", key(&format!("kp@{}", joint.name))));
                }
                None if unknown(&facts) => {
                    for gain in ["kp", "kd"] {
                        let key = key(&format!("{gain}@{}", joint.name));
                        self.line(&format!("{key} = {{ relative = [0.05, 20.0], scale = \"log\" }}"));
                    }
                }
                _ => {}
            }
        }
    }

    /// Damping and friction that the robot's file states.
    fn losses(&mut self) {
        let joints: Vec<Joint> = self.built.movable().map(|(_, link)| link.joint.clone()).collect();
        for joint in joints {
            for (what, value) in [("damping", joint.damping), ("friction", joint.dry_friction)] {
                if value > 0.0 {
                    let (key, most) = (key(&format!("{what}@{}", joint.name)), number(rounded(3.0 * value)));
                    self.line(&format!(
                        "{key} = {{ bounds = [0.0, {most}], value = {} }}  # the robot's file states it",
                        number(value)
                    ));
                }
            }
        }
    }
}
