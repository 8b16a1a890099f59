//! The searches by name, as experiment files choose them.

use super::cmaes::{CmaEs, CmaEsSettings};
use super::ga::{Ga, GaSettings};
use super::real_ga::{RealGa, RealGaSettings};
use super::{Search, UnitPoint};
use crate::random::Rng;
use serde::{Deserialize, Serialize};

/// Every search: its name in experiment files, and what it is good for.
pub const SEARCHES: &[(&str, &str)] = &[
    ("ga", "genetic algorithm on Gray-coded bits, as in the paper"),
    ("real_ga", "genetic algorithm on real numbers: simulated binary crossover, Gaussian mutation"),
    ("cma_es", "CMA-ES with restarts: the most exact where parameters act jointly and the landscape is smooth"),
];

/// A search and its settings: `{ algorithm = "ga", population = 20, mutation = 0.02 }`. What is left out has the
/// default documented with it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(tag = "algorithm", rename_all = "snake_case")]
pub enum SearchSpec {
    /// The paper's genetic algorithm.
    Ga(GaSettings),
    /// A real-coded genetic algorithm.
    RealGa(RealGaSettings),
    /// CMA-ES.
    CmaEs(CmaEsSettings),
}

impl SearchSpec {
    /// Starts a search in `dims` dimensions. The seed is a point of the unit cube: the genetic algorithms begin with it
    /// and mutants of it, CMA-ES takes it for its first mean. Without a seed the first population is random (CMA-ES:
    /// about the middle of the cube).
    pub fn start(&self, dims: usize, seed: Option<&[f64]>) -> AnySearch {
        match self {
            SearchSpec::Ga(settings) => AnySearch::Ga(Ga::new(settings.clone(), dims, seed)),
            SearchSpec::RealGa(settings) => AnySearch::RealGa(RealGa::new(settings.clone(), dims, seed)),
            SearchSpec::CmaEs(settings) => AnySearch::CmaEs(Box::new(CmaEs::new(settings.clone(), dims, seed))),
        }
    }

    /// Its name in [`SEARCHES`].
    pub fn name(&self) -> &'static str {
        match self {
            SearchSpec::Ga(_) => "ga",
            SearchSpec::RealGa(_) => "real_ga",
            SearchSpec::CmaEs(_) => "cma_es",
        }
    }

    /// Individuals in the first generation. Only the restarts of CMA-ES change the number later.
    pub fn population(&self, dims: usize) -> usize {
        match self {
            SearchSpec::Ga(settings) => settings.population.max(2),
            SearchSpec::RealGa(settings) => settings.population.max(2),
            SearchSpec::CmaEs(settings) => settings.population(dims),
        }
    }
}

/// The state of any of the searches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AnySearch {
    /// See [`Ga`].
    Ga(Ga),
    /// See [`RealGa`].
    RealGa(RealGa),
    /// See [`CmaEs`].
    CmaEs(Box<CmaEs>),
}

impl AnySearch {
    /// Whether this can be the state of a search that `spec` started in `dims` dimensions. One that was read from a
    /// file may be anything.
    pub(crate) fn continues(&self, spec: &SearchSpec, dims: usize) -> bool {
        match (self, spec.start(dims, None)) {
            (AnySearch::Ga(search), AnySearch::Ga(fresh)) => search.continues(&fresh),
            (AnySearch::RealGa(search), AnySearch::RealGa(fresh)) => search.continues(&fresh),
            (AnySearch::CmaEs(search), AnySearch::CmaEs(fresh)) => search.continues(&fresh),
            _ => false,
        }
    }

    fn get(&self) -> &dyn Search {
        match self {
            AnySearch::Ga(search) => search,
            AnySearch::RealGa(search) => search,
            AnySearch::CmaEs(search) => search.as_ref(),
        }
    }

    fn get_mut(&mut self) -> &mut dyn Search {
        match self {
            AnySearch::Ga(search) => search,
            AnySearch::RealGa(search) => search,
            AnySearch::CmaEs(search) => search.as_mut(),
        }
    }
}

impl Search for AnySearch {
    fn ask(&mut self, rng: &mut Rng) -> Vec<UnitPoint> {
        self.get_mut().ask(rng)
    }

    fn tell(&mut self, population: &[UnitPoint], costs: &[f64]) {
        self.get_mut().tell(population, costs);
    }

    fn best(&self) -> Option<(&[f64], f64)> {
        self.get().best()
    }
}
