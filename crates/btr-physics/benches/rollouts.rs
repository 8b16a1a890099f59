//! Steps per second of the ant, the Nao and an arm on btr's own engine and on Rapier, and the overhead of a rollout.
//!
//! `cargo bench -p btr-physics`. One item of `rollouts` is one physics step of 0.055/7 s of one candidate. `set_up`
//! builds one batch of rollouts and makes a single step of each: eight times its time, compared with `rollouts` on one
//! thread, is overhead.
#![allow(clippy::expect_used, reason = "a benchmark has nobody to report to")]

mod scenes;

use btr_physics::presets::nao::{CONTROL_S, STEPS_PER_CONTROL};
use divan::counter::ItemsCount;
use rayon::prelude::*;
use scenes::{ENGINES, NAMES, Scene};

/// The paper's physics step, in s.
const DT_S: f64 = CONTROL_S / STEPS_PER_CONTROL as f64;
/// Simulated time of a rollout, in s.
const DURATION_S: f64 = 2.0;
/// Rollouts in a population.
const POPULATION: usize = 64;
/// Rollouts in a batch: the largest number of SIMD lanes on any machine.
const BATCH: usize = 8;

fn main() {
    divan::main();
}

/// Every robot on every engine: `ant on auto`.
fn all() -> Vec<String> {
    NAMES.iter().flat_map(|name| ENGINES.map(|engine| format!("{name} on {engine}"))).collect()
}

/// A population of rollouts of 2 s on one and on two threads.
#[divan::bench(args = all(), consts = [1, 2], sample_count = 10)]
fn rollouts<const THREADS: usize>(bencher: divan::Bencher, which: &str) {
    let scene = scene(which, DT_S, DURATION_S);
    let steps = (DURATION_S / DT_S).round() as usize;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(THREADS).build().expect("threads");
    let population = || (0..POPULATION / BATCH).into_par_iter().map(|_| scene.run_all(BATCH)).collect::<Vec<_>>();
    bencher.counter(ItemsCount::new(POPULATION * steps)).bench_local(|| pool.install(population));
}

/// Rollouts of a single step: building the world, the controller and the log.
#[divan::bench(args = all(), sample_count = 200)]
fn set_up(bencher: divan::Bencher, which: &str) {
    let scene = scene(which, DT_S, DT_S);
    bencher.counter(ItemsCount::new(BATCH)).bench_local(|| scene.run_all(BATCH));
}

/// Planning a motion of 2 s: the Nao's centre of mass, feet and joint angles.
#[divan::bench(args = NAMES, sample_count = 50)]
fn drive(bencher: divan::Bencher, name: &str) {
    bencher.bench_local(|| scene(name, DT_S, DURATION_S));
}

fn scene(which: &str, dt_s: f64, duration_s: f64) -> Scene {
    let (name, engine) = which.split_once(" on ").unwrap_or((which, "auto"));
    Scene::new(name, engine, dt_s, duration_s).expect("the nominal controller is in its space")
}
