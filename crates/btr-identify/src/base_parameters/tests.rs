#![allow(clippy::unwrap_used)]
use super::*;
use crate::residual_model::{MeasuredChannel, ModelDescription, RecordedLog};
use btr_core::random::stream;
use proptest::prelude::*;
use rand::RngExt;

const ROWS: usize = 4000;
/// Samples over which noise and columns are smoothed.
const SMOOTHED: usize = 9;

/// Values of the parameters: `c` always acts with `a` and `b`, `e` does nothing.
const TRUTH: [f64; 5] = [2.0, -1.0, 0.5, 30.0, 7.0];
const NAMES: [&str; 5] = ["a", "b", "c", "d", "e"];

fn column(k: usize, row: usize) -> f64 {
    let t = row as f64 * 0.01;
    let [a, b, d] = [(1.3 * t).sin(), (3.1 * t).cos(), 0.01 * (0.7 * t).sin() * (2.3 * t).cos()];
    [a, b, 0.3 * a - 2.0 * b, d, 0.0][k]
}

/// Noise with a standard deviation of 1 that is smoothed over some samples.
fn noise(seed: u64, rows: usize) -> Vec<f64> {
    let mut rng = stream(seed, &[]);
    let mut white = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    let raw: Vec<f64> = (0..rows + SMOOTHED).map(|_| white()).collect();
    raw.windows(SMOOTHED).take(rows).map(|w| w.iter().sum::<f64>() / (SMOOTHED as f64).sqrt()).collect()
}

/// A training and a held-out log. `others` is what else is in the readings, in noise floors.
fn planted(seed: u64, others: f64) -> BaseParameters {
    let channel = MeasuredChannel {
        name: "tau".to_owned(),
        unit: "N·m".to_owned(),
        sigma: 1.0,
        sensor: 1.0,
        beside: [].into(),
        offset_differs: false,
        samples: 0..ROWS,
        present: ROWS,
    };
    let log = |held_out| RecordedLog { name: String::new(), held_out, channels: vec![channel.clone()], present: ROWS };
    let of = ModelDescription {
        clocks_s: vec![(0..ROWS).map(|row| row as f64 * 0.01).collect(); 2],
        measured: vec![vec![1.0; ROWS]; 2],
        ..ModelDescription::new(Vec::new(), vec![log(false), log(true)])
    };
    let signal = |row: usize| (0..5).map(|k| TRUTH[k] * column(k, row)).sum::<f64>();
    let other = |row: usize| others * (0.2 * (row as f64).sqrt()).sin();
    let residual = |seed| (0..ROWS).zip(noise(seed, ROWS)).map(|(row, n)| signal(row) + n + other(row)).collect();
    let parameter = |name: &&str| LinearParameter { name: (*name).to_owned(), unit: "1".to_owned(), value: 0.0 };
    let columns: Vec<Vec<f64>> = (0..5).map(|k| (0..ROWS).map(|row| column(k, row)).collect()).collect();
    let parameters: Vec<LinearParameter> = NAMES.iter().map(parameter).collect();
    let residuals = vec![residual(2 * seed), residual(2 * seed + 1)];
    let model = LinearModel::new(of, &parameters, residuals, vec![columns.clone(), columns]);
    base_parameters(&model, &[0, 0, 1, 0, 0]).unwrap()
}

#[test]
fn combinations_are_named_and_found_again() {
    let found = planted(1, 0.0);
    let names: Vec<&str> = found.combinations.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["a + 0.3*c", "b - 2*c", "d"]);
    assert_eq!(found.not_identifiable, ["e"]);
    for (combination, truth) in found.combinations.iter().zip([2.15, -2.0, 30.0]) {
        let sd = combination.sd.unwrap();
        assert!((combination.value - truth).abs() < 3.5 * sd, "{combination:?}");
        assert!((combination.sd_percent.unwrap() - 100.0 * sd / combination.value.abs()).abs() < 1e-9);
    }
    assert!((found.train - 1.0).abs() < 0.1 && (found.held_out.unwrap() - 1.0).abs() < 0.1, "{found:?}");
}

