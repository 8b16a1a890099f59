//! Fuzzes on stable Rust: each target in a process of its own, as many at once as there are cores.
//!
//!     cargo run --release -p btr-fuzz -- [--inputs N] [--seed N] [TARGET ...]
//!     cargo run --release -p btr-fuzz -- --file target/fuzz/TARGET/crash-01234567 TARGET

use btr_fuzz::driver::{Inputs, TOO_LONG, listen, run, running, save, tried};
use btr_fuzz::{LONGEST_S, TARGETS, Target, find};
use std::error::Error;
use std::process::{Command, ExitCode};
use std::sync::atomic::{AtomicUsize, Ordering};

type Told<T> = Result<T, Box<dyn Error + Send + Sync>>;

/// What is asked for.
struct Options {
    inputs: u64,
    seed: u64,
    /// The first input.
    from: u64,
    file: Option<String>,
    /// Whether this process tries the inputs itself.
    alone: bool,
    targets: Vec<&'static Target>,
}

impl Options {
    fn read() -> Told<Self> {
        let mut options = Options { inputs: 10_000, seed: 1, from: 0, file: None, alone: false, targets: Vec::new() };
        let mut arguments = std::env::args().skip(1);
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value"));
            match argument.as_str() {
                "--inputs" => options.inputs = value()?.parse()?,
                "--seed" => options.seed = value()?.parse()?,
                "--from" => options.from = value()?.parse()?,
                "--file" => options.file = Some(value()?),
                "--alone" => options.alone = true,
                name => options.targets.push(find(name).ok_or_else(|| format!("there is no target {name}"))?),
            }
        }
        if options.targets.is_empty() {
            options.targets = TARGETS.iter().collect();
        }
        Ok(options)
    }
}

fn main() -> Told<ExitCode> {
    let options = Options::read()?;
    let findings = match (&options.file, options.targets.as_slice()) {
        (Some(file), [target]) => {
            listen();
            tried(target, &std::fs::read(file)?).inspect_err(|why| println!("{why}")).is_err().into()
        }
        (Some(_), _) => return Err("name the target that reads the file".into()),
        (None, [target]) if options.alone => {
            let tally = run(&Inputs::new(target, options.seed), options.from..options.inputs)?;
            let count: usize = tally.findings.values().sum();
            println!("{}: {} read, {count} findings of {} kinds", target.name, tally.read, tally.findings.len());
            count
        }
        (None, targets) => all(targets, &options)?,
    };
    Ok(if findings == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Every target in a process; returns the number of targets with findings.
fn all(targets: &[&'static Target], options: &Options) -> Told<usize> {
    let (next, bad) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let work = || -> Told<()> {
        while let Some(target) = targets.get(next.fetch_add(1, Ordering::Relaxed)) {
            bad.fetch_add(usize::from(!is_clean(target, options)?), Ordering::Relaxed);
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let workers: Vec<_> = (0..cores).map(|_| scope.spawn(work)).collect();
        workers.into_iter().try_for_each(|worker| worker.join().map_err(|_| "a thread has failed")?)
    })?;
    println!("targets with findings: {} of {}", bad.load(Ordering::Relaxed), targets.len());
    Ok(bad.load(Ordering::Relaxed))
}

/// Whether all inputs of a target are read. One that ends its process is saved, and another process goes on behind it.
fn is_clean(target: &Target, options: &Options) -> Told<bool> {
    let (mut from, mut clean) = (options.from, true);
    while from < options.inputs {
        let numbers = [("--inputs", options.inputs), ("--seed", options.seed), ("--from", from)];
        let numbers = numbers.iter().flat_map(|(name, number)| [(*name).to_owned(), number.to_string()]);
        let status = Command::new(std::env::current_exe()?).args(["--alone", target.name]).args(numbers).status()?;
        if matches!(status.code(), Some(0 | 1)) {
            clean &= status.success();
            break;
        }
        clean = false;
        let number = std::fs::read_to_string(running(target))?.parse()?;
        let why =
            if status.code() == Some(TOO_LONG) { format!("longer than {LONGEST_S} s") } else { status.to_string() };
        save(target, &Inputs::new(target, options.seed).at(number), &format!("input {number}: {why}"))?;
        from = number + 1;
    }
    println!("{}: {} inputs, {}", target.name, options.inputs, if clean { "no findings" } else { "FINDINGS" });
    Ok(clean)
}
