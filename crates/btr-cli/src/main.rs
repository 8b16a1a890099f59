//! `btr`: evolve robot controllers and their simulator against each other.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(btr_cli::run(std::env::args_os().collect()))
}
