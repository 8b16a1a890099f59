//! Folders of runs: checkpoints and real tests.

use super::{PENDULUM, names_a_file};
use crate::files;
use crate::folder::Folder;
use btr_core::space::Space;
use btr_core::world::Trial;
use btr_io::Mapping;
use btr_lab::experiment::{Experiment, Source};
use btr_lab::reality::Store;
use btr_lab::run::Run;
use btr_physics::model::task::Fitness;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

type Began = Result<(Folder, Vec<Vec<u8>>), Box<dyn Error + Send + Sync>>;

/// The first bytes of a checkpoint, with the version of its format; two checksums and the state follow.
const HEADER: &[u8; 8] = b"btr-cp\x00\x07";
const CHECKSUMS: usize = 8;

/// A run's folder, and the states of its checkpoints.
static BEGAN: LazyLock<Began> = LazyLock::new(|| {
    let folder = Folder::new();
    let path = folder.path().to_owned();
    let mut experiment = experiment(&path)?;
    let mut run = Run::begin(&experiment, experiment.plan.clone(), &path)?;
    let mut states = Vec::new();
    loop {
        let checkpoint = std::fs::read(path.join("checkpoint.bin"))?;
        states.push(checkpoint.get(HEADER.len() + CHECKSUMS..).unwrap_or_default().to_vec());
        if let btr_core::coevolve::StepOutcome::Stopped(_) = run.step(&mut experiment)? {
            drop(run);
            return Ok((folder, states));
        }
    }
});

fn experiment(folder: &Path) -> Result<Experiment, btr_lab::experiment::FileError> {
    Experiment::new(Source::new("pendulum.toml", PENDULUM), None, folder)
}

/// The state in a checkpoint whose checksums are right, or a whole checkpoint: the run is resumed, and makes a step.
pub fn checkpoint(data: &[u8]) -> bool {
    let Ok((began, _)) = BEGAN.as_ref() else { return false };
    let folder = Folder::new();
    for name in files_below(began.path()) {
        if let Ok(bytes) = std::fs::read(began.path().join(&name)) {
            folder.write(&name.to_string_lossy(), &bytes);
        }
    }
    let Ok(stamp) = std::fs::read(began.path().join("experiment.toml")) else { return false };
    let checksums = [&stamp[..], data].map(|part| crc32fast::hash(part).to_le_bytes());
    let repaired = [HEADER, checksums.as_flattened(), data].concat();
    folder.write("checkpoint.bin", if data.starts_with(&HEADER[..HEADER.len() - 1]) { data } else { &repaired });
    let Ok(mut experiment) = experiment(folder.path()) else { return false };
    let plan = experiment.plan.clone();
    match Run::resume(&mut experiment, plan, folder.path()) {
        Ok(mut run) => {
            drop(run.step(&mut experiment));
            true
        }
        Err(error) => {
            names_a_file(&error.to_string(), &folder);
            false
        }
    }
}

/// Names of all files below a folder.
fn files_below(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let below = |path: PathBuf| match path.is_dir() {
        true => files_below(&path)
            .into_iter()
            .map(|name| Path::new(path.file_name().unwrap_or_default()).join(name))
            .collect(),
        false => vec![PathBuf::from(path.file_name().unwrap_or_default())],
    };
    entries.flat_map(|entry| below(entry.path())).collect()
}

/// The states of a run's checkpoints.
pub(crate) fn checkpoint_seeds() -> Vec<Vec<u8>> {
    BEGAN.as_ref().map(|(_, states)| states.clone()).unwrap_or_default()
}

/// A real test's folder: `checksums.sfv`, the log as CSV or MCAP, `failed.txt` and `trial.toml`; empty ones are left
/// out.
pub fn real_test(data: &[u8]) -> bool {
    let [checksums, log, failed, trial] = files(data);
    let folder = Folder::new();
    let log_name = if log.starts_with(b"\x89MCAP") { "log.mcap" } else { "log.csv" };
    let named = [("checksums.sfv", checksums), (log_name, log), ("failed.txt", failed), ("trial.toml", trial)];
    for (name, bytes) in named.into_iter().filter(|(_, bytes)| !bytes.is_empty()) {
        folder.write(&format!("0000/{name}"), bytes);
    }
    let store = Store::new(folder.path().to_owned(), Space::default(), Fitness::default(), Mapping::default(), 1.0);
    let trial = Trial { number: 0, iteration: 1, controller: Vec::new(), scenario: 0 };
    store.recall(&trial).inspect_err(|error| names_a_file(&error.to_string(), &folder)).is_ok_and(|test| test.is_some())
}
