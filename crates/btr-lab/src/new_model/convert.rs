//! Robots' files: URDF is read here, xacro and MJCF by Python's own packages for them.

use super::description::{JointFacts, RobotDescription};
use crate::failure::Failure;
use crate::python::{Python, in_a_line, last_line};
use crate::robot_format::{ForeignFormat, RobotFormat};
use crate::urdf_file::{RefusedUrdf, UrdfFile};
use btr_core::text::Text;
use btr_physics::robot::Base;
use btr_physics::robot::urdf::efforts;
use serde::Deserialize;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A robot's file, read.
pub struct RobotFile {
    /// What it describes.
    pub robot: RobotDescription,
    /// Whether the file itself is a URDF that a model file can name.
    pub is_urdf: bool,
    /// Folders in which its meshes are looked for, if it names some.
    pub package_paths: Option<Vec<PathBuf>>,
}

impl RobotFile {
    /// Reads a robot's file. `root` is the first body of the robot in a MuJoCo scene, where it has several; `packages`
    /// are folders in which the meshes of a URDF are looked for.
    ///
    /// # Errors
    /// A file that is none of a robot or cannot be read; a missing Python package, with what to install.
    pub fn read(path: &Path, root: Option<&str>, packages: &[PathBuf]) -> Result<Self, Failure> {
        let refused = |what: String, help: &str| Err(refused(format!("{}: {what}", path.display()), help));
        if !path.exists() {
            return refused("there is no such file".to_owned(), "");
        }
        if let Some(foreign) = ForeignFormat::of(path) {
            return refused(format!("{}, from which btr reads no robot", foreign.words), foreign.help);
        }
        match RobotFormat::of(path) {
            Some(RobotFormat::Urdf) => match btr_io::read_text(path) {
                Ok(text) => of_urdf(path, text, packages, true),
                Err(error) if error.kind() == ErrorKind::InvalidData => {
                    refused("no text".to_owned(), "a URDF is a text file, in UTF-8")
                }
                Err(error) => refused(error.to_string(), ""),
            },
            Some(RobotFormat::Xacro) => {
                // The expanded file has another folder, and the lines are its own.
                let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
                let packages: Vec<PathBuf> = packages.iter().cloned().chain([folder.to_owned()]).collect();
                let name = format!("{} (expanded)", path.display());
                let file = of_urdf(Path::new(&name), expanded(path)?, &packages, false)?;
                Ok(RobotFile { robot: RobotDescription { made_from: file_name(path), ..file.robot }, ..file })
            }
            Some(RobotFormat::Mujoco) => {
                Ok(RobotFile { robot: of_mujoco(path, root)?, is_urdf: false, package_paths: None })
            }
            None => refused("no robot's file".to_owned(), "give a .urdf, .xacro, or .xml (URDF or MJCF)"),
        }
    }
}

fn refused(message: String, help: &str) -> Failure {
    Failure::new("robot", message, (!help.is_empty()).then(|| Text::from(help)))
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The robot of a URDF. Its damping and friction are the robot's; its efforts become limits of the actuators.
fn of_urdf(path: &Path, urdf: String, packages: &[PathBuf], is_urdf: bool) -> Result<RobotFile, Failure> {
    let invalid = |RefusedUrdf { line, message, help }: RefusedUrdf| {
        let line = if line == 0 { String::new() } else { format!(":{line}") };
        refused(format!("{}{line}: {message}", path.display()), help.unwrap_or_default())
    };
    let file = UrdfFile { path, text: &urdf };
    let (mut robot, lacking) = file.robot(Base::Fixed).map_err(invalid)?;
    let efforts = efforts(&urdf).map_err(|error| invalid(file.refused(&error)))?;
    let package_paths = (!file.meshes().map_err(invalid)?.is_empty()).then(|| packages.to_vec());
    let warnings = file.enclose(&mut robot, packages).map_err(invalid)?;
    let facts = |name: &str| JointFacts {
        torque_limit: efforts.iter().find(|(joint, _)| joint == name).map(|(_, effort)| *effort),
        ..JointFacts::default()
    };
    let joints = robot.movable().map(|(_, link)| (link.joint.name.clone(), facts(&link.joint.name))).collect();
    let made_from = file_name(path);
    let stem = made_from.split('.').next().unwrap_or("robot").to_owned();
    let name = if robot.name.is_empty() { stem } else { robot.name };
    let rooted = robot.links.first().is_some_and(|root| root.name == "world" || root.mass_kg <= 0.0);
    let not_represented = lacking.iter().map(ToString::to_string).collect();
    let robot = RobotDescription {
        name,
        made_from,
        urdf,
        base: rooted.then_some(Base::Fixed),
        height_m: None,
        gravity: None,
        step_s: None,
        ground_friction: None,
        joints,
        not_represented,
        warnings,
    };
    Ok(RobotFile { robot, is_urdf, package_paths })
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
    if said.contains("No module named 'xacro'") {
        return Err(refused(format!("{}: xacro files need the Python package xacro ({said})", path.display()), help));
    }
    let help = "expand it where its packages are known (source ROS's setup.bash), with its arguments, and give the result: \
                xacro robot.urdf.xacro NAME:=VALUE > robot.urdf";
    Err(refused(format!("{}: xacro cannot expand it: {said}", path.display()), help))
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
        // A compiled model of another version, or a damaged one, can crash MuJoCo.
        Err(_) if run.status.code().is_none() => {
            let help = "save it again with the MuJoCo that is installed here, or give the MJCF file";
            Err(refused(format!("{}: MuJoCo crashed while it read the model", path.display()), help))
        }
        Err(_) => Err(without(python.unusable(last_line(&run)))),
    }
}
