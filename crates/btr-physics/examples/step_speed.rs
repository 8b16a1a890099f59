//! Times rollouts: `step_speed <ant|nao> <auto|rapier> <dt in s> <duration in s> <repetitions>` prints one JSON line per
//! repetition with the µs per step: the thread's processor time for all that belongs to a rollout.

#[path = "../benches/scenes/mod.rs"]
mod scenes;

use cpu_time::ThreadTime;
use scenes::{ENGINES, NAMES, Scene};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, engine, dt_s, duration_s, repetitions] = arguments.as_slice() else {
        let (names, engines) = (NAMES.join("|"), ENGINES.join("|"));
        return Err(format!("usage: step_speed <{names}> <{engines}> <dt_s> <duration_s> <repetitions>").into());
    };
    let scene = Scene::new(name, engine, dt_s.parse()?, duration_s.parse()?)?;
    for _ in 0..repetitions.parse()? {
        let begin = ThreadTime::now();
        let steps = scene.run()?.len() - 1;
        let us_per_step = begin.elapsed().as_secs_f64() * 1e6 / steps as f64;
        println!("{}", serde_json::json!({ "us_per_step": us_per_step }));
    }
    Ok(())
}