/// Smoothed noise leaves one independent sample in nine: deviations that count all rows would be three times too small.
#[test]
fn deviations_are_those_of_repeated_experiments() {
    const SEEDS: u64 = 40;
    let runs: Vec<BaseParameters> = (0..SEEDS).map(|seed| planted(seed, 0.0)).collect();
    for (i, truth) in [2.15, -2.0, 30.0].into_iter().enumerate() {
        let scores = runs.iter().map(|run| &run.combinations[i]).map(|c| (c.value - truth) / c.sd.unwrap());
        let spread = (scores.map(|z| z * z).sum::<f64>() / SEEDS as f64).sqrt();
        assert!((0.7..1.3).contains(&spread), "{i}: {spread}");
    }
}

#[test]
fn deviations_are_withheld_where_something_is_missing() {
    let found = planted(3, 2.0);
    assert!(found.withheld.is_some() && found.combinations.iter().all(|c| c.sd.is_none() && c.sd_percent.is_none()));
}

/// Positive numbers, `c` up to a bound.
struct Positive {
    most: f64,
}

impl Family for Positive {
    fn bounds(&self) -> Vec<(f64, f64)> {
        let mut bounds = vec![(-20.0, 20.0); 5];
        bounds[2].1 = self.most.ln();
        bounds
    }

    fn at(&self, x: &[f64]) -> Option<Vec<f64>> {
        Some(x.iter().map(|x| x.exp()).collect())
    }
}

/// `b - 2*c` is -2, which positive `b` and `c` can give where `c` may exceed 1.
#[test]
fn the_nearest_member_has_the_estimates_where_one_can() {
    let base = planted(1, 0.0);
    let found = nearest(&base, &Positive { most: 50.0 }).unwrap();
    assert_eq!(found.membership, Membership::AsEstimated, "{found:?}");
    assert!(found.values.iter().all(|value| *value > 0.0));
    assert!((found.values[4] - 1.0).abs() < 1e-6, "what nothing tells stays: {found:?}");
    for (value, combination) in found.combinations.iter().zip(&base.combinations) {
        assert!((value - combination.value).abs() < 0.1 * combination.sd.unwrap(), "{found:?}");
    }
    let short = nearest(&base, &Positive { most: 0.5 }).unwrap();
    assert_eq!(short.membership, Membership::Contradicted, "{short:?}");
    assert!((short.values[2] - 0.5).abs() < 1e-6 && short.values[1] < 1e-3, "the nearest one: {short:?}");
    let sd = base.combinations[1].sd.unwrap();
    let nearly = nearest(&base, &Positive { most: (-base.combinations[1].value - sd) / 2.0 }).unwrap();
    assert_eq!(nearly.membership, Membership::WithinUncertainty, "{nearly:?}");
}

proptest! {
    /// What the combinations predict is what all parameters predict.
    #[test]
    fn combinations_predict_what_all_columns_do(
        numbers in prop::collection::vec(-2.0..2.0f64, 60),
        mixed in prop::collection::vec(-3.0..3.0f64, 9),
        x in prop::collection::vec(-5.0..5.0f64, 7),
        lead in 0..3usize,
    ) {
        let free = DMatrix::from_column_slice(20, 3, &numbers);
        let dependent = &free * DMatrix::from_column_slice(3, 3, &mixed);
        let columns = DMatrix::from_fn(20, 7, |i, k| match k {
            0..3 => free[(i, k)],
            3..6 => dependent[(i, k - 3)],
            _ => 0.0,
        });
        let groups = [[0, 0, 0, 1, 1, 1, 0], [1, 1, 1, 0, 0, 0, 0], [0; 7]][lead];
        let found = regroup(&columns, &groups);
        prop_assert_eq!(&found.without_effect, &[6]);
        prop_assert_eq!(found.base.len() + found.dependent.len(), 6);
        let x = DVector::from_vec(x);
        let all = &columns * &x;
        let combined = columns.select_columns(&found.base) * (found.map(7) * &x);
        prop_assert!((&all - combined).norm() <= 1e-4 * (1.0 + all.norm()));
        if lead == 0 {
            prop_assert!(found.base.iter().all(|&k| k < 3), "the first group leads: {:?}", found.base);
        }
    }
}
