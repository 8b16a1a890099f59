//! The text of a new model file.

use super::columns::LogColumns;
use super::description::{JointFacts, RobotDescription};
use super::gains::guessed;
use super::words::Kind;
use crate::experiment::ActuatorSection;
use crate::failure::Failure;
use crate::model_text::SERVO_GUESS;
use btr_core::text::{Text, Verb};
use btr_physics::robot::urdf::parse_urdf;
use btr_physics::robot::{Base, Joint, Robot};

/// Where a limit of torque is from.
const EFFORT: &str = "max_torque is the URDF's effort: the motor's limit, or a placeholder";

/// Where a model's URDF is.
pub enum UrdfPlace {
    /// In a file.
    File {
        /// Its path, relative to the model's folder.
        urdf: String,
        /// Folders with the packages of its meshes, if it names some.
        package_paths: Option<Vec<String>>,
    },
    /// In the model file itself.
    Inside,
}

/// A new model file.
pub struct Draft {
    /// Its text.
    pub text: String,
    /// What was guessed, in words.
    pub told: Vec<String>,
    /// What the robot's file or the logs lack, in words.
    pub warnings: Vec<String>,
}

/// Writes a model file. `base` is that of the user; without it the robot's own, or a guess.
///
/// # Errors
/// A description whose URDF is invalid, or of a robot that cannot move.
pub fn written(
    robot: &RobotDescription,
    columns: &LogColumns,
    base: Option<Base>,
    place: &UrdfPlace,
) -> Result<Draft, Failure> {
    let (built, _) = parse_urdf(&robot.urdf, Base::Fixed).map_err(|e| Failure::new("robot", e.to_string(), None))?;
    let held = base.or(robot.base).unwrap_or_else(|| guessed_base(&built));
    let built = Robot { base: held, ..built };
    if held == Base::Fixed && built.movable().count() == 0 {
        let help =
            "give a robot with a revolute, continuous or prismatic joint; what moves as a whole has a floating base";
        return Err(Failure::new("robot", format!("{}: no joint of it moves", robot.made_from), Some(help.into())));
    }
    let mut writer = Writer { robot, columns, built, text: String::new(), told: columns.told.clone() };
    writer.head();
    writer.robot_section(held, base.is_some(), place);
    writer.simulation();
    writer.actuators();
    writer.effects();
    writer.channels();
    writer.noise();
    writer.parameters();
    let warnings = robot.warnings.iter().chain(&columns.lacking).cloned().collect();
    Ok(Draft { text: writer.text, told: writer.told, warnings })
}

pub(super) struct Writer<'a> {
    pub(super) robot: &'a RobotDescription,
    pub(super) columns: &'a LogColumns,
    pub(super) built: Robot,
    text: String,
    pub(super) told: Vec<String>,
}

