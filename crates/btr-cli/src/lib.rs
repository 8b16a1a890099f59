//! The command line of btr, shared by the program and by the command of the Python package.

/// As the standard macros, but that no name in a log or a model can control the terminal.
macro_rules! println {
    () => { std::println!() };
    ($($text:tt)*) => { std::println!("{}", btr_core::text::printable(&std::format!($($text)*))) };
}
macro_rules! eprintln {
    ($($text:tt)*) => { std::eprintln!("{}", btr_core::text::printable(&std::format!($($text)*))) };
}

mod args;
mod cmd;
mod command_line;
mod exit;
mod progress;
mod status;
mod terminal;

use crate::exit::REFUSED;
use args::{Args, Verb};
use btr_lab::failure::Failure;
use std::ffi::OsString;

/// Runs an invocation, whose first argument is the program's name. Returns the exit code: 0 done, 1 done but the goal
/// was missed or the run's folder lost, 2 not possible, 130 interrupted.
pub fn run(arguments: Vec<OsString>) -> u8 {
    end_quietly_on_a_closed_pipe();
    let args = match command_line::parsed(arguments) {
        Ok(args) => args,
        Err(error) => {
            // Help and version go to stdout, mistakes to stderr. A failure to write them is ignored.
            let _ = error.print();
            return u8::try_from(error.exit_code()).unwrap_or(REFUSED);
        }
    };
    answer(&args).unwrap_or_else(|failure| exit::report(&failure, args.global.json))
}

/// Exits with 0 where the reader closes the pipe (`btr info LOG | head -1`): `println!` would panic.
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

fn answer(args: &Args) -> Result<u8, Failure> {
    if let Some(threads) = args.global.threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
        pool.map_err(|e| Failure::usage(format!("--threads {threads}: {e}")))?;
    }
    match &args.verb {
        Verb::Coevolve(coevolve) => cmd::coevolve::run(coevolve, &args.global),
        Verb::Simulate(simulate) => cmd::simulate::run(simulate, &args.global),
        Verb::New(new) => cmd::models::new::run(new, &args.global),
        Verb::Check(check) => cmd::check::run(check, &args.global),
        Verb::Compare(compare) => cmd::compare::run(compare, &args.global),
        Verb::Diagnose(diagnose) => cmd::diagnose::run(diagnose, &args.global),
        Verb::Add(add) => cmd::models::add::run(add, &args.global),
        Verb::Fit(fit) => cmd::fit::run(fit, &args.global),
        Verb::Export(export) => cmd::models::export::run(export, &args.global),
        Verb::Studio(studio) => cmd::models::studio::run(studio, &args.global),
        Verb::Effects { name } => cmd::effects::run(name.as_deref(), &args.global),
        Verb::Info { log, model } => cmd::info::run(log.as_deref(), model.as_deref(), &args.global),
        Verb::Convert { from, to } => cmd::convert::run(from, to, &args.global),
        Verb::Schema => cmd::generated::schema(),
        Verb::Completions { shell } => cmd::generated::completions(*shell),
        Verb::Man => cmd::generated::man(),
    }
}
