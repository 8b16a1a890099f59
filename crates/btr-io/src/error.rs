//! Errors and warnings of reading and writing logs, each with its place in the file and a remedy.

use btr_core::log::LogError;
use btr_core::text::{Mention, Text};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Why a log could not be read or written. `Display` gives the place and the cause, [`IoError::help`] the remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IoError {
    /// An error of the operating system.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// An unknown file extension.
    #[error("{}: not a log format that btr reads", path.display())]
    Format {
        /// The file.
        path: PathBuf,
    },
    /// A format that this build leaves out.
    #[error("{}: this build of btr-io does not include {format}", path.display())]
    Disabled {
        /// The file.
        path: PathBuf,
        /// The format.
        format: &'static str,
        /// The Cargo feature that includes it.
        feature: &'static str,
    },
    /// A rosbag2 in SQLite.
    #[error("{}: a SQLite bag; btr reads bags in MCAP", path.display())]
    Db3 {
        /// The file.
        path: PathBuf,
    },
    /// A rosbag2 in several files.
    #[error("{}: a bag of {files} MCAP files", path.display())]
    SplitBag {
        /// The bag's folder.
        path: PathBuf,
        /// How many there are.
        files: usize,
    },
    /// A data set without a named episode, or with one that does not exist.
    #[error("{}: {} of this data set of {episodes}", path.display(), episode_text(wanted.as_deref()))]
    Episode {
        /// The data set's folder.
        path: PathBuf,
        /// The requested episode.
        wanted: Option<String>,
        /// How many there are.
        episodes: usize,
    },
    /// A malformed LeRobot data set.
    #[error("{}: {what}", path.display())]
    DataSet {
        /// The file in it.
        path: PathBuf,
        /// The problem.
        what: String,
    },
    /// An empty file.
    #[error("{}: the file is empty", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// A header without rows.
    #[error("{}: a header without samples", path.display())]
    NoSamples {
        /// The file.
        path: PathBuf,
    },
    /// No time column.
    #[error("{}:1: no time column `{wanted}` among {}", path.display(), list(columns))]
    NoTime {
        /// The file.
        path: PathBuf,
        /// The expected name.
        wanted: String,
        /// The names in the file.
        columns: Vec<String>,
    },
    /// A clock that does not increase.
    #[error("{}:{line}: time does not increase: {before_s} s, then {after_s} s", path.display())]
    Clock {
        /// The file.
        path: PathBuf,
        /// Line of the later sample, from 1.
        line: u64,
        /// Time of the sample before it.
        before_s: f64,
        /// Its own time.
        after_s: f64,
    },
    /// A cell that is not a number.
    #[error("{}:{line}: column `{column}`: `{text}` is not a number", path.display())]
    NotANumber {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// The column's name.
        column: String,
        /// The text of the cell.
        text: String,
    },
    /// A row with more or fewer cells than the header.
    #[error("{}:{line}: {got} cells, but the header has {expected}", path.display())]
    Cells {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// Columns of the header.
        expected: usize,
        /// Cells of the row.
        got: usize,
    },
    /// Invalid UTF-8, or broken quoting.
    #[error("{}: {what}", path.display())]
    Csv {
        /// The file.
        path: PathBuf,
        /// The CSV reader's message, with the line.
        what: String,
    },
    /// Two sources of one channel.
    #[error("{}: `{first}` and `{second}` both mean the channel `{channel}`", path.display())]
    Twice {
        /// The file.
        path: PathBuf,
        /// The channel.
        channel: String,
        /// One source.
        first: String,
        /// The other.
        second: String,
    },
    /// A file without the magic bytes of MCAP.
    #[error("{}: not an MCAP file", path.display())]
    NotMcap {
        /// The file.
        path: PathBuf,
    },
    /// A file whose content does not match its checksums.
    #[error("{}: the file is damaged: {what}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The reader's message.
        what: String,
    },
    /// A recording without joint states.
    #[error("{}: no joint states on `{wanted}`; topics: {}", path.display(), list(topics))]
    NoStates {
        /// The file.
        path: PathBuf,
        /// The topic that was looked for.
        wanted: String,
        /// What is there, with the types.
        topics: Vec<String>,
    },
    /// A name that a CSV header cannot carry without being read back as another one.
    #[error("{}: the channel `{channel}` would be read back from CSV as something else", path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// The channel.
        channel: String,
    },
    /// More than a log may hold.
    #[error("{}: more than {most} {what}, the most that is read", path.display())]
    TooMany {
        /// The file.
        path: PathBuf,
        /// Of what.
        what: &'static str,
        /// The limit.
        most: usize,
    },
    /// Samples that do not form a log.
    #[error("{}: {source}", path.display())]
    Log {
        /// The file.
        path: PathBuf,
        /// The problem.
        source: LogError,
    },
}

