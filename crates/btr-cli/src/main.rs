//! `btr`: evolve robot controllers and their simulator against each other.

mod args;
mod cmd;
mod failure;
mod figures;
mod plot;
mod progress;
mod report;

mod table;

use args::{Args, Verb};
use failure::Failure;
use std::process::ExitCode;

fn main() -> ExitCode {
    end_quietly_on_a_closed_pipe();
    let args = match Args::typed() {
        Ok(args) => args,
        Err(error) => error.exit(),
    };
    match run(&args) {
        Ok(code) => code,
        Err(failure) => failure.report(args.global.json),
    }
}

/// `btr info LOG | head -1`: a reader that has enough is no error, but `println!` panics on it.
fn end_quietly_on_a_closed_pipe() {
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        let text = info.payload().downcast_ref::<String>();
        if text.is_some_and(|text| text.starts_with("failed printing to stdout") && text.contains("Broken pipe")) {
            std::process::exit(0);
        }
        report(info);
    }));
}

fn run(args: &Args) -> Result<ExitCode, Failure> {
    if let Some(threads) = args.global.threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
        pool.map_err(|e| Failure::usage(format!("--threads {threads}: {e}")))?;
    }
    match &args.verb {
        Verb::Coevolve(coevolve) => cmd::coevolve::run(coevolve, &args.global),
        Verb::Simulate(simulate) => cmd::simulate::run(simulate, &args.global),
        Verb::Check(check) => cmd::check::run(check, &args.global),
        Verb::Compare(compare) => cmd::compare::run(compare, &args.global),
        Verb::Diagnose(diagnose) => cmd::diagnose::run(diagnose, &args.global),
        Verb::Add(add) => cmd::add::run(add, &args.global),
        Verb::Fit(fit) => cmd::fit::run(fit, &args.global),
        Verb::Effects { name } => cmd::effects::run(name.as_deref(), &args.global),
        Verb::Info { log } => cmd::info::run(log.as_deref(), &args.global),
        Verb::Convert { from, to } => cmd::convert::run(from, to, &args.global),
        Verb::Schema => cmd::schema::run(),
        Verb::Completions { shell } => cmd::completions::run(*shell),
        Verb::Man => cmd::completions::man(),
    }
}