impl Writer<'_> {
    pub(super) fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    fn head(&mut self) {
        self.line(&format!(
            "# A model to start from, made from {}. What says GUESS or FILL IN is for you.",
            self.robot.made_from
        ));
        self.line(&format!("name = {}", quoted(&self.robot.name.replace(['/', '\\'], "_"))));
        for what in &self.robot.not_represented {
            self.line(&format!("# not represented: {}", what.replace('\n', " ")));
        }
        for what in &self.robot.warnings {
            self.line(&format!("# warning: {}", what.replace('\n', " ")));
        }
    }

    fn robot_section(&mut self, held: Base, stated: bool, place: &UrdfPlace) {
        self.line("\n[robot]");
        if let UrdfPlace::File { urdf, package_paths } = place {
            self.line(&format!("urdf = {}", quoted(urdf)));
            if let Some(folders) = package_paths {
                let folders: Vec<String> = folders.iter().map(|folder| quoted(folder)).collect();
                self.line(&format!(
                    "package_paths = [{}]  # folders with the packages of its meshes",
                    folders.join(", ")
                ));
            }
        }
        let word = if held == Base::Fixed { "fixed" } else { "floating" };
        if stated || self.robot.base.is_some() {
            self.line(&format!("base = \"{word}\""));
        } else {
            let other = if held == Base::Fixed { "floating" } else { "fixed" };
            self.line(&format!("base = \"{word}\"  # GUESS: or \"{other}\""));
            self.told.push(format!("the base is {word}; --base {other} says otherwise"));
        }
        if let Some(height) = self.robot.height_m.filter(|_| held == Base::Floating) {
            self.line(&format!("height_m = {}", number(height)));
        }
        if matches!(place, UrdfPlace::Inside) {
            self.line(&format!("urdf_text = '''\n{}'''", self.robot.urdf.replace("'''", "")));
        }
    }

    fn simulation(&mut self) {
        let mut lines = Vec::new();
        if let Some(step) = self.robot.step_s {
            lines.push(format!("control_s = {}", number(step)));
            lines.push("steps_per_control = 1".to_owned());
        }
        let gravity = self.robot.gravity.filter(|g| (g + 9.81).abs() > 0.0);
        lines.extend(gravity.map(|g| format!("gravity = {}", number(g))));
        lines.extend(self.robot.ground_friction.map(|mu| format!("ground_friction = {}", number(mu))));
        if !lines.is_empty() {
            self.line("\n[simulation]");
            lines.iter().for_each(|line| self.line(line));
        }
    }

    /// The joints that an actuator can have, with what is known of them.
    pub(super) fn joints(&self) -> Vec<(usize, Joint, JointFacts)> {
        let driven = self.built.movable().filter(|(_, link)| link.joint.mimic.is_none());
        let facts = |joint: &Joint| self.robot.joints.get(&joint.name).cloned().unwrap_or_default();
        driven.map(|(i, link)| (i, link.joint.clone(), facts(&link.joint))).collect()
    }

    fn actuators(&mut self) {
        self.line("\n[actuators]  # position: tau = kp·(cmd - q) - kd·dq; or torque, voltage, prescribed, passive");
        let (follows, torques, joints) =
            (self.columns.lead_without_commands(), self.columns.has(Kind::TorqueCommand), self.joints());
        let unknown = joints.iter().any(|(_, _, facts)| facts.actuator.is_none());
        for (link, joint, facts) in &joints {
            let (table, remark) = match &facts.actuator {
                Some(known) => (table(known), command_remark(facts)),
                None if torques => (bounded("kind = \"torque\"", facts), effort_remark(facts)),
                None if follows => ("{ kind = \"prescribed\" }".to_owned(), String::new()),
                None => self.servo(*link, facts),
            };
            self.line(&format!("{} = {table}{remark}", key(&joint.name)));
        }
        if !follows || torques {
            self.tell_efforts(&joints);
        }
        if unknown {
            self.told.push(match (torques, follows) {
                (true, _) => "commands are torques, by their names".to_owned(),
                (_, true) => "the log has torques and no commands: joints follow their measured motion".to_owned(),
                _ => "the gains of the servos (kp, kd) are guesses: fill them in, or let a fit find them".to_owned(),
            });
        }
    }

    /// Tells the limits of torque that are only those of the URDF: they are often placeholders.
    fn tell_efforts(&mut self, joints: &[(usize, Joint, JointFacts)]) {
        let limited = joints.iter().filter(|(_, _, facts)| facts.actuator.is_none());
        let of_joint = |(_, joint, facts): &(usize, Joint, JointFacts)| Some((joint.name.clone(), facts.torque_limit?));
        let mut by_limit: Vec<(f64, Vec<String>)> = Vec::new();
        for (joint, limit) in limited.filter_map(of_joint) {
            match by_limit.iter_mut().find(|(known, _)| known.to_bits() == limit.to_bits()) {
                Some((_, joints)) => joints.push(joint),
                None => by_limit.push((limit, vec![joint])),
            }
        }
        for (limit, joints) in by_limit {
            let (limit, joints) = (number(limit), joints.join(", "));
            self.told.push(format!(
                "max_torque = {limit} of {joints} is the URDF's effort, the motor's limit or a placeholder: if it is one, \
                 remove it; btr check tells where the model stands at it"
            ));
        }
    }

    fn servo(&self, link: usize, facts: &JointFacts) -> (String, String) {
        let (kp, kd) = guessed(&self.built, link, facts.torque_limit);
        let gains = format!("kind = \"position\", kp = {}, kd = {}", number(kp), number(kd));
        let effort = facts.torque_limit.map_or_else(String::new, |_| format!("; {EFFORT}"));
        (bounded(&gains, facts), format!("  # {SERVO_GUESS}{effort}"))
    }

    fn effects(&mut self) {
        self.line("\n# Known facts belong here, as effects that are not fitted: a rotor's inertia times its gear ratio squared,");
        self.line("# from the motor's data sheet; a payload; a delay of the bus.");
        self.line(&(Text::from("# ") + Verb::Effects + " lists them all.").to_string());
        let joints = self.joints();
        if let Some((_, joint, _)) = joints.iter().find(|(_, _, facts)| facts.armature <= 0.0) {
            let site = quoted(&joint.name);
            self.line(&format!("# [[effects]]\n# effect = \"armature\"\n# site = {site}\n# inertia = 0.01  # kg·m²"));
        }
        let all: Vec<(String, JointFacts)> = self.robot.joints.iter().map(|(n, f)| (n.clone(), f.clone())).collect();
        for (name, facts) in all {
            let limit = facts.torque_limit.filter(|_| matches!(facts.actuator, Some(ActuatorSection::Voltage { .. })));
            self.effect(&name, "armature", &[("inertia", facts.armature)]);
            self.effect(&name, "parallel_spring", &[("stiffness", facts.stiffness), ("rest", facts.rest)]);
            self.effect(&name, "motor_lag", &[("time_constant", facts.lag_s)]);
            self.effect(&name, "command_delay", &[("delay", facts.delay_s)]);
            self.effect(&name, "torque_limit", &[("torque", limit.unwrap_or(0.0))]);
        }
    }

    /// An effect, unless its first value is its off value.
    fn effect(&mut self, site: &str, effect: &str, values: &[(&str, f64)]) {
        if values.first().is_none_or(|(_, value)| *value == 0.0) {
            return;
        }
        self.line(&format!("\n[[effects]]\neffect = \"{effect}\"\nsite = {}", quoted(site)));
        values.iter().for_each(|(name, value)| self.line(&format!("{name} = {}", number(*value))));
    }
}

