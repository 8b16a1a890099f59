//! Models without an experiment: with the file's drive, with another file's drive, or replaying a log.

use super::build::Builder;
use super::file::{DriveSection, RealitySource};
use super::logs::index::IndexEntries;
use super::logs::pieces::LogPiece;
use super::logs::read::read;
use super::logs::scenarios::{ScenarioReader, ScenarioSet};
use super::logs::source::LogSource;
use super::source::{FileError, Source};
use btr_physics::model::{Model, Scenario};

/// The model of a file, with the file's drive.
///
/// # Errors
/// An invalid file, at its line.
pub fn model(source: &Source) -> Result<Model, FileError> {
    let file = source.parse()?;
    Builder::new(&file, source).model(ScenarioSet::single(file.simulation.duration_s))
}

/// What is not known of the meshes of a file's robot, in words.
///
/// # Errors
/// An invalid file, at its line.
pub fn mesh_warnings(source: &Source) -> Result<Vec<String>, FileError> {
    let file = source.parse()?;
    Builder::new(&file, source).robot_with_warnings().map(|(_, warnings)| warnings)
}

/// The model of a file with the `[drive]` of another file.
///
/// # Errors
/// An error in either file, at its line.
pub fn model_driven_by(source: &Source, drive: &Source) -> Result<Model, FileError> {
    #[derive(serde::Deserialize)]
    struct OnlyDrive {
        drive: DriveSection,
    }
    let mut file = source.parse()?;
    let OnlyDrive { drive: mut section } = toml::from_str(&drive.text).map_err(|e| drive.refused(&e))?;
    drive.check_finite()?;
    // The path of a log is relative to the file that names it.
    let folder = std::path::absolute(drive.folder()).unwrap_or_else(|_| drive.folder().to_owned());
    section.log = section.log.map(|log| folder.join(log));
    file.drive = Some(section);
    Builder::new(&file, source).model(ScenarioSet::single(file.simulation.duration_s))
}

/// The model of a file that replays the commands of a log from its initial state, with the settings that an index of
/// logs in the file has for it.
///
/// # Errors
/// An invalid file; a log that cannot be read or lacks the robot's joints.
pub fn model_replaying(source: &Source, log: impl Into<LogSource>) -> Result<Model, FileError> {
    let (file, log) = (source.parse()?, log.into());
    let builder = Builder::new(&file, source);
    let robot = builder.robot()?;
    let whole = LogPiece::whole(log.path(), read(&log, &file, &robot, &mut None)?.log);
    let settings = IndexEntries::of(&file, source)?.settings(log.path(), &robot, source)?;
    let reader = ScenarioReader { file: &file, source, robot: &robot };
    let scenario = Scenario { settings, ..reader.replaying(&whole)? };
    builder.model(ScenarioSet { scenarios: vec![scenario], learn: 1, logs: vec![whole.log], warnings: Vec::new() })
}

/// The simulations of an experiment, without its plan and reality. Its `[reality]` section only matters if it names
/// logs.
///
/// # Errors
/// An invalid file, at its line.
pub fn simulations(source: &Source, reality: RealitySource) -> Result<Model, FileError> {
    let file = source.parse()?;
    let builder = Builder::new(&file, source);
    let situations = match file.reality.as_ref().filter(|_| reality == RealitySource::File) {
        Some(section) => builder.situations(section)?,
        None => ScenarioSet::single(file.simulation.duration_s),
    };
    builder.model(situations)
}
