//! Memory over many rollouts: `memory <ant|nao|arm> <duration in s> <rollouts>` simulates them on all cores, 64 at a
//! time, and prints a JSON line with the resident memory after every tenth of them. Linux only.

#[path = "../benches/scenes/mod.rs"]
mod scenes;

use rayon::prelude::*;
use scenes::{ENGINES, NAMES, Scene};
use std::error::Error;

const DT_S: f64 = 0.001;
const AT_ONCE: usize = 64;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, duration_s, rollouts] = arguments.as_slice() else {
        return Err(format!("usage: memory <{}> <duration_s> <rollouts>", NAMES.join("|")).into());
    };
    let scene = Scene::new(name, ENGINES[0], DT_S, duration_s.parse()?)?;
    let rollouts: usize = rollouts.parse()?;
    for tenth in 1..=10 {
        (0..(rollouts / 10).div_ceil(AT_ONCE)).into_par_iter().try_for_each(|_| scene.run_all(AT_ONCE).map(drop))?;
        println!("{}", serde_json::json!({ "rollouts": tenth * rollouts / 10, "resident_kib": resident_kib()? }));
    }
    Ok(())
}

/// Resident memory in KiB, from /proc.
fn resident_kib() -> Result<u64, Box<dyn Error>> {
    let status = std::fs::read_to_string("/proc/self/status")?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).ok_or("no VmRSS in /proc/self/status")?;
    Ok(line.trim().trim_end_matches("kB").trim().parse()?)
}
