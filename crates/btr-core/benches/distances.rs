//! Time of a distance at the paper's size: N = 4024 samples of 22 commands and 22 sensors.
//!
//! `cargo bench -p btr-core`.
#![allow(clippy::expect_used, reason = "a benchmark has no caller to report to")]

use btr_core::distance::{DISTANCES, DistanceSpec};
use btr_core::log::{Log, Role};
use btr_core::random::stream;
use btr_core::world::Behaviour;
use rand::RngExt;

const SAMPLES: usize = 4024;
const JOINTS: usize = 22;
/// One reference in 55 ms, seven samples each.
const SAMPLE_S: f64 = 0.055 / 7.0;

fn main() {
    divan::main();
}

/// Every distance on two noisy logs on the same clock.
#[divan::bench(args = DISTANCES.iter().map(|(name, _)| name), sample_count = 20)]
fn distance(bencher: divan::Bencher, name: &str) {
    let spec = std::collections::BTreeMap::from([("distance", name)]);
    let spec: std::collections::BTreeMap<String, DistanceSpec> =
        toml::from_str(&toml::to_string(&spec).expect("names are text")).expect("the names are those of the registry");
    let distance = spec["distance"].build();
    let (real, sim) = (behaviour(1), behaviour(2));
    bencher.bench_local(|| distance.distance(&real, &sim));
}

/// Sines of various frequencies with noise that depends on the seed.
fn behaviour(seed: u64) -> Behaviour {
    let clock: Vec<f64> = (0..SAMPLES).map(|i| i as f64 * SAMPLE_S).collect();
    let mut log = Log::new(clock.clone()).expect("the clock increases");
    for (number, role) in [Role::Command, Role::Measured].into_iter().enumerate() {
        for joint in 0..JOINTS {
            let mut rng = stream(seed, &[number as u64, joint as u64]);
            let rad_s = 2.0 + joint as f64;
            let values = clock.iter().map(|t| (rad_s * t).sin() + 0.1 * rng.random::<f64>()).collect();
            log.insert(format!("{role:?}_{joint}"), "rad", role, values).expect("one value per sample");
        }
    }
    Behaviour { log, fitness: seed as f64 }
}
