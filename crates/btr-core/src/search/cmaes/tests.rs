//! Planted optima.
#![allow(clippy::unwrap_used)]

use super::*;
use crate::random::stream;

/// Evaluations until the cost falls to `target`; `None` when `budget` does not suffice.
fn evaluations(
    search: &mut CmaEs,
    draw: u64,
    cost: impl Fn(&[f64]) -> f64,
    target: f64,
    budget: usize,
) -> Option<usize> {
    let mut spent = 0;
    let mut generation = 0;
    while spent < budget {
        let population = search.ask(&mut stream(draw, &[generation]));
        let costs: Vec<f64> = population.iter().map(|p| cost(p)).collect();
        search.tell(&population, &costs);
        spent += costs.len();
        generation += 1;
        if search.best().is_some_and(|(_, best)| best <= target) {
            return Some(spent);
        }
    }
    None
}

fn start(seed: &[f64]) -> CmaEs {
    CmaEs::new(CmaEsSettings::default(), seed.len(), Some(seed))
}

/// Five searches from one seed, each with random numbers of its own, all have to reach the target within the budget.
fn all_reach(target: f64, budget: usize, seed: &[f64], cost: impl Fn(&[f64]) -> f64) {
    let spent: Vec<_> = (0..5).map(|draw| evaluations(&mut start(seed), draw, &cost, target, budget)).collect();
    println!("{spent:?} evaluations of {budget}");
    assert!(spent.iter().all(Option::is_some), "{spent:?} of {budget}");
}

fn sphere(p: &[f64], centre: f64) -> f64 {
    p.iter().map(|x| (x - centre).powi(2)).sum()
}

/// A fixed rotation by 45 degrees in the planes (0, 1), (1, 2), ...
fn rotate(p: &[f64]) -> Vec<f64> {
    let mut p = p.to_vec();
    for i in 1..p.len() {
        let (a, b) = (p[i - 1], p[i]);
        (p[i - 1], p[i]) = ((a - b) * 0.5f64.sqrt(), (a + b) * 0.5f64.sqrt());
    }
    p
}

/// Axes from 1 to 1e-3 long, rotated: condition 1e6.
fn ellipsoid(p: &[f64]) -> f64 {
    let last = (p.len() - 1) as f64;
    rotate(p).iter().enumerate().map(|(i, x)| 1e6f64.powf(i as f64 / last) * x * x).sum()
}

#[test]
fn sphere_in_ten_dimensions() {
    all_reach(1e-14, 3000, &[0.9; 10], |p| sphere(p, 0.3));
}

#[test]
fn rosenbrock_in_eight_dimensions() {
    // Rosenbrock's valley on [-2, 2], optimum at 1. A run may end in the local optimum near -1 and start again.
    all_reach(1e-10, 6000, &[0.4; 8], |p| {
        let x: Vec<f64> = p.iter().map(|u| 4.0 * u - 2.0).collect();
        x.windows(2).map(|w| 100.0 * (w[1] - w[0] * w[0]).powi(2) + (1.0 - w[0]).powi(2)).sum()
    });
}

#[test]
fn rotated_ellipsoid_of_condition_a_million() {
    all_reach(1e-10, 6000, &[0.8; 10], |p| ellipsoid(&p.iter().map(|x| x - 0.4).collect::<Vec<_>>()));
}

#[test]
fn optimum_in_a_corner() {
    // The free optimum lies outside; the cost at the corner (1, ..., 1) is 6·0.2².
    all_reach(1e-10, 3000, &[0.5; 6], |p| sphere(p, 1.2) - 0.24);
}

#[test]
fn optimum_on_a_face() {
    // Axes of 1, 1/2, ... 1/32 in directions across the face: the bounded parameter is correlated with the others.
    let cost = |p: &[f64]| {
        let inside: Vec<f64> = p.iter().map(|x| x - 0.4).collect();
        let valley: f64 = rotate(&inside).iter().enumerate().map(|(i, x)| 4f64.powi(i as i32) * x * x).sum();
        valley + 40.0 * p[0]
    };
    // The best of the face itself, found by a search in which the first parameter is not there.
    let mut on_face = start(&[0.5; 5]);
    let with_zero = |p: &[f64]| cost(&[&[0.0], p].concat());
    evaluations(&mut on_face, 0, with_zero, f64::NEG_INFINITY, 4000);
    let (point, best) = on_face.best().unwrap();
    assert!(point.iter().all(|x| (0.01..0.99).contains(x)), "{point:?} should lie inside the face");
    all_reach(best + 1e-10, 4000, &[0.7; 6], cost);
}

#[test]
fn failures_on_half_of_the_cube() {
    all_reach(1e-10, 2000, &[0.9; 5], |p| if p[0] + p[1] > 0.9 { f64::INFINITY } else { sphere(p, 0.4) });
}

#[test]
fn restarts_leave_a_local_optimum() {
    // Rastrigin's function in 5-d on [-5, 5] has some 10^5 local optima; 0 is the best.
    let cost = |p: &[f64]| -> f64 {
        let x = p.iter().map(|u| 10.0 * u - 4.3);
        x.map(|x| x * x + 10.0 - 10.0 * (2.0 * std::f64::consts::PI * x).cos()).sum()
    };
    let settings = CmaEsSettings { restarts: 0, ..CmaEsSettings::default() };
    let mut single = CmaEs::new(settings, 5, Some(&[0.95; 5]));
    assert_eq!(evaluations(&mut single, 5, cost, 1e-8, 20_000), None);
    let mut search = start(&[0.95; 5]);
    let spent = evaluations(&mut search, 5, cost, 1e-8, 60_000).unwrap();
    println!("rastrigin 5-d: {spent}, restarts {}", search.restarts());
    assert!(search.restarts() > 0);
}

#[test]
fn everything_failing_is_survived() {
    let mut search = start(&[0.5; 3]);
    assert_eq!(evaluations(&mut search, 5, |_| f64::INFINITY, 0.0, 2000), None);
    assert_eq!(search.best(), None);
    assert!(search.restarts() > 0);
}
