//! Models on their own: with their own drive, with another file's, or replaying a log.

use super::pieces;
use super::pieces::LogPiece;
use super::replays::IndexEntries;
use super::scenarios::{ScenarioReader, ScenarioSet};
use super::source::LogSource;
use crate::experiment::build::Builder;
use crate::experiment::file::DriveSection;
use crate::experiment::parse::{FileError, Source};
use btr_core::log::Log;
use btr_physics::model::{Model, Scenario};

/// The model of a file, with its own drive.
///
/// # Errors
/// Whatever does not make sense, at its line.
pub fn model(source: &Source) -> Result<Model, FileError> {
    let file = source.parse()?;
    Builder { file: &file, source }.model(ScenarioSet::single(file.simulation.duration_s))
}

/// A log as it is compared with simulations of a model file: from time zero, under btr's names.
///
/// # Errors
/// A file that cannot be parsed, or a log that cannot be used.
pub fn recorded(source: &Source, log: &LogSource) -> Result<Log, FileError> {
    Ok(pieces::read(log, &source.parse()?)?.0)
}

/// The model of a file, driven as the `[drive]` of another one says.
///
/// # Errors
/// Whatever does not make sense in either file, at its line.
pub fn model_driven_by(source: &Source, drive: &Source) -> Result<Model, FileError> {
    #[derive(serde::Deserialize)]
    struct OnlyDrive {
        drive: DriveSection,
    }
    let mut file = source.parse()?;
    let OnlyDrive { drive: mut section } = toml::from_str(&drive.text).map_err(|e| drive.refused(&e))?;
    // A log is named from the file that names it.
    let folder = std::path::absolute(drive.folder()).unwrap_or_else(|_| drive.folder().to_owned());
    section.log = section.log.map(|log| folder.join(log));
    file.drive = Some(section);
    Builder { file: &file, source }.model(ScenarioSet::single(file.simulation.duration_s))
}

/// The model of a file, told what a log says the robot was told, from where the log starts, with what an index of logs in the
/// file knows of it.
///
/// # Errors
/// Whatever does not make sense; a log that cannot be read or lacks the robot's joints.
pub fn model_replaying(source: &Source, log: impl Into<LogSource>) -> Result<Model, FileError> {
    let (file, log) = (source.parse()?, log.into());
    let builder = Builder { file: &file, source };
    let whole = LogPiece::whole(log.path(), pieces::read(&log, &file)?.0);
    let robot = builder.robot()?;
    let settings = IndexEntries::of(&file, source)?.settings(log.path(), &robot, source)?;
    let reader = ScenarioReader { file: &file, source, robot: &robot };
    let scenario = Scenario { settings, ..reader.replaying(&whole)? };
    builder.model(ScenarioSet { scenarios: vec![scenario], learn: 1, logs: vec![whole.log], warnings: Vec::new() })
}
