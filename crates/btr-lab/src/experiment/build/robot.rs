//! The robot and its actuators.

use super::builder::Builder;
use crate::experiment::file::ActuatorSection;
use crate::experiment::source::FileError;
use crate::urdf_file::{RefusedUrdf, UrdfFile};
use btr_physics::model::parameter;
use btr_physics::presets::{ant, nao, pendulum};
use btr_physics::robot::site;
use btr_physics::robot::urdf;
use btr_physics::robot::urdf::UrdfError;
use btr_physics::robot::{Actuator, Base, DutyLoop, Joint, Robot, Sampling};
use std::path::Path;

impl Builder<'_> {
    pub(crate) fn robot(&self) -> Result<Robot, FileError> {
        self.robot_with_warnings().map(|(robot, _)| robot)
    }

    /// The robot, with what is not known of its meshes.
    pub(crate) fn robot_with_warnings(&self) -> Result<(Robot, Vec<String>), FileError> {
        let section = &self.file.robot;
        let base = section.base.unwrap_or(Base::Fixed);
        let mut warnings = Vec::new();
        let mut robot = match (&section.builtin, &section.urdf, &section.urdf_text) {
            (Some(name), None, None) => self.builtin(name)?,
            (None, Some(path), None) => self.urdf(&self.source.folder().join(path), base, &mut warnings)?,
            (None, None, Some(text)) => {
                let invalid = |e: UrdfError| self.error(&["robot", "urdf_text"], &e, e.help().map(Into::into));
                urdf::parse_urdf(text, base).map(|(robot, _)| robot).map_err(invalid)?
            }
            _ => {
                let help = "builtin = \"ant\", \"nao\" or \"pendulum\"; or urdf = \"robot.urdf\"";
                return Err(self.error(&["robot"], "give either builtin or urdf", Some(help.into())));
            }
        };
        if let Some(height) = section.height_m {
            robot.start.translation.z = height;
        }
        self.links(&mut robot)?;
        self.actuators(&mut robot)?;
        Ok((robot, warnings))
    }

    /// Sets the inertial parameters that the file states.
    fn links(&self, robot: &mut Robot) -> Result<(), FileError> {
        for (name, stated) in &self.file.links {
            let known = robot.links.iter().map(|link| link.name.as_str());
            let index = robot.link(name).ok_or_else(|| self.unknown(&["links", name], "link", name, known))?;
            let numbers = stated.com_m.iter().chain(&stated.inertia_kg_m2);
            if !(stated.mass_kg >= 0.0 && numbers.chain([&stated.mass_kg]).all(|x| x.is_finite())) {
                let message = format!("`{name}` needs finite numbers, and a mass that is not negative");
                return Err(self.error(&["links", name], message, None));
            }
            robot.links[index].set_stated(stated);
        }
        Ok(())
    }

    /// A missing URDF is an error of the model file; an invalid one is an error of the URDF.
    fn urdf(&self, path: &Path, base: Base, warnings: &mut Vec<String>) -> Result<Robot, FileError> {
        let missing = |e| self.error(&["robot", "urdf"], format!("{}: {e}", path.display()), None);
        let text = btr_io::read_text(path).map_err(missing)?;
        let file = UrdfFile { path, text: &text };
        let invalid = |RefusedUrdf { line, message, help }: RefusedUrdf| {
            let (path, help) = (path.to_owned(), help.map(Into::into));
            FileError { path, line, column: 0, message: message.into(), help }
        };
        let (mut robot, _) = file.robot(base).map_err(invalid)?;
        if let Some(packages) = &self.file.robot.package_paths {
            let packages: Vec<_> = packages.iter().map(|folder| self.source.folder().join(folder)).collect();
            warnings.extend(file.enclose(&mut robot, &packages).map_err(invalid)?);
        }
        Ok(robot)
    }

    fn builtin(&self, name: &str) -> Result<Robot, FileError> {
        let section = &self.file.robot;
        match name {
            "ant" => Ok(ant::ant()),
            "nao" => Ok(nao::nao()),
            "pendulum" => {
                let (mass_kg, length_m) = (section.mass_kg.unwrap_or(1.0), section.length_m.unwrap_or(1.0));
                Ok(pendulum::pendulum(mass_kg, length_m, Actuator::Passive))
            }
            _ => Err(self.unknown(&["robot", "builtin"], "built-in robot", name, ["ant", "nao", "pendulum"])),
        }
    }

    fn actuators(&self, robot: &mut Robot) -> Result<(), FileError> {
        let names: Vec<String> = robot.movable().map(|(_, link)| link.joint.name.clone()).collect();
        for (pattern, section) in &self.file.actuators {
            if !names.iter().any(|name| site::matches(pattern, name)) {
                return Err(self.unknown(&["actuators", pattern], "joint", pattern, names.iter().map(String::as_str)));
            }
            let actuator = actuator(section);
            if let Some((value, number)) = parameter::motor_values(&actuator).find(|(_, x)| *x < 0.0 || x.is_nan()) {
                let message = format!("{value} = {number} must be zero or more");
                return Err(self.error(&["actuators", pattern, value], message, None));
            }
            if let ActuatorSection::Voltage { resistance, .. } = section
                && *resistance <= 0.0
            {
                return Err(self.error(&["actuators", pattern, "resistance"], "resistance must be positive", None));
            }
            let sampling =
                sampling(section).map_err(|(key, message)| self.error(&["actuators", pattern, key], message, None))?;
            // A joint that follows another one is driven by it, unless it is given by its full name.
            let matches = |joint: &Joint| {
                site::matches(pattern, &joint.name) && (joint.mimic.is_none() || *pattern == joint.name)
            };
            if !robot.movable().any(|(_, link)| matches(&link.joint)) {
                let message = format!("all joints that match `{pattern}` mimic another joint, which drives them");
                let help = "use a joint's full name to give it its own actuator".into();
                return Err(self.error(&["actuators", pattern], message, Some(help)));
            }
            for link in robot.links.iter_mut().skip(1).filter(|link| matches(&link.joint)) {
                (link.joint.actuator, link.joint.sampling) = (actuator.clone(), sampling);
            }
        }
        Ok(())
    }
}

