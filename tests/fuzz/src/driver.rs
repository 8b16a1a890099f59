//! Tries inputs and judges how they end.

use crate::{LONGEST_S, MOST_BYTES, Target, corpus, mutate};
use btr_core::random::stream;
use peak_alloc::PeakAlloc;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Seek, Write};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Counts what is allocated.
#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// The last panic, with its place.
static PANIC: Mutex<String> = Mutex::new(String::new());

/// Held while an input is tried.
static ALONE: Mutex<()> = Mutex::new(());

/// Has panics remembered instead of printed.
pub fn listen() {
    std::panic::set_hook(Box::new(|panic| {
        *PANIC.lock().unwrap_or_else(PoisonError::into_inner) = panic.to_string();
    }));
}

/// Reads an input, and says whether it could be read.
///
/// # Errors
/// A panic, or too much memory.
pub fn tried(target: &Target, data: &[u8]) -> Result<bool, String> {
    // Memory and panics are the process's.
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    MEMORY.reset_peak_usage();
    let before = MEMORY.current_usage();
    let ended = catch_unwind(AssertUnwindSafe(|| (target.run)(data)));
    let taken = MEMORY.peak_usage().saturating_sub(before);
    match ended {
        Err(_) => Err(PANIC.lock().unwrap_or_else(PoisonError::into_inner).clone()),
        Ok(_) if taken > MOST_BYTES => Err(format!("it took {} MB", taken >> 20)),
        Ok(read) => Ok(read),
    }
}

/// The mutated inputs of a target.
pub struct Inputs<'a> {
    target: &'a Target,
    seed: u64,
    corpus: Vec<Vec<u8>>,
}

impl<'a> Inputs<'a> {
    /// Those that belong to a seed.
    pub fn new(target: &'a Target, seed: u64) -> Self {
        Inputs { target, seed, corpus: corpus::seeds(target.name) }
    }

    /// One of them, always the same.
    pub fn at(&self, number: u64) -> Vec<u8> {
        let name = u64::from(crc32fast::hash(self.target.name.as_bytes()));
        mutate::mutated(&mut stream(self.seed, &[name, number]), &self.corpus)
    }
}

/// The folder of a target's findings.
pub fn findings(target: &Target) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/fuzz").join(target.name)
}

/// Saves an input that is a finding, and says so.
///
/// # Errors
/// A failed write.
pub fn save(target: &Target, data: &[u8], why: &str) -> std::io::Result<()> {
    let path = findings(target).join(format!("crash-{:08x}", crc32fast::hash(data)));
    std::fs::create_dir_all(findings(target))?;
    std::fs::write(&path, data)?;
    println!("{}: {why}\n    {}", target.name, path.display());
    Ok(())
}

/// Where the number of the input that is being read is kept, for who starts this process: an abort tells nothing.
pub fn running(target: &Target) -> PathBuf {
    findings(target).join("running")
}

/// What became of some inputs.
#[derive(Default)]
pub struct Tally {
    /// How many could be read; the others were refused.
    pub read: usize,
    /// Findings by their first line, and how often each came.
    pub findings: BTreeMap<String, usize>,
}

/// Tries the inputs of these numbers, and saves the first of each kind of finding. An input that takes too long ends
/// the process.
///
/// # Errors
/// A failed write.
pub fn run(inputs: &Inputs, numbers: Range<u64>) -> std::io::Result<Tally> {
    listen();
    std::fs::create_dir_all(findings(inputs.target))?;
    // In ms since the beginning.
    let (began, since) = (Instant::now(), AtomicU64::new(0));
    std::thread::scope(|scope| {
        scope.spawn(|| watch(&since, began));
        let tally = try_all(inputs, numbers, || since.store(began.elapsed().as_millis() as u64, Ordering::Relaxed));
        since.store(OVER, Ordering::Relaxed);
        tally
    })
}

/// Stands for the time at which the last input ended.
const OVER: u64 = u64::MAX;

/// Ends the process once an input, which began at `since` ms, takes too long.
fn watch(since: &AtomicU64, began: Instant) {
    while since.load(Ordering::Relaxed) != OVER {
        std::thread::sleep(Duration::from_millis(100));
        let latest = since.load(Ordering::Relaxed).saturating_add(1000 * LONGEST_S);
        if began.elapsed().as_millis() as u64 > latest {
            std::process::exit(TOO_LONG);
        }
    }
}

fn try_all(inputs: &Inputs, numbers: Range<u64>, begins: impl Fn()) -> std::io::Result<Tally> {
    let mut tally = Tally::default();
    let mut present = File::create(running(inputs.target))?;
    for number in numbers {
        begins();
        // In place: some file systems wait for the disk when a file is cut and written anew.
        present.rewind()?;
        write!(present, "{number:020}")?;
        let data = inputs.at(number);
        match tried(inputs.target, &data) {
            Ok(read) => tally.read += usize::from(read),
            Err(why) => {
                let kind = why.lines().next().unwrap_or_default().to_owned();
                let count = tally.findings.entry(kind).or_insert(0);
                *count += 1;
                if *count == 1 {
                    save(inputs.target, &data, &format!("input {number}: {why}"))?;
                }
            }
        }
    }
    Ok(tally)
}

/// Exit code of a process that an input kept for too long.
pub const TOO_LONG: i32 = 3;

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use std::hint::black_box;

    #[test]
    fn a_panic_and_too_much_memory_are_findings() {
        listen();
        let target = |run: fn(&[u8]) -> bool| Target { name: "none", run, few: 0 };
        assert_eq!(tried(&target(|data| data.is_empty()), b""), Ok(true));
        let why = tried(&target(|data| data[3] == 0), b"").unwrap_err();
        assert!(why.contains("driver.rs"), "{why}");
        // Twice as much: what the tests beside it give back meanwhile is taken off.
        let why = tried(&target(|_| black_box(Vec::<u8>::with_capacity(2 * MOST_BYTES)).is_empty()), b"").unwrap_err();
        assert!(why.starts_with("it took ") && why.ends_with(" MB"), "{why}");
    }
}