/// A trunk with four limbs stands on them; an arm is bolted down.
fn guessed_base(robot: &Robot) -> Base {
    let limbs = robot.movable().filter(|(_, link)| link.parent == Some(0)).count();
    if limbs >= 4 { Base::Floating } else { Base::Fixed }
}

/// A known actuator as an inline table.
fn table(actuator: &ActuatorSection) -> String {
    let text = toml::Value::try_from(actuator).map(|value| value.to_string()).unwrap_or_default();
    // What is unlimited or at its default is left out.
    let fields = text.trim_matches(|c| "{} ".contains(c)).split(", ").filter(|field| {
        !["max_torque = inf", "ki = 0.0", "velocity_over = 1", "max_duty = 1.0", "supply = 0.0"].contains(field)
    });
    format!("{{ {} }}", fields.collect::<Vec<_>>().join(", "))
}

/// A table with the limit of torque, if there is one.
fn bounded(fields: &str, facts: &JointFacts) -> String {
    match facts.torque_limit {
        Some(limit) => format!("{{ {fields}, max_torque = {} }}", number(limit)),
        None => format!("{{ {fields} }}"),
    }
}

fn effort_remark(facts: &JointFacts) -> String {
    facts.torque_limit.map_or_else(String::new, |_| format!("  # {EFFORT}"))
}

fn command_remark(facts: &JointFacts) -> String {
    let Some(command) = &facts.command else { return String::new() };
    let offset = if command.offset == 0.0 { String::new() } else { format!(" + {}", number(command.offset)) };
    format!("  # its command is {} x MuJoCo's control `{}`{offset}", number(command.factor), command.control)
}

pub(super) fn number(x: f64) -> String {
    let text = format!("{x:?}");
    if text.contains(['.', 'e', 'n']) { text } else { format!("{text}.0") }
}

pub(super) fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// A key, quoted where TOML requires it.
pub(super) fn key(name: &str) -> String {
    toml_edit::Key::new(name).to_string()
}
