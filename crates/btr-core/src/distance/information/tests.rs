//! The metric's axioms, and the traps of phi_2.
#![allow(clippy::unwrap_used)]

use super::*;
use crate::random::stream;
use proptest::prelude::*;
use rand::RngExt;

fn uniform(draw: u64) -> Vec<f64> {
    let mut rng = stream(draw, &[]);
    (0..4024).map(|_| rng.random::<f64>() * 2.0 - 1.0).collect()
}

fn d(x: &[f64], y: &[f64]) -> f64 {
    information_distance(x, y, 16).unwrap().distance()
}

fn d_in(x: &[f64], y: &[f64], bins: &Bins) -> f64 {
    let mut joint = JointHistogram::new(bins.last + 1);
    joint.count(x, y, bins);
    joint.entropies().distance()
}

fn three_series() -> impl Strategy<Value = (Vec<f64>, Vec<f64>, Vec<f64>)> {
    prop::collection::vec((-2.0..2.0f64, -2.0..2.0f64, -2.0..2.0f64), 1..80).prop_map(|rows| {
        (rows.iter().map(|r| r.0).collect(), rows.iter().map(|r| r.1).collect(), rows.iter().map(|r| r.2).collect())
    })
}

proptest! {
    #[test]
    fn a_metric_on_symbols((x, y, z) in three_series(), bins in 2usize..9) {
        let bins = Bins::new(-2.0, 2.0, bins);
        let (xy, yz, xz) = (d_in(&x, &y, &bins), d_in(&y, &z, &bins), d_in(&x, &z, &bins));
        prop_assert!(xy >= 0.0 && d_in(&x, &x, &bins) <= 0.0);
        prop_assert!((xy - d_in(&y, &x, &bins)).abs() < 1e-12);
        prop_assert!(xz <= xy + yz + 1e-12, "{xz} > {xy} + {yz}");
    }

    #[test]
    fn the_chain_rule_and_the_limits_hold((x, y, _) in three_series(), bins in 2usize..9) {
        let e = information_distance(&x, &y, bins).unwrap();
        let swapped = information_distance(&y, &x, bins).unwrap();
        prop_assert!((e.h_x + e.h_y_given_x - e.h_y - e.h_x_given_y).abs() < 1e-12);
        prop_assert!((e.distance() - swapped.distance()).abs() < 1e-12);
        prop_assert!(e.h_x_given_y <= e.h_x + 1e-12 && e.h_x <= (bins as f64).log2() + 1e-12);
    }
}

#[test]
fn independent_series_share_nothing() {
    // 8 bits, less (16 - 1)²/(N·ln 2) = 0.08 because 4024 samples cannot fill 256 cells evenly.
    let distance = d(&uniform(1), &uniform(2));
    assert!((distance - 7.92).abs() < 0.03, "{distance}");
}

#[test]
fn gain_and_offset_show_in_shared_bins() {
    let x = uniform(3);
    let changed = |f: fn(f64) -> f64| x.iter().map(|v| f(*v)).collect::<Vec<_>>();
    for (what, y) in [("gain", changed(|v| 1.5 * v)), ("offset", changed(|v| v + 0.3))] {
        assert!(d(&x, &y) > 0.5, "{what}: {}", d(&x, &y));
        // With bins fitted to each series apart both have the same symbols.
        let own = |s: &[f64]| -> Vec<f64> {
            let bins = Bins::spanning(s, s, 16).unwrap();
            s.iter().map(|v| bins.of(*v) as f64).collect()
        };
        assert!(d(&own(&x), &own(&y)) < 1e-2, "{what}");
    }
}

#[test]
fn an_exchange_of_symbols_stays_invisible() {
    let x: Vec<f64> = uniform(4).into_iter().chain([-1.0, 1.0]).collect();
    let flipped: Vec<f64> = x.iter().map(|v| -v).collect();
    assert!(d(&x, &flipped) < 0.01, "{}", d(&x, &flipped));
    assert!(d(&[1.0; 9], &[2.0; 9]) <= 0.0);
}

#[test]
fn missing_samples_are_ignored_on_both_sides() {
    let (x, y) = (uniform(5), uniform(6));
    let (mut holes, mut more) = (x.clone(), y.clone());
    holes[100] = f64::NAN;
    more[200] = f64::INFINITY;
    let kept = |s: &[f64]| -> Vec<f64> { (0..s.len()).filter(|i| *i != 100 && *i != 200).map(|i| s[i]).collect() };
    assert_eq!(information_distance(&holes, &more, 16), information_distance(&kept(&x), &kept(&y), 16));
    assert_eq!(information_distance(&[f64::NAN], &[1.0], 16), None);
}
