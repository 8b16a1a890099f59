//! Times rollouts: `step_speed <ant|nao|arm> <auto|rapier> <dt in s> <duration in s> <repetitions> <population>` prints
//! one JSON line per repetition with the µs per step and candidate: the thread's processor time for the complete
//! rollouts of a population that is simulated at once.

#[path = "../benches/scenes/mod.rs"]
mod scenes;

use cpu_time::ThreadTime;
use scenes::{ENGINES, NAMES, Scene};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, engine, dt_s, duration_s, repetitions, population] = arguments.as_slice() else {
        let (names, engines) = (NAMES.join("|"), ENGINES.join("|"));
        return Err(
            format!("usage: step_speed <{names}> <{engines}> <dt_s> <duration_s> <repetitions> <population>").into()
        );
    };
    let scene = Scene::new(name, engine, dt_s.parse()?, duration_s.parse()?)?;
    let population: usize = population.parse()?;
    for _ in 0..repetitions.parse()? {
        let begin = ThreadTime::now();
        let steps: usize = scene.run_all(population)?.iter().map(|log| log.len() - 1).sum();
        let us_per_step = begin.elapsed().as_secs_f64() * 1e6 / steps as f64;
        println!("{}", serde_json::json!({ "us_per_step": us_per_step }));
    }
    Ok(())
}