impl IoError {
    /// Whether the content of the log is at fault, or the file is there and cannot be read; otherwise what was asked
    /// for: a path that does not exist, a kind of file that is no log.
    pub fn is_about_content(&self) -> bool {
        match self {
            IoError::File { source, .. } => source.kind() != std::io::ErrorKind::NotFound,
            IoError::Format { .. }
            | IoError::Disabled { .. }
            | IoError::Db3 { .. }
            | IoError::SplitBag { .. }
            | IoError::Episode { .. }
            | IoError::Unwritable { .. } => false,
            IoError::DataSet { .. }
            | IoError::Empty { .. }
            | IoError::NoSamples { .. }
            | IoError::NoTime { .. }
            | IoError::Clock { .. }
            | IoError::NotANumber { .. }
            | IoError::Cells { .. }
            | IoError::Csv { .. }
            | IoError::Twice { .. }
            | IoError::NotMcap { .. }
            | IoError::Damaged { .. }
            | IoError::NoStates { .. }
            | IoError::TooMany { .. }
            | IoError::Log { .. } => true,
        }
    }

    /// What the user can do about the error.
    pub fn help(&self) -> Text {
        match self {
            IoError::File { source, .. } => match source.kind() {
                ErrorKind::IsADirectory => "name a regular file".into(),
                ErrorKind::InvalidInput => Text::from("name a regular file, or ") + Mention::Pipe,
                ErrorKind::InvalidData | ErrorKind::FileTooLarge => "check that it is a log, and not damaged".into(),
                _ => "check the path and the permissions".into(),
            },
            IoError::Format { .. } => {
                let formats = "logs end in .csv, .csv.gz or .mcap; a folder is a LeRobot data set (with #3 behind it: episode 3) or a \
                               ROS 2 bag; a .toml is ";
                Text::from(formats) + Mention::ModelUse
            }
            IoError::Disabled { feature, .. } => {
                format!("build btr-io with its feature `{feature}`, which is on by default").into()
            }
            IoError::Db3 { path } => Text::from("convert it: ") + converted(bag_of(path)),
            IoError::SplitBag { path, .. } => Text::from("make it one: ") + converted(path),
            IoError::Episode { path, episodes, .. } => {
                let path = path.display();
                let last = episodes.saturating_sub(1);
                format!("name an episode behind the folder: `{path}#0` to `{path}#{last}`").into()
            }
            IoError::DataSet { .. } => {
                "LeRobot data sets are read in their formats v2.0, v2.1 and v3.0; check that this one was downloaded as a whole"
                    .into()
            }
            IoError::Empty { .. } | IoError::NoSamples { .. } => {
                "the file holds no samples; record again, or leave it out".into()
            }
            IoError::NoTime { .. } => "name the time column in the model's [channels] table: time = \"...\"".into(),
            IoError::Clock { .. } => "sort the file by time and remove repeated samples, then try again".into(),
            IoError::NotANumber { .. } => {
                "leave the cell empty (or write nan) where a sample is missing; a command that is missing for more than 50 ms \
                 is torque off"
                    .into()
            }
            IoError::Cells { .. } => "repair or remove that line; missing samples are empty cells".into(),
            IoError::Csv { .. } => "save it as UTF-8, with commas between the cells".into(),
            IoError::Twice { .. } => "drop one of the two, or map only one of them in the [channels] table".into(),
            IoError::NotMcap { .. } => "check that it is an MCAP recording: mcap doctor FILE".into(),
            IoError::Damaged { .. } => {
                "copy it again from where it was recorded; `mcap recover FILE -o OTHER` saves what is whole".into()
            }
            IoError::NoStates { .. } => {
                "name the topic in the model's [channels.topics] table: states = \"/...\" (sensor_msgs/msg/JointState)"
                    .into()
            }
            IoError::Unwritable { .. } => "write .mcap, which keeps every name as it is".into(),
            IoError::TooMany { .. } => "leave out columns that are not needed, or cut the log into shorter ones".into(),
            IoError::Log { .. } => "sort the samples by time and give every sensor one value per sample".into(),
        }
    }
}

