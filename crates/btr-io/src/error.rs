//! What can go wrong between a log and a file, with the place and a remedy.

use btr_core::log::LogError;
use std::path::PathBuf;

/// Why a log could not be read or written. `Display` says what and where, [`IoError::help`] what to do about it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IoError {
    /// The operating system refused.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// An extension that stands for no known format.
    #[error("{}: not a log btr knows", path.display())]
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
    /// A data set of which no episode, or none that is there, was named.
    #[error("{}: {} of this data set of {episodes}", path.display(), asked(wanted.as_deref()))]
    Episode {
        /// The data set's folder.
        path: PathBuf,
        /// The episode that was asked for.
        wanted: Option<String>,
        /// How many there are.
        episodes: usize,
    },
    /// A LeRobot data set that is not as the format says.
    #[error("{}: {what}", path.display())]
    DataSet {
        /// The file in it.
        path: PathBuf,
        /// What is wrong with that.
        what: String,
    },
    /// Nothing in the file at all.
    #[error("{}: the file is empty", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// A header and no rows.
    #[error("{}: a header and no samples", path.display())]
    NoSamples {
        /// The file.
        path: PathBuf,
    },
    /// No column for the time.
    #[error("{}:1: no time column `{wanted}` among {}", path.display(), list(columns))]
    NoTime {
        /// The file.
        path: PathBuf,
        /// The name that was looked for.
        wanted: String,
        /// The names that are there.
        columns: Vec<String>,
    },
    /// Cells that are separated by something else than commas.
    #[error("{}:1: {what} between the cells, not commas", path.display())]
    Separator {
        /// The file.
        path: PathBuf,
        /// What is there.
        what: &'static str,
    },
    /// Time that stands still or runs backwards.
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
    /// A cell that holds no number.
    #[error("{}:{line}: column `{column}`: `{text}` is not a number", path.display())]
    NotANumber {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// The column's name.
        column: String,
        /// What stands there.
        text: String,
    },
    /// A row with more or fewer cells than the header.
    #[error("{}:{line}: {got} cells where the header has {expected}", path.display())]
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
    /// Bytes that are no text, or broken quoting.
    #[error("{}: {what}", path.display())]
    Csv {
        /// The file.
        path: PathBuf,
        /// What the CSV reader said, with its line.
        what: String,
    },
    /// Two sources for one channel.
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
    /// A file that does not begin as an MCAP file does.
    #[error("{}: not an MCAP file", path.display())]
    NotMcap {
        /// The file.
        path: PathBuf,
    },
    /// No joint states to build a log on.
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
    /// Samples that make no log.
    #[error("{}: {source}", path.display())]
    Log {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: LogError,
    },
}

impl IoError {
    /// What the user can do about it.
    pub fn help(&self) -> String {
        match self {
            IoError::File { .. } => "check the path and the permissions".into(),
            IoError::Format { .. } => {
                "logs end in .csv, .csv.gz or .mcap; a folder is a LeRobot data set (with #3 behind it: episode 3) or a ROS 2 bag; \
                 a .toml is run by `btr coevolve` or `btr simulate`"
                    .into()
            }
            IoError::Disabled { feature, .. } => {
                format!("build btr-io with its feature `{feature}`, which is on by default")
            }
            IoError::Db3 { path } => {
                let bag = bag_of(path).display();
                format!("convert it: rosbags-convert --src {bag} --dst out --dst-storage mcap; or read it in Python: btr.load_log")
            }
            IoError::SplitBag { path, .. } => {
                let bag = path.display();
                format!("make it one: rosbags-convert --src {bag} --dst out --dst-storage mcap; or read it in Python: btr.load_log")
            }
            IoError::Episode { path, episodes, .. } => {
                let path = path.display();
                format!("name an episode behind the folder: `{path}#0` to `{path}#{}`", episodes.saturating_sub(1))
            }
            IoError::DataSet { .. } => {
                "LeRobot data sets are read in their formats v2.0, v2.1 and v3.0; check that this one was downloaded as a whole"
                    .into()
            }
            IoError::Empty { .. } | IoError::NoSamples { .. } => {
                "the recording never started; record again, or leave this file out".into()
            }
            IoError::NoTime { .. } => "name the time column in the model's [channels] table: time = \"...\"".into(),
            IoError::Separator { .. } => "save it with commas between the cells, and points in the numbers".into(),
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
            IoError::NoStates { .. } => {
                "name the topic in the model's [channels.topics] table: states = \"/...\" (sensor_msgs/msg/JointState)"
                    .into()
            }
            IoError::Unwritable { .. } => "write .mcap, which keeps every name as it is".into(),
            IoError::Log { .. } => "sort the samples by time and give every sensor one value per sample".into(),
        }
    }
}

/// The bag is the folder around the database; `rosbags-convert` wants that.
fn bag_of(path: &std::path::Path) -> &std::path::Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => path,
    }
}

fn asked(episode: Option<&str>) -> String {
    episode.map_or("which episode".into(), |episode| format!("no episode `{episode}`"))
}

/// `a`, `b` and so on, shortened where nobody would read on.
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
    /// Whether the end of the log is missing.
    pub fn is_half(&self) -> bool {
        matches!(self, Warning::LastLineCut { .. } | Warning::Truncated { .. })
    }
}

/// What a reader noticed and could live with.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Warning {
    /// A column that holds something else than numbers and that nobody asked for.
    #[error("column `{column}` is left out: line {line} holds `{text}`")]
    ColumnIgnored {
        /// The column.
        column: String,
        /// First line that is no number.
        line: u64,
        /// What stands there.
        text: String,
    },
    /// The mapping names something that the file does not have.
    #[error("the mapping names `{theirs}` for `{ours}`, which the log does not have")]
    MappingUnused {
        /// The name in btr.
        ours: String,
        /// The name looked for.
        theirs: String,
    },
    /// The last line was cut while it was written.
    #[error("line {line} is cut short and left out")]
    LastLineCut {
        /// The line.
        line: u64,
    },
    /// A file that breaks off.
    #[error("the file breaks off ({why}); {messages} messages before that are kept")]
    Truncated {
        /// Messages that could be read.
        messages: usize,
        /// What the reader said.
        why: String,
    },
    /// A topic nobody can read here.
    #[error("topic `{topic}` is left out: {why}")]
    TopicSkipped {
        /// The topic.
        topic: String,
        /// Why.
        why: String,
    },
    /// Messages that are not what their schema says.
    #[error("topic `{topic}`: {count} messages could not be decoded ({why})")]
    Undecodable {
        /// The topic.
        topic: String,
        /// How many.
        count: usize,
        /// What was wrong with the first.
        why: String,
    },
    /// Samples with a time that the same channel already has.
    #[error("`{channel}`: {count} samples with a time that was there already are left out")]
    Repeated {
        /// The channel.
        channel: String,
        /// How many.
        count: usize,
    },
    /// Times so large that seconds could not hold them to the nanosecond.
    #[error("the clock starts at {start_ns} ns after its epoch and was shifted to 0")]
    ClockShifted {
        /// The original time of t = 0.
        start_ns: u64,
    },
}
