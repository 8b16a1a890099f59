//! What robots are told; of the arm: training episodes and others to judge on, all of four seconds.

use btr_core::random::Rng;
use rand::RngExt;
use std::f64::consts::TAU;

/// Length of an episode and time between two commands, in s.
const DURATION_S: f64 = 4.0;
pub(crate) const TICK_S: f64 = 0.01;

/// Commands of one episode: a row per joint, in rad.
pub(crate) type Commands = Vec<Vec<f64>>;

/// Multisine, steps, slow ramps with reversals, chirp: each around a pose of its own.
pub(crate) fn training(joints: usize, rng: &mut Rng) -> Vec<Commands> {
    let kinds: [fn(&mut Rng) -> Vec<f64>; 4] = [multisine, steps, ramps, chirp];
    kinds.iter().map(|kind| (0..joints).map(|_| kind(rng)).collect()).collect()
}

/// Others of the same kinds.
pub(crate) fn held_out(joints: usize, rng: &mut Rng) -> Vec<Commands> {
    let kinds: [fn(&mut Rng) -> Vec<f64>; 3] = [multisine, steps, ramps];
    kinds.iter().map(|kind| (0..joints).map(|_| kind(rng)).collect()).collect()
}

/// The instants of an episode.
pub(crate) fn clock(duration_s: f64) -> impl Iterator<Item = f64> {
    (0..=(duration_s / TICK_S).round() as usize).map(|i| i as f64 * TICK_S)
}

pub(crate) fn between(rng: &mut Rng, least: f64, most: f64) -> f64 {
    least + (most - least) * rng.random::<f64>()
}

/// Begins at rest: everything grows from zero within half a second.
fn ease(t: f64) -> f64 {
    (t / 0.5).min(1.0)
}

fn multisine(rng: &mut Rng) -> Vec<f64> {
    let middle = between(rng, -0.6, 0.6);
    let parts: Vec<[f64; 3]> = (0..5)
        .map(|k| [between(rng, 0.06, 0.2), 0.3 + 0.6 * k as f64 + between(rng, 0.0, 0.3), between(rng, 0.0, TAU)])
        .collect();
    let wave = |t: f64| parts.iter().map(|[a, f, p]| a * ((TAU * f * t + p).sin() - p.sin())).sum::<f64>();
    clock(DURATION_S).map(|t| middle + ease(t) * wave(t)).collect()
}

fn steps(rng: &mut Rng) -> Vec<f64> {
    let middle = between(rng, -0.4, 0.4);
    let levels: Vec<f64> = (0..8).map(|_| middle + between(rng, -0.5, 0.5)).collect();
    let offset = between(rng, 0.0, 0.3);
    clock(DURATION_S).map(|t| if t < 0.4 { middle } else { levels[((t - 0.4 + offset) / 0.5) as usize % 8] }).collect()
}

fn ramps(rng: &mut Rng) -> Vec<f64> {
    let (middle, amplitude) = (between(rng, -0.5, 0.5), between(rng, 0.25, 0.5));
    let (period, phase) = (between(rng, 1.6, 2.6), between(rng, 0.0, 1.0));
    let triangle = |x: f64| 4.0 * ((x - 0.25).rem_euclid(1.0) - 0.5).abs() - 1.0;
    clock(DURATION_S).map(|t| middle + ease(t) * amplitude * (triangle(t / period + phase) - triangle(phase))).collect()
}

fn chirp(rng: &mut Rng) -> Vec<f64> {
    let (middle, amplitude) = (between(rng, -0.4, 0.4), between(rng, 0.12, 0.25));
    let (slow, fast) = (between(rng, 0.3, 0.6), between(rng, 3.0, 4.5));
    let angle = |t: f64| TAU * (slow * t + (fast - slow) * t * t / (2.0 * DURATION_S));
    clock(DURATION_S).map(|t| middle + amplitude * angle(t).sin()).collect()
}
