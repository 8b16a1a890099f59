//! Invariants of every distance.
#![allow(clippy::unwrap_used)]

use super::{DISTANCES, Distance, DistanceSpec};
use crate::log::{Log, Role};
use crate::random::stream;
use crate::world::Behaviour;
use proptest::prelude::*;
use rand::RngExt;
use std::time::Instant;

fn named(name: &str) -> Box<dyn Distance> {
    #[derive(serde::Deserialize)]
    struct Section {
        distance: DistanceSpec,
    }
    toml::from_str::<Section>(&format!("distance = {name:?}")).unwrap().distance.build()
}

/// A behaviour of oscillating joints, with a command and a channel that no robot measures.
fn behaviour(draw: u64, samples: usize, joints: usize) -> Behaviour {
    let mut rng = stream(draw, &[]);
    let clock_s: Vec<f64> = (0..samples).map(|i| 0.01 * i as f64).collect();
    let mut log = Log::new(clock_s.clone()).unwrap();
    for joint in 0..joints {
        let (amplitude, rate, phase): (f64, f64, f64) = (rng.random(), 3.0 + rng.random::<f64>(), rng.random());
        let mut swing = |noise: f64| -> Vec<f64> {
            clock_s.iter().map(|t| amplitude * (rate * t + phase).sin() + noise * rng.random::<f64>()).collect()
        };
        log.insert(format!("cmd_{joint}"), "rad", Role::Command, swing(0.0)).unwrap();
        log.insert(format!("q_{joint}"), "rad", Role::Measured, swing(0.05)).unwrap();
    }
    log.insert("base_x", "m", Role::Truth, clock_s.iter().map(|_| rng.random()).collect()).unwrap();
    Behaviour { log, fitness: rng.random() }
}

fn changed(behaviour: &Behaviour, mut change: impl FnMut(&str, Vec<f64>) -> Vec<f64>) -> Behaviour {
    let mut log = Log::new(behaviour.log.clock_s().to_vec()).unwrap();
    for (name, channel) in behaviour.log.channels() {
        log.insert(name, channel.unit.clone(), channel.role, change(name, channel.values.clone())).unwrap();
    }
    Behaviour { log, fitness: behaviour.fitness }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn zero_for_itself_positive_for_others(which in 0..DISTANCES.len(), draw in 0u64..1000) {
        let distance = named(DISTANCES[which].0);
        let (real, sim) = (behaviour(draw, 300, 3), behaviour(draw + 1000, 300, 3));
        prop_assert!(distance.distance(&real, &real) <= 1e-12);
        let apart = distance.distance(&real, &sim);
        prop_assert!(apart > 0.0 && apart.is_finite(), "{} {}", distance.name(), apart);
    }

    #[test]
    fn residuals_add_up_to_the_square(which in 0..DISTANCES.len(), draw in 0u64..1000, missing in 0.0..1.0f64) {
        let distance = named(DISTANCES[which].0);
        let Some(squares) = distance.as_squares() else { return Ok(()) };
        let mut rng = stream(draw, &[2]);
        let (real, sim) = (behaviour(draw, 90, 3), behaviour(draw + 1000, 70, 3));
        let real = changed(&real, |name, values| {
            let share = if name == "q_1" { 1.0 } else { missing };
            values.into_iter().map(|v| if rng.random::<f64>() < share { f64::NAN } else { v }).collect()
        });
        let residuals = squares.residuals(&real, &sim);
        let sum: f64 = residuals.iter().flatten().filter(|r| !r.is_nan()).map(|r| r * r).sum();
        let square = distance.distance(&real, &sim).powi(2);
        prop_assert!(!square.is_finite() || (sum - square).abs() <= 1e-12 * square, "{} {}", sum, square);
    }

    #[test]
    fn never_nan_whatever_is_missing(which in 0..DISTANCES.len(), draw in 0u64..1000, missing in 0.0..1.2f64) {
        let distance = named(DISTANCES[which].0);
        let mut rng = stream(draw, &[1]);
        let (real, sim) = (behaviour(draw, 60, 2), behaviour(draw + 1, 60, 2));
        let mut hole = |value: f64| match rng.random::<f64>() {
            lot if lot >= missing => value,
            lot if lot < 0.1 * missing => f64::INFINITY,
            _ => f64::NAN,
        };
        let sim = changed(&sim, |_, values| values.into_iter().map(&mut hole).collect());
        prop_assert!(distance.distance(&real, &sim) >= 0.0);
        prop_assert!(distance.distance(&sim, &real) >= 0.0);
    }

    #[test]
    fn another_clock_is_resampled(which in 0..DISTANCES.len(), draw in 0u64..1000) {
        let distance = named(DISTANCES[which].0);
        let (real, sim) = (behaviour(draw, 200, 2), behaviour(draw + 1, 150, 2));
        let shared = Behaviour { log: sim.log.resample(real.log.clock_s()).unwrap(), fitness: sim.fitness };
        let (other, same) = (distance.distance(&real, &sim), distance.distance(&real, &shared));
        prop_assert_eq!(other.to_bits(), same.to_bits());
    }
}

