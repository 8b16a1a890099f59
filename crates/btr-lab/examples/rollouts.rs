//! Time of simulating a population: `rollouts MODEL.toml CANDIDATES ROUNDS` prints the seconds of every round. For
//! `benches/python_overhead.py`, which compares it with Python.

use btr_core::world::{Job, Simulator};
use btr_lab::experiment::{Source, model};
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match measured(&args) {
        Ok(seconds) => {
            seconds.iter().for_each(|s| println!("{s:.6}"));
            ExitCode::SUCCESS
        }
        Err(why) => {
            eprintln!("{why}\nrollouts MODEL.toml CANDIDATES ROUNDS");
            ExitCode::FAILURE
        }
    }
}

fn measured(args: &[String]) -> Result<Vec<f64>, String> {
    let [path, candidates, rounds] = args else { return Err("three arguments".to_owned()) };
    let count = |text: &String| text.parse::<usize>().map_err(|e| e.to_string());
    let (candidates, rounds) = (count(candidates)?, count(rounds)?);
    let source = Source::read(Path::new(path)).map_err(|e| e.to_string())?;
    let model = model(&source).map_err(|e| e.to_string())?;
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let jobs = vec![Job { s: &s, c: &c, scenario: 0 }; candidates];
    let round = |_| {
        let began = Instant::now();
        let logs = model.simulate_jobs(&jobs, &|| Ok(())).map_err(|e| e.to_string())?;
        let seconds = began.elapsed().as_secs_f64();
        logs.into_iter().find_map(Result::err).map_or(Ok(seconds), |e| Err(e.to_string()))
    };
    (0..rounds).map(round).collect()
}
