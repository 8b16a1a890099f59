//! Fuzz targets of everything that btr reads, in one registry. Two drivers call them: the mutations of a corpus here,
//! on stable Rust (`main.rs`, and a short budget in `tests/`), and libFuzzer (`fuzz/`, with `cargo fuzz` on nightly).
//!
//! A target takes bytes and must return: they are read and used, or refused with an error that names the file. A panic
//! is a finding; so are an abort, more memory than [`MOST_BYTES`], and more time than [`LONGEST_S`].

pub mod corpus;
pub mod driver;
mod folder;
pub mod mutate;
pub mod targets;

/// Memory that one input may take: a log at its limit of 100 million values takes 0.8 GB.
pub const MOST_BYTES: usize = 1 << 30;

/// Time that one input may take, in s.
pub const LONGEST_S: u64 = 10;

/// What lies between the files of an input that stands for several.
pub const SEPARATOR: &[u8] = b"\n===\n";

/// The files of an input; empty where there are fewer.
pub fn files<const N: usize>(data: &[u8]) -> [&[u8]; N] {
    let mut rest = data;
    std::array::from_fn(|k| {
        let end = rest.windows(SEPARATOR.len()).position(|window| window == SEPARATOR).filter(|_| k + 1 < N);
        let file = &rest[..end.unwrap_or(rest.len())];
        rest = end.map_or(&[], |end| &rest[end + SEPARATOR.len()..]);
        file
    })
}

/// Something that is read.
pub struct Target {
    /// Its name: that of its folder in the corpus, and of its file in `fuzz/fuzz_targets`.
    pub name: &'static str,
    /// Reads an input, and uses what it says; whether it could be read.
    pub run: fn(&[u8]) -> bool,
    /// How many mutated inputs `cargo test` tries: less than a second of them.
    pub few: u64,
}

/// All targets.
pub const TARGETS: &[Target] = &[
    Target { name: "csv", run: targets::logs::csv, few: 1000 },
    Target { name: "mcap", run: targets::logs::mcap, few: 1000 },
    Target { name: "cdr", run: targets::logs::cdr, few: 3000 },
    Target { name: "lerobot", run: targets::logs::lerobot, few: 1000 },
    Target { name: "model", run: targets::models::model, few: 1000 },
    Target { name: "urdf", run: targets::models::urdf, few: 1000 },
    Target { name: "mesh", run: targets::models::mesh, few: 1000 },
    Target { name: "formula", run: targets::models::formula, few: 3000 },
    Target { name: "checkpoint", run: targets::runs::checkpoint, few: 1000 },
    Target { name: "real_test", run: targets::runs::real_test, few: 1000 },
    Target { name: "worker", run: targets::workers::worker, few: 1000 },
    Target { name: "answer", run: targets::workers::answer, few: 1000 },
];

/// The target of this name.
pub fn find(name: &str) -> Option<&'static Target> {
    TARGETS.iter().find(|target| target.name == name)
}
