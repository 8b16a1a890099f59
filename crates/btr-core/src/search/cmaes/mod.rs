//! CMA-ES: a normal distribution that learns the shape of the landscape.
//!
//! The strategy is Hansen's (see `run.rs`), restarted with a doubled population whenever it has converged or stagnates
//! (A. Auger and N. Hansen, "A restart CMA evolution strategy with increasing population size", CEC 2005).
//!
//! It is btr's own because its state must be plain data: a checkpoint after any generation resumes with the same bits.

mod run;
mod stop;
mod weights;

use super::best::Best;
use super::{Search, UnitPoint, sample};
use crate::random::Rng;
use crate::settings;
use run::Distribution;
use serde::{Deserialize, Serialize};
pub use stop::CmaStop;

/// Settings of [`CmaEs`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CmaEsSettings {
    /// Individuals per generation before any restart; 4 + 3·ln(parameters) unless given.
    #[serde(deserialize_with = "settings::maybe_at_least_two")]
    pub population: Option<usize>,
    /// Standard deviation at the start, as a share of each parameter's range; 0.25.
    #[serde(deserialize_with = "settings::positive")]
    pub sigma: f64,
    /// Standard deviation at the start of a search that starts from a seed, near which the optimum is expected; `sigma`
    /// unless given.
    #[serde(deserialize_with = "settings::maybe_positive")]
    pub seeded_sigma: Option<f64>,
    /// Number of restarts from a random point, each with twice the population; 9.
    pub restarts: u32,
}

impl Default for CmaEsSettings {
    fn default() -> Self {
        CmaEsSettings { population: None, sigma: 0.25, seeded_sigma: None, restarts: 9 }
    }
}

impl CmaEsSettings {
    /// Individuals per generation before any restart.
    pub fn population(&self, dims: usize) -> usize {
        // ln 0 would be minus infinity; the cast is of a small positive number.
        let default = || 4 + (3.0 * (dims.max(1) as f64).ln()) as usize;
        self.population.unwrap_or_else(default).max(2)
    }
}

/// CMA-ES with restarts. The first run starts from the seed, later ones from random places; the best point of all is
/// kept. When the restarts are used up the last run still proposes populations, but no longer learns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CmaEs {
    settings: CmaEsSettings,
    dims: usize,
    restarts: u32,
    run: Distribution,
    best: Best,
}

impl CmaEs {
    /// A search around the seed, or around the middle of the cube without one.
    pub fn new(settings: CmaEsSettings, dims: usize, seed: Option<&[f64]>) -> Self {
        let mean = sample::on_cube(dims, seed.unwrap_or(&[]));
        let sigma = seed.and(settings.seeded_sigma).unwrap_or(settings.sigma);
        let run = Distribution::new(mean, sigma, settings.population(dims));
        CmaEs { settings, dims, restarts: 0, run, best: Best::default() }
    }

    /// Number of restarts so far.
    pub fn restarts(&self) -> u32 {
        self.restarts
    }

    /// Why the search no longer learns; `None` while it does, or while a restart is left.
    pub fn ended(&self) -> Option<CmaStop> {
        let restarts_left = self.restarts < self.settings.restarts;
        if self.dims == 0 || restarts_left { None } else { self.run.ended() }
    }

    /// Where the search is on the unit cube: the mean of its distribution, and the standard deviation along each
    /// dimension.
    pub fn distribution(&self) -> (UnitPoint, Vec<f64>) {
        self.run.distribution()
    }

    /// Whether this can be the state of a search that began as `fresh`.
    pub(super) fn continues(&self, fresh: &Self) -> bool {
        (self.dims, &self.settings) == (fresh.dims, &fresh.settings)
            && self.restarts <= self.settings.restarts
            && self.run.is_of(self.dims, self.lambda())
            && self.best.is_of(self.dims)
    }

    /// Individuals per generation since the last restart.
    fn lambda(&self) -> usize {
        // Doubling stops long before a population could not be held in memory.
        self.settings.population(self.dims) << self.restarts.min(16)
    }

    fn restart(&mut self, rng: &mut Rng) {
        self.restarts += 1;
        self.run = Distribution::new(sample::uniform(self.dims, rng), self.settings.sigma, self.lambda());
    }
}

impl Search for CmaEs {
    fn ask(&mut self, rng: &mut Rng) -> Vec<UnitPoint> {
        if self.dims == 0 {
            return vec![Vec::new(); self.settings.population(0)];
        }
        if self.run.ended().is_some() && self.restarts < self.settings.restarts {
            self.restart(rng);
        }
        self.run.ask(rng)
    }

    fn tell(&mut self, population: &[UnitPoint], costs: &[f64]) {
        self.best.see(population, costs);
        if self.dims > 0 && self.run.ended().is_none() {
            self.run.tell(costs);
        }
    }

    fn best(&self) -> Option<(&[f64], f64)> {
        self.best.get()
    }
}

#[cfg(test)]
mod tests;
