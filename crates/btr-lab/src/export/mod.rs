//! Models for other simulators: what was learnt, in their own files.

mod facts;
mod isaac_lab;
mod mujoco;
mod randomize;
mod request;
mod rest;
mod ros2;
mod urdf;
mod xml;

use crate::experiment::{FileError, Source, model};
use crate::failure::Failure;
use btr_identify::fit::Posterior;
use btr_physics::model::Outline;
use request::Request;
use std::path::PathBuf;

pub use randomize::{drawn_values, draws, posterior_of};
pub use request::Exported;

/// Draws from which ranges are taken, and their seed.
const DRAWS: usize = 400;
const SEED: u64 = 0;

/// How a format expresses what is uncertain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Randomised {
    /// By a file for each draw.
    InFiles,
    /// By ranges in the file.
    InRanges,
    /// Not at all.
    Never,
}

/// A format that models can be exported to.
pub struct Format {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is, in one line.
    pub what: &'static str,
    /// Whether a file of the user's is changed, which must be given unless it is the model's own URDF.
    pub changes_a_file: bool,
    /// Endings of its files.
    pub endings: &'static [&'static str],
    /// How it expresses what is uncertain.
    pub randomised: Randomised,
    write: fn(&Request) -> Result<Exported, String>,
}

/// All formats.
pub const FORMATS: &[Format] = &[
    Format {
        name: "mujoco",
        what: "the user's MJCF file with the changed numbers in it",
        changes_a_file: true,
        endings: &["xml", "mjcf"],
        randomised: Randomised::InFiles,
        write: mujoco::write,
    },
    Format {
        name: "urdf",
        what: "the model's URDF, or another one, with the changed numbers in it",
        changes_a_file: true,
        endings: &["urdf", "xml"],
        randomised: Randomised::InFiles,
        write: urdf::write,
    },
    Format {
        name: "isaac-lab",
        what: "actuator configurations of Isaac Lab, as Python",
        changes_a_file: false,
        endings: &["py"],
        randomised: Randomised::InRanges,
        write: isaac_lab::write,
    },
    Format {
        name: "ros2",
        what: "joint limits of ROS 2 (joint_limits.yaml)",
        changes_a_file: false,
        endings: &["yaml", "yml"],
        randomised: Randomised::Never,
        write: ros2::write,
    },
];

/// Exports a model. `file` is the user's file that is changed, by default the model's URDF; `step_s` the physics step
/// of the other simulator; with a posterior, a format with ranges says what it leaves.
///
/// # Errors
/// An invalid model; a file that is missing, cannot be read or is of another kind; a robot that is in no file; a
/// posterior of another model, or in a format that says it by files (see [`draws`]) or not at all.
pub fn export(
    source: &Source,
    format: &Format,
    file: Option<PathBuf>,
    step_s: f64,
    posterior: Option<&Posterior>,
) -> Result<Exported, Failure> {
    let drawn = posterior.map(|posterior| drawn(source, format, posterior)).transpose()?.unwrap_or_default();
    let parsed = source.parse()?;
    let model = model(source)?;
    let outline = model.outline().map_err(|error| Failure::simulation(&error, &[]))?;
    if let Some(joint) = facts::reversed_joint(&outline, &model.robot) {
        return Err(reversed(source, joint));
    }
    let is_urdf = format.name == "urdf";
    let own = || parsed.robot.urdf.as_ref().filter(|_| is_urdf).map(|urdf| source.folder().join(urdf));
    let path = if format.changes_a_file { file.or_else(own) } else { None };
    let inside = parsed.robot.urdf_text.clone().filter(|_| is_urdf);
    let text = match &path {
        Some(path) => read(path)?,
        None if !format.changes_a_file => String::new(),
        None => inside.ok_or_else(|| without_file(source, format))?,
    };
    let name = source.path.display().to_string();
    let stated_links: Vec<String> = parsed.links.keys().cloned().collect();
    let (stated_links, text) = (stated_links.as_slice(), text.as_str());
    let request = Request { name, model: &model, outline: &outline, stated_links, drawn: &drawn, text, step_s };
    let mut exported = (format.write)(&request).map_err(|message| {
        let path = path.unwrap_or_else(|| source.path.clone());
        Failure::from(FileError { path, line: 0, column: 0, message: message.into(), help: None })
    })?;
    // Where no file of a robot is changed, there is no place for what its links weigh.
    let links = facts::changed_links(&request).filter(|_| !format.changes_a_file);
    exported
        .left
        .extend(links.map(|link| format!("{}: mass {:.4} kg, with its centre and inertia", link.name, link.mass_kg)));
    exported.left.extend(facts::moved_joints(&outline, &model.robot));
    exported.left.extend(facts::motors(&outline));
    Ok(exported)
}

/// No file can say that one of its joints counts the other way round.
fn reversed(source: &Source, joint: &str) -> Failure {
    let help =
        format!("turn the axis of {joint} round in the robot's file and remove `direction@{joint}` from the model");
    Failure::from(FileError {
        path: source.path.clone(),
        line: 0,
        column: 0,
        message: format!("in the model, {joint} counts the other way round than in the robot's file").into(),
        help: Some(help.into()),
    })
}

/// The robot at draws from a posterior, for a format with ranges.
fn drawn(source: &Source, format: &Format, posterior: &Posterior) -> Result<Vec<Outline>, Failure> {
    let refused = |message: String| Err(Failure::new("usage", message, None));
    match format.randomised {
        Randomised::InRanges => {}
        Randomised::InFiles => return refused(format!("{} has no ranges: export draws of the model", format.name)),
        Randomised::Never => return refused(format!("{} has one value for each limit, and no ranges", format.name)),
    }
    let outline = |source: &Source| model(source)?.outline().map_err(|error| Failure::simulation(&error, &[]));
    draws(source, posterior, DRAWS, SEED)?.iter().map(outline).collect()
}

fn without_file(source: &Source, format: &Format) -> Failure {
    let message = format!("{} changes a file of yours, and none is given", format.name);
    let made = if format.name == "mujoco" { "; docs/howto/export.md makes an MJCF file of a URDF" } else { "" };
    let help = format!("name it: btr export {} ROBOT --to {} -o OUT{made}", source.path.display(), format.name);
    Failure::new("usage", message, Some(help.into()))
}

fn read(path: &std::path::Path) -> Result<String, Failure> {
    let failed = |error| Failure::new("robot", format!("{}: {error}", path.display()), None);
    btr_io::read_text(path).map_err(failed)
}
