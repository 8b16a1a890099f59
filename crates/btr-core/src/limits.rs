//! How large inputs may be. Files come from anywhere: a damaged or a hostile one must not take all memory, overflow the
//! stack or keep a computer busy for days. Each limit lies far above what robots need; what exceeds one is refused
//! before it is computed or kept.

/// Physics steps of one simulation, unless `[simulation] max_steps` states another number: 11 hours at 2 ms.
pub const MOST_STEPS: u64 = 20_000_000;

/// Simulated time of one run, in s: a day.
pub const LONGEST_S: f64 = 86_400.0;

/// Values of a log, recorded or simulated: samples times channels. They take 0.8 GB.
pub const MOST_VALUES: usize = 100_000_000;

/// Columns of a log.
pub const MOST_COLUMNS: usize = 10_000;

/// Bytes of a line of a CSV file.
pub const LONGEST_LINE: usize = 1 << 24;

/// Bytes of a file that is read as a whole: a model, a URDF, an index of logs.
pub const LONGEST_TEXT: u64 = 1 << 26;

/// Bytes that are read from the standard input, which may never end: a log of [`MOST_VALUES`] values has about 2 GB.
pub const MOST_STREAMED: u64 = 1 << 32;

/// Logs of one command.
pub const MOST_LOGS: usize = 10_000;

/// Links of a robot.
pub const MOST_LINKS: usize = 500;

/// Bytes of a mesh's file: two and a half million triangles.
pub const LARGEST_MESH: u64 = 1 << 27;

/// Meshes of a robot.
pub const MOST_MESHES: usize = 10_000;

/// Elements of an XML file inside each other.
pub const DEEPEST_XML: usize = 100;

/// Counts in an experiment file: iterations, a population, the generations of a search.
pub const MOST_COUNTED: usize = 1_000_000;

/// Hidden units of a policy.
pub const MOST_HIDDEN: usize = 1000;

/// Cells of an index of logs.
pub const MOST_CELLS: usize = 1_000_000;

/// Characters of an experiment's name, which is that of a folder.
pub const LONGEST_NAME: usize = 100;

/// Values that a servo or an effect remembers: the readings of a digital servo, the commands of a delay.
pub const MOST_REMEMBERED: usize = 1_000_000;
