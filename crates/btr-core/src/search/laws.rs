//! Invariants of every search, whatever the costs.
#![allow(clippy::unwrap_used)]

use super::{AnySearch, SEARCHES, Search, SearchSpec, UnitPoint};
use crate::random::stream;
use proptest::prelude::*;

fn named(name: &str) -> SearchSpec {
    toml::from_str(&format!("algorithm = {name:?}")).unwrap()
}

/// A cost with slopes, plateaus and failures, all decided by the point.
fn cost(p: &[f64], failing: f64) -> f64 {
    let sum: f64 = p.iter().enumerate().map(|(i, x)| (x - 0.1 * i as f64).powi(2)).sum();
    let lot = (p.iter().sum::<f64>() * 7919.0).fract();
    if lot < failing { f64::INFINITY } else { sum }
}

fn generation(search: &mut AnySearch, draw: u64, generation: u64, failing: f64) -> (Vec<UnitPoint>, Vec<f64>) {
    let population = search.ask(&mut stream(draw, &[generation]));
    let costs: Vec<f64> = population.iter().map(|p| cost(p, failing)).collect();
    search.tell(&population, &costs);
    (population, costs)
}

/// No failures, some, or nothing but failures.
fn failing() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), 0.1..0.9f64, Just(1.1)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn bounds_are_kept(which in 0..SEARCHES.len(), draw: u64, dims in 0usize..7, seeded: bool, failing in failing()) {
        let seed = vec![1.0; dims];
        let spec = named(SEARCHES[which].0);
        let mut search = spec.start(dims, seeded.then_some(&seed[..]));
        for g in 0..60 {
            let (population, _) = generation(&mut search, draw, g, failing);
            prop_assert!(g > 0 || population.len() == spec.population(dims));
            for point in population {
                prop_assert_eq!(point.len(), dims);
                prop_assert!(point.iter().all(|x| (0.0..=1.0).contains(x)), "{:?}", point);
            }
        }
    }

    #[test]
    fn the_best_is_the_best_ever_reported(which in 0..SEARCHES.len(), draw: u64, failing in failing()) {
        let mut search = named(SEARCHES[which].0).start(4, None);
        let mut lowest = f64::INFINITY;
        for g in 0..40 {
            let (_, costs) = generation(&mut search, draw, g, failing);
            lowest = costs.iter().copied().fold(lowest, f64::min);
            match search.best() {
                None => prop_assert!(lowest.is_infinite()),
                Some((point, best)) => {
                    prop_assert_eq!(best.to_bits(), lowest.to_bits());
                    prop_assert_eq!(best.to_bits(), cost(point, failing).to_bits());
                }
            }
            // Elitism: once something has succeeded, genetic algorithms ask the best again in every generation.
            if SEARCHES[which].0 != "cma_es" && lowest < f64::INFINITY {
                let best = search.best().map(|(point, _)| point.to_vec()).unwrap();
                let next = search.clone().ask(&mut stream(draw, &[g + 1]));
                prop_assert!(next.contains(&best));
            }
        }
    }

    #[test]
    fn a_saved_state_goes_on_bit_by_bit(
        which in 0..SEARCHES.len(), draw: u64, saved in 0u64..30, failing in failing(), between: bool
    ) {
        let mut search = named(SEARCHES[which].0).start(4, Some(&[0.3; 4]));
        for g in 0..saved {
            generation(&mut search, draw, g, failing);
        }
        // Also between asking and telling, where a run waits for a robot.
        let pending = between.then(|| search.ask(&mut stream(draw, &[saved])));
        let bytes = postcard::to_allocvec(&search).unwrap();
        let mut back: AnySearch = postcard::from_bytes(&bytes).unwrap();
        prop_assert_eq!(&back, &search);
        if let Some(population) = pending {
            let costs: Vec<f64> = population.iter().map(|p| cost(p, failing)).collect();
            search.tell(&population, &costs);
            back.tell(&population, &costs);
        }
        for g in saved + 1..saved + 20 {
            let (ours, theirs) = (generation(&mut search, draw, g, failing), generation(&mut back, draw, g, failing));
            prop_assert_eq!(ours, theirs);
        }
        prop_assert_eq!(postcard::to_allocvec(&back).unwrap(), postcard::to_allocvec(&search).unwrap());
    }
}

#[test]
fn names_and_settings_are_read_and_written() {
    for (name, _) in SEARCHES {
        let spec = named(name);
        assert_eq!(spec.name(), *name);
        let text = toml::to_string(&spec).unwrap();
        assert_eq!(toml::from_str::<SearchSpec>(&text).unwrap(), spec);
    }
    let wrong = |text: &str| toml::from_str::<SearchSpec>(text).unwrap_err().to_string();
    assert!(wrong("algorithm = \"ga\"\npopulaton = 3").contains("populaton"));
    assert!(wrong("algorithm = \"ga\"\nmutation = 1.5").contains("between 0 and 1, not 1.5"));
    assert!(wrong("algorithm = \"gaa\"").contains("cma_es"));
    assert!(wrong("algorithm = \"cma_es\"\npopulation = 1").contains("a count of 2 or more, not 1"));
    assert!(wrong("algorithm = \"cma_es\"\nsigma = 0").contains("positive"));
}