fn actuator(section: &ActuatorSection) -> Actuator {
    match *section {
        ActuatorSection::Passive => Actuator::Passive,
        ActuatorSection::Position { kp, ki, kd, max_torque, .. } => Actuator::Position { kp, ki, kd, max_torque },
        ActuatorSection::Torque { max_torque } => Actuator::Torque { max_torque },
        ActuatorSection::Voltage { kt, resistance, gain, max_duty, supply, .. } => {
            Actuator::Voltage { kt, resistance, servo: gain.map(|gain| DutyLoop { gain, max_duty, supply }) }
        }
        ActuatorSection::Prescribed { .. } => Actuator::Prescribed,
    }
}

/// The sampling of a servo; otherwise the invalid key and the reason.
fn sampling(section: &ActuatorSection) -> Result<Option<Sampling>, (&'static str, String)> {
    let (period_s, velocity_over) = match *section {
        ActuatorSection::Position { sample_s: Some(period_s), velocity_over, .. } => (period_s, velocity_over),
        ActuatorSection::Voltage { sample_s: Some(_), gain: None, .. } => {
            return Err(("sample_s", "sample_s needs a position loop; give gain".to_owned()));
        }
        ActuatorSection::Voltage { sample_s: Some(period_s), .. }
        | ActuatorSection::Prescribed { sample_s: Some(period_s) } => (period_s, 1),
        _ => return Ok(None),
    };
    if !(period_s > 0.0 && period_s.is_finite()) {
        return Err(("sample_s", format!("sample_s = {period_s} must be positive")));
    }
    if velocity_over == 0 {
        return Err(("velocity_over", "velocity_over must be at least 1".to_owned()));
    }
    Ok(Some(Sampling { period_s, velocity_over }))
}
