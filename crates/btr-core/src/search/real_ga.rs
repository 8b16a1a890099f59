//! A genetic algorithm on real numbers: simulated binary crossover and Gaussian mutation.
//!
//! Crossover: K. Deb and R. B. Agrawal, "Simulated binary crossover for continuous search space", Complex Systems 9,
//! 1995.

use super::best::Best;
use super::pool::Pool;
use super::{Search, UnitPoint, sample};
use crate::random::{Rng, normal};
use crate::settings;
use rand::RngExt;
use serde::{Deserialize, Serialize};

/// Settings of [`RealGa`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RealGaSettings {
    /// Individuals per generation; 20.
    #[serde(deserialize_with = "settings::at_least_two")]
    pub population: usize,
    /// The probability that a parameter is mutated; 0.2.
    #[serde(deserialize_with = "settings::probability")]
    pub mutation: f64,
    /// Standard deviation of a mutation, as a share of the parameter's range; 0.1.
    #[serde(deserialize_with = "settings::positive")]
    pub sigma: f64,
    /// The probability that a child has two parents; 0.9.
    #[serde(deserialize_with = "settings::probability")]
    pub crossover: f64,
    /// Distribution index of the crossover; 5. Large values keep children close to their parents.
    #[serde(deserialize_with = "settings::positive")]
    pub eta: f64,
    /// Number of best individuals carried over unchanged; 1. At least one individual per generation is new.
    #[serde(deserialize_with = "settings::count")]
    pub elite: usize,
    /// Individuals per tournament that chooses a parent; 2.
    #[serde(deserialize_with = "settings::count")]
    pub tournament: usize,
}

impl Default for RealGaSettings {
    fn default() -> Self {
        RealGaSettings { population: 20, mutation: 0.2, sigma: 0.1, crossover: 0.9, eta: 5.0, elite: 1, tournament: 2 }
    }
}

/// The genetic algorithm on real numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RealGa {
    settings: RealGaSettings,
    dims: usize,
    seed: Option<UnitPoint>,
    pool: Pool<UnitPoint>,
    best: Best,
}

impl RealGa {
    /// A search whose first population is the seed and mutants of it, or random without a seed.
    pub fn new(settings: RealGaSettings, dims: usize, seed: Option<&[f64]>) -> Self {
        let seed = seed.map(|point| sample::on_cube(dims, point));
        RealGa { settings, dims, seed, pool: Pool::default(), best: Best::default() }
    }

    /// Whether this can be the state of a search that began as `fresh`.
    pub(super) fn continues(&self, fresh: &Self) -> bool {
        let is_point = |point: &UnitPoint| sample::is_on_cube(self.dims, point);
        (self.dims, &self.settings) == (fresh.dims, &fresh.settings)
            && self.seed.as_ref().is_none_or(is_point)
            && self.pool.all(is_point)
            && self.best.is_of(self.dims)
    }

    fn first(&self, rng: &mut Rng) -> Vec<UnitPoint> {
        let size = self.settings.population.max(2);
        match &self.seed {
            Some(seed) => {
                let mutants = (1..size).map(|_| self.mutate(seed.clone(), rng));
                std::iter::once(seed.clone()).chain(mutants).collect()
            }
            None => (0..size).map(|_| sample::uniform(self.dims, rng)).collect(),
        }
    }

    fn next(&self, rng: &mut Rng) -> Vec<UnitPoint> {
        let size = self.settings.population.max(2);
        let mut points: Vec<UnitPoint> = self.pool.elite(self.settings.elite.min(size - 1)).cloned().collect();
        while points.len() < size {
            let mut child = self.pool.tournament(self.settings.tournament, rng).clone();
            if rng.random::<f64>() < self.settings.crossover {
                cross(&mut child, self.pool.tournament(self.settings.tournament, rng), self.settings.eta, rng);
            }
            points.push(self.mutate(child, rng));
        }
        points
    }

    /// Steps beyond a bound end on it, so that an optimum on the bound can be met exactly.
    fn mutate(&self, mut point: UnitPoint, rng: &mut Rng) -> UnitPoint {
        for x in &mut point {
            if rng.random::<f64>() < self.settings.mutation {
                *x = (*x + self.settings.sigma * normal(rng)).clamp(0.0, 1.0);
            }
        }
        point
    }
}

impl Search for RealGa {
    fn ask(&mut self, rng: &mut Rng) -> Vec<UnitPoint> {
        if self.pool.is_empty() { self.first(rng) } else { self.next(rng) }
    }

    fn tell(&mut self, population: &[UnitPoint], costs: &[f64]) {
        self.best.see(population, costs);
        let evaluated = population.iter().cloned().zip(costs.iter().copied());
        // The best stays in the pool even when `elite` is 0.
        self.pool.succeed(evaluated, self.settings.elite.max(1), self.settings.population.max(2));
    }

    fn best(&self) -> Option<(&[f64], f64)> {
        self.best.get()
    }
}

/// Simulated binary crossover in every parameter, of which one of the two children (drawn by lot) is kept.
fn cross(child: &mut UnitPoint, other: &UnitPoint, eta: f64, rng: &mut Rng) {
    for (a, &b) in child.iter_mut().zip(other) {
        let u: f64 = rng.random();
        let spread = if u < 0.5 { 2.0 * u } else { 0.5 / (1.0 - u) }.powf(1.0 / (eta + 1.0));
        let side = if rng.random() { 1.0 } else { -1.0 };
        *a = (0.5 * (*a + b) + side * 0.5 * spread * (*a - b)).clamp(0.0, 1.0);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::random::stream;

    #[test]
    fn children_keep_the_parents_mean() {
        let mut rng = stream(1, &[]);
        let mut child = vec![0.45; 20_000];
        cross(&mut child, &vec![0.55; 20_000], 5.0, &mut rng);
        let mean = child.iter().sum::<f64>() / 20_000.0;
        // Each value has a standard deviation of about 0.05: 0.0004 for their mean.
        assert!((mean - 0.5).abs() < 2e-3, "{mean}");
    }

    #[test]
    fn finds_a_sphere_on_the_bound() {
        let settings = RealGaSettings { population: 30, ..RealGaSettings::default() };
        let mut ga = RealGa::new(settings, 5, Some(&[0.9; 5]));
        for generation in 0..100 {
            let population = ga.ask(&mut stream(2, &[generation]));
            let costs: Vec<f64> = population.iter().map(|p| p.iter().map(|x| x * x).sum()).collect();
            ga.tell(&population, &costs);
        }
        assert!(ga.best().unwrap().1 < 1e-4, "{:?}", ga.best());
    }
}
