//! A benchmark with hidden effects: a reality is a model with something that the model lacks, other parameters, a finer
//! time step, noise and quantised encoders; the diagnosis has to say what it is and where.
//!
//! `cargo run --release -p btr-tests --bin hidden_effects -- --help`

mod ant;
mod arm;
mod excite;
mod nao;
mod reality;
mod score;

use btr_core::log::Log;
use btr_identify::LadderStep;
use btr_identify::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use btr_identify::fit::Objective;
use btr_io::Meta;
use reality::Subject;
use score::{Case, Outcome, summary};
use std::path::Path;
use std::time::Instant;

const HELP: &str = "\
hidden_effects [KIND] [OPTIONS]
  KIND             one (default), none, two, outside
  --robot ROBOT    arm (default): a desk arm; ant: six legs on the ground; nao: two
  --effects A,B    only these; every effect that fits the robot unless given
  --seeds A..B     1..4 unless given; tuning uses seeds below 1000, reports those from 1000 on
  --size X         effects X times their realistic size; 1 unless given
  --write DIR      write the logs of the first case and stop
  --verbose        every step of the ladder
  --quiet          only the summary";

/// What is asked for on the command line.
struct Options {
    kind: String,
    subject: &'static Subject,
    effects: Vec<String>,
    seeds: std::ops::Range<u64>,
    size: f64,
    quiet: bool,
    verbose: bool,
    write: Option<String>,
}

fn options() -> Result<Options, String> {
    let mut options = Options {
        kind: "one".into(),
        subject: &arm::ARM,
        effects: vec![],
        seeds: 1..4,
        size: 1.0,
        quiet: false,
        verbose: false,
        write: None,
    };
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        let mut value = || args.next().ok_or(format!("{arg} needs a value"));
        match arg.as_str() {
            "one" | "none" | "two" | "outside" => options.kind = arg,
            "--robot" => {
                options.subject = match value()?.as_str() {
                    "arm" => &arm::ARM,
                    "ant" => &ant::ANT,
                    "nao" => &nao::NAO,
                    _ => return Err("--robot takes arm, ant or nao".to_owned()),
                }
            }
            "--effects" => options.effects = value()?.split(',').map(str::to_owned).collect(),
            "--size" => options.size = value()?.parse().map_err(|_| "--size takes a number")?,
            "--seeds" => {
                let text = value()?;
                let (a, b) = text.split_once("..").ok_or("--seeds takes A..B")?;
                let number = |x: &str| x.parse::<u64>().map_err(|_| "--seeds takes whole numbers".to_owned());
                options.seeds = number(a)?..number(b)?;
            }
            "--write" => options.write = Some(value()?),
            "--quiet" => options.quiet = true,
            "--verbose" => options.verbose = true,
            _ => return Err(HELP.to_owned()),
        }
    }
    Ok(options)
}

fn main() {
    let options = match options() {
        Ok(options) => options,
        Err(message) => {
            eprintln!("{message}");
            std::process::exit(2);
        }
    };
    let cases = reality::cases(options.subject, &options.kind, &options.effects, options.seeds.clone(), options.size);
    if let Some(folder) = &options.write {
        let Some(case) = cases.into_iter().next().map(|plan| plan()) else { return };
        match write(&case, Path::new(folder)) {
            Err(error) => eprintln!("{error}"),
            Ok(()) => println!("{}", case.describe()),
        }
        return;
    }
    let mut outcomes = Vec::new();
    for plan in cases {
        let outcome = run(&plan(), options.subject.max_rollouts, options.verbose);
        if !options.quiet {
            println!("{}", outcome.line());
        }
        outcomes.push(outcome);
    }
    println!("{}", summary(&outcomes));
}

/// The logs of a case as CSV, rounded to a micro-unit.
fn write(case: &Case, folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    std::fs::create_dir_all(folder)?;
    for (recorded, log) in case.model.logs().iter().zip(case.model.recorded()) {
        let mut rounded = Log::new(log.clock_s().iter().map(|t| (t * 1e6).round() / 1e6).collect())?;
        for (name, channel) in log.channels() {
            let values = channel.values.iter().map(|x| (x * 1e6).round() / 1e6).collect();
            rounded.insert(name, channel.unit.clone(), channel.role, values)?;
        }
        let kind = if recorded.held_out { "held_out" } else { "learn" };
        let path = folder.join(format!("{kind}_{}.csv", recorded.name.replace(' ', "_")));
        btr_io::write_log(&path, &rounded, &Meta::default())?;
    }
    Ok(())
}

/// One diagnosis.
fn run(case: &Case, max_rollouts: usize, verbose: bool) -> Outcome {
    if verbose {
        println!("{}", case.describe());
        for channel in case.model.logs().iter().take(1).flat_map(|log| &log.channels) {
            println!("    floor of {:<20} {:.5} {}", channel.name, channel.sigma, channel.unit);
        }
    }
    let began = Instant::now();
    let mut objective = Objective::new(&case.model);
    let tell = |step: &LadderStep| {
        if verbose {
            let (held_out, seconds) = (step.held_out.unwrap_or(f64::NAN), began.elapsed().as_secs_f64());
            let LadderStep { step, train, .. } = step;
            println!("    {step:<50} {train:7.3} {held_out:7.3}  {seconds:.1} s");
        }
    };
    let diagnosis =
        diagnose(&mut objective, DiagnoseOptions { max_rollouts, ..DiagnoseOptions::default() }, &tell).ok();
    let seconds = began.elapsed().as_secs_f64();
    if verbose {
        diagnosis.iter().for_each(show);
    }
    Outcome::new(case, &objective, diagnosis, seconds)
}

/// What else a diagnosis knows: estimates, and who took part in each round.
fn show(diagnosis: &Diagnosis) {
    println!("    the integrator's own error: {:.3}", diagnosis.integrator_error);
    for e in diagnosis.effects.iter().flat_map(|found| &found.parameters) {
        println!("    {} = {:.5} {:?}", e.name, e.value, e.ci95);
    }
    if !diagnosis.at_bound.is_empty() {
        println!("    at a bound: {}", diagnosis.at_bound.join(", "));
    }
    for round in &diagnosis.rounds {
        let ranked = round.iter().map(|r| format!("{} {:.3} ({:.0})", r.name, r.train, r.delta_bic));
        println!("    round: {}", ranked.collect::<Vec<_>>().join(", "));
    }
}
