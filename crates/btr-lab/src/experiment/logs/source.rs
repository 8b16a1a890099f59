//! Sources of logs.

use crate::experiment::source::STDIN;
use btr_core::log::Log;
use btr_identify::quality::GlitchReport;
use indexmap::IndexMap;
use std::path::{Path, PathBuf};

/// A log to read, or a log in memory.
#[derive(Clone, Debug)]
pub enum LogSource {
    /// A file.
    File(PathBuf),
    /// The standard input.
    Stdin,
    /// A log in memory in btr's units, with a name for reports; the model's `[channels]` map its foreign names.
    InMemory {
        /// Its unique name.
        name: PathBuf,
        /// The log.
        log: Log,
    },
    /// A log that was read before.
    Read(ReadLog),
}

impl LogSource {
    /// The file's path, or the log's name.
    pub fn path(&self) -> &Path {
        match self {
            LogSource::Stdin => Path::new(STDIN),
            LogSource::File(path) | LogSource::InMemory { name: path, .. } | LogSource::Read(ReadLog { path, .. }) => {
                path
            }
        }
    }
}

impl From<ReadLog> for LogSource {
    fn from(log: ReadLog) -> Self {
        LogSource::Read(log)
    }
}

impl From<PathBuf> for LogSource {
    fn from(path: PathBuf) -> Self {
        LogSource::File(path)
    }
}

/// A log that was read and can be used: from time zero, under btr's names.
#[derive(Clone, Debug)]
pub struct ReadLog {
    /// The file's path, or the log's name.
    pub path: PathBuf,
    /// Its samples; those of glitches are missing, unless the model file keeps them.
    pub log: Log,
    /// Its glitches.
    pub glitches: Vec<GlitchReport>,
    /// Warnings of its reader.
    pub warnings: Vec<String>,
    /// Of how many recorded samples each sample is the mean.
    pub means_of: usize,
    /// Over how long each sample is a mean, in s; 0 where it is of one instant.
    pub mean_s: f64,
    /// For torques that a prescribed motion requires, the standard deviation of the sensor's noise in the samples.
    pub torque_noise: IndexMap<String, f64>,
}

/// The logs of a command. Each is read once and passed on.
#[derive(Clone, Debug, Default)]
pub struct Recordings {
    /// Training logs.
    pub learn: Vec<ReadLog>,
    /// Held-out logs.
    pub held_out: Vec<ReadLog>,
}
