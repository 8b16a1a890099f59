//! Robots' files: URDF is read here, xacro and MJCF by Python's own packages for them.

use super::description::{JointFacts, RobotDescription};
use crate::failure::Failure;
use crate::python::{Python, in_a_line, last_line};
use crate::robot_format::RobotFormat;
use btr_core::text::Text;
use btr_physics::robot::Base;
use btr_physics::robot::urdf::{efforts, parse_urdf};
use serde::Deserialize;
use std::io::ErrorKind;
use std::path::Path;
use std::process::Command;

/// A robot's file, read.
pub struct RobotFile {
    /// What it describes.
    pub robot: RobotDescription,
    /// Whether the file itself is a URDF that a model file can name.
    pub is_urdf: bool,
}

impl RobotFile {
    /// Reads a robot's file. `root` is the first body of the robot in a MuJoCo scene, where it has several.
    ///
    /// # Errors
    /// A file that is none of a robot or cannot be read; a missing Python package, with what to install.
    pub fn read(path: &Path, root: Option<&str>) -> Result<Self, Failure> {
        if !path.exists() {
            return Err(refused(format!("{}: there is no such file", path.display()), ""));
        }
        match RobotFormat::of(path) {
            Some(RobotFormat::Urdf) => {
                let text = btr_io::read_text(path).map_err(|e| refused(format!("{}: {e}", path.display()), ""))?;
                Ok(RobotFile { robot: of_urdf(path, text)?, is_urdf: true })
            }
            Some(RobotFormat::Xacro) => Ok(RobotFile { robot: of_urdf(path, expanded(path)?)?, is_urdf: false }),
            Some(RobotFormat::Mujoco) => Ok(RobotFile { robot: of_mujoco(path, root)?, is_urdf: false }),
            None => {
                let help = "give a .urdf, .xacro, or .xml (URDF or MJCF)";
                Err(refused(format!("{}: no robot's file", path.display()), help))
            }
        }
    }
}

fn refused(message: String, help: &str) -> Failure {
    Failure::new("robot", message, (!help.is_empty()).then(|| Text::from(help)))
}

/// The robot of a URDF. Its damping and friction are the robot's; its efforts become limits of the actuators.
fn of_urdf(path: &Path, urdf: String) -> Result<RobotDescription, Failure> {
    let invalid = |e| refused(format!("{}: {e}", path.display()), "");
    let (robot, warnings) = parse_urdf(&urdf, Base::Fixed).map_err(invalid)?;
    let efforts = efforts(&urdf).map_err(invalid)?;
    let facts = |name: &str| JointFacts {
        torque_limit: efforts.iter().find(|(joint, _)| joint == name).map(|(_, effort)| *effort),
        ..JointFacts::default()
    };
    let joints = robot.movable().map(|(_, link)| (link.joint.name.clone(), facts(&link.joint.name))).collect();
    let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let stem = path.file_name().unwrap_or_default().to_string_lossy();
    let name = if robot.name.is_empty() { stem.split('.').next().unwrap_or("robot").to_owned() } else { robot.name };
    let rooted = robot.links.first().is_some_and(|root| root.name == "world" || root.mass_kg <= 0.0);
    let not_represented = warnings.iter().map(ToString::to_string).collect();
    Ok(RobotDescription {
        name,
        made_from: file,
        urdf,
        base: rooted.then_some(Base::Fixed),
        height_m: None,
        gravity: None,
        step_s: None,
        ground_friction: None,
        joints,
        not_represented,
    })
}

/// The URDF of a xacro file, by the program `xacro` or the Python package.
fn expanded(path: &Path) -> Result<String, Failure> {
    let help = "pip install xacro, or expand it yourself: xacro robot.urdf.xacro > robot.urdf";
    const MAIN: &str = "import sys, xacro; sys.argv[0] = 'xacro'; sys.exit(xacro.main())";
    let run = match Command::new("xacro").arg(path).output() {
        Err(e) if e.kind() == ErrorKind::NotFound => Python::named().command().args(["-c", MAIN]).arg(path).output(),
        ran => ran,
    };
    let run = run.map_err(|e| refused(format!("{}: xacro files need the program xacro: {e}", path.display()), help))?;
    if run.status.success() {
        return Ok(String::from_utf8_lossy(&run.stdout).into_owned());
    }
    let said = in_a_line(&run);
    if said.contains("No module named") {
        return Err(refused(format!("{}: xacro files need the Python package xacro ({said})", path.display()), help));
    }
    Err(refused(format!("{}: xacro cannot expand it: {said}", path.display()), "it must expand by itself: xacro FILE"))
}

/// What the Python package says of a MuJoCo model.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Answer {
    Robot(Box<RobotDescription>),
    Error { message: String, help: Option<String> },
}

/// The robot of a MuJoCo model, as MuJoCo compiles it.
fn of_mujoco(path: &Path, root: Option<&str>) -> Result<RobotDescription, Failure> {
    let python = Python::named();
    let without = |why: String| {
        let message = format!("{}: a MuJoCo model is read by Python, with btr and mujoco in it: {why}", path.display());
        refused(message, &Python::remedy("mujoco"))
    };
    let run = python.command().args(["-m", "btr._mujoco"]).arg(path).args(root).output();
    let run = run.map_err(|e| without(python.unusable(e)))?;
    match serde_json::from_slice(&run.stdout) {
        Ok(Answer::Robot(robot)) => Ok(*robot),
        Ok(Answer::Error { message, help: stated }) => Err(refused(message, stated.as_deref().unwrap_or_default())),
        Err(_) => Err(without(python.unusable(last_line(&run)))),
    }
}