#[test]
fn nothing_in_common_is_infinitely_far() {
    let real = behaviour(1, 100, 2);
    let empty = Behaviour { log: Log::default(), fitness: f64::NAN };
    let missing = changed(&real, |_, values| vec![f64::NAN; values.len()]);
    for (name, _) in DISTANCES {
        let distance = named(name);
        assert!(distance.distance(&real, &empty).is_infinite(), "{name}");
        assert!(distance.distance(&empty, &real).is_infinite(), "{name}");
        assert!(*name == "fitness" || distance.distance(&real, &missing).is_infinite(), "{name}");
    }
}

#[test]
fn channels_that_no_robot_measures_do_not_count() {
    let real = behaviour(2, 100, 2);
    let sim = changed(&real, |name, v| if name == "base_x" { vec![1e3; v.len()] } else { v });
    for (name, _) in DISTANCES {
        assert!(named(name).distance(&real, &sim) <= 1e-12, "{name}");
    }
}

#[test]
fn commands_count_in_phi_2_alone() {
    let real = behaviour(3, 400, 2);
    let sim = changed(&real, |name, v| if name == "cmd_0" { v.iter().map(|x| 1.5 * x).collect() } else { v });
    for (name, _) in DISTANCES {
        let distance = named(name).distance(&real, &sim);
        assert_eq!(distance > 0.1, *name == "information", "{name}: {distance}");
    }
}

#[test]
fn a_model_that_stays_at_the_mean_has_a_fit_of_zero() {
    let real = behaviour(4, 500, 3);
    let mean = changed(&real, |_, v| vec![crate::signal::stats::mean(&v); v.len()]);
    for name in ["rmse", "normalised_rmse", "spectrum"] {
        let distance = named(name).distance(&real, &mean);
        assert!((distance - 1.0).abs() < if name == "spectrum" { 0.3 } else { 1e-9 }, "{name}: {distance}");
    }
    let q = real.log.values("q_0").unwrap();
    let half: Vec<f64> = q.iter().map(|v| v + 0.5 * (crate::signal::stats::mean(q) - v)).collect();
    assert!((super::fit_percent(q, &half).unwrap() - 50.0).abs() < 1e-9);
    assert_eq!(super::fit_percent(&[1.0, 1.0], &[1.0, 2.0]), None);
}

/// `cargo test --release -p btr-core cost_of_a_call -- --ignored --nocapture`
#[test]
#[ignore = "prints timings"]
fn cost_of_a_call() {
    let (real, sim) = (behaviour(5, 4024, 22), behaviour(6, 4024, 22));
    for (name, _) in DISTANCES {
        let distance = named(name);
        // The fastest of many calls: the one the machine disturbed least.
        let seconds = |_| {
            let start = Instant::now();
            std::hint::black_box(distance.distance(&real, &sim));
            start.elapsed().as_secs_f64()
        };
        let fastest = (0..100).map(seconds).fold(f64::INFINITY, f64::min);
        println!("{name:16} {:8.0} us", 1e6 * fastest);
    }
}