/// How to read a bag that btr does not read itself.
fn converted(bag: &Path) -> Text {
    let convert = format!("rosbags-convert --src {} --dst out --dst-storage mcap; or ", bag.display());
    Text::from(convert) + Mention::LoadLog
}

/// The bag's folder, which `rosbags-convert` expects: the parent of the database file.
fn bag_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => path,
    }
}

fn episode_text(episode: Option<&str>) -> String {
    episode.map_or("which episode".into(), |episode| format!("no episode `{episode}`"))
}

/// Names in backticks, separated by commas, at most 12 of them.
fn list(names: &[String]) -> String {
    const SHOWN: usize = 12;
    if names.is_empty() {
        return "none".into();
    }
    let shown: Vec<String> = names.iter().take(SHOWN).map(|n| format!("`{n}`")).collect();
    let more = if names.len() > SHOWN { format!(" and {} more", names.len() - SHOWN) } else { String::new() };
    shown.join(", ") + &more
}

impl Warning {
    /// Whether the log is incomplete: its end is missing.
    pub fn is_half(&self) -> bool {
        matches!(self, Warning::LastLineCut { .. } | Warning::Truncated { .. })
    }
}

/// A problem that a reader could work around.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Warning {
    /// A column that is not numeric and not mapped.
    #[error("column `{column}` is left out: line {line} holds `{text}`")]
    ColumnIgnored {
        /// The column.
        column: String,
        /// First line whose cell is not a number.
        line: u64,
        /// The text of the cell.
        text: String,
    },
    /// A name in the mapping that is missing in the file.
    #[error("the mapping names `{theirs}` for `{ours}`, which the log does not have")]
    MappingUnused {
        /// The name in btr.
        ours: String,
        /// The expected foreign name.
        theirs: String,
    },
    /// An incomplete last line.
    #[error("line {line} is truncated and left out")]
    LastLineCut {
        /// The line.
        line: u64,
    },
    /// A truncated file.
    #[error("the file is truncated ({why}); the {messages} messages before that are kept")]
    Truncated {
        /// Messages that could be read.
        messages: usize,
        /// The reader's message.
        why: String,
    },
    /// A topic that cannot be read.
    #[error("topic `{topic}` is left out: {why}")]
    TopicSkipped {
        /// The topic.
        topic: String,
        /// Why.
        why: String,
    },
    /// Messages that do not match their schema.
    #[error("topic `{topic}`: {count} messages could not be decoded ({why})")]
    Undecodable {
        /// The topic.
        topic: String,
        /// How many.
        count: usize,
        /// The problem of the first one.
        why: String,
    },
    /// Samples with a duplicate time stamp in their channel.
    #[error("`{channel}`: {count} samples with a repeated time are left out")]
    Repeated {
        /// The channel.
        channel: String,
        /// How many.
        count: usize,
    },
    /// Times too large for nanosecond resolution in seconds (f64).
    #[error("the clock starts at {start_ns} ns after its epoch and was shifted to 0")]
    ClockShifted {
        /// The original time of t = 0.
        start_ns: u64,
    },
}
