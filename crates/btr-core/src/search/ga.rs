//! The paper's genetic algorithm: parameters as Gray-coded bits, mutated bit by bit.
//!
//! Zagal, Delpiano and Ruiz-del-Solar (Robotics and Autonomous Systems 57, 2009) start a population by mutating a seed
//! with probability p_m per bit. They name neither crossover nor selection; here these are one-point crossover on the
//! whole bit string and tournaments, as in D. E. Goldberg, "Genetic algorithms in search, optimization and machine
//! learning", 1989, and the best individuals are carried over.

use super::best::Best;
use super::pool::Pool;
use super::{Search, UnitPoint, gray, sample};
use crate::random::Rng;
use crate::settings;
use rand::RngExt;
use serde::{Deserialize, Serialize};

/// Settings of [`Ga`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GaSettings {
    /// Individuals per generation; 20.
    #[serde(deserialize_with = "settings::at_least_two")]
    pub population: usize,
    /// p_m, the probability that a bit flips; 0.02.
    #[serde(deserialize_with = "settings::probability")]
    pub mutation: f64,
    /// The probability that a child has two parents; 0.7.
    #[serde(deserialize_with = "settings::probability")]
    pub crossover: f64,
    /// Number of best individuals carried over unchanged; 1. At least one individual per generation is new.
    #[serde(deserialize_with = "settings::count")]
    pub elite: usize,
    /// Individuals per tournament that chooses a parent; 2.
    #[serde(deserialize_with = "settings::count")]
    pub tournament: usize,
    /// Bits per parameter; 16, that is steps of 1/65535 of the range.
    #[serde(deserialize_with = "settings::bits")]
    pub bits: u32,
}

impl Default for GaSettings {
    fn default() -> Self {
        GaSettings { population: 20, mutation: 0.02, crossover: 0.7, elite: 1, tournament: 2, bits: 16 }
    }
}

/// One Gray word per parameter.
type Genome = Vec<u32>;

/// The genetic algorithm on bits. Points lie on the grid that the bits can express, the seed included.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ga {
    settings: GaSettings,
    dims: usize,
    seed: Option<Genome>,
    pool: Pool<Genome>,
    best: Best,
}

impl Ga {
    /// A search whose first population is the seed and mutants of it, or random bits without a seed.
    pub fn new(settings: GaSettings, dims: usize, seed: Option<&[f64]>) -> Self {
        let seed = seed.map(|point| encode(&sample::on_cube(dims, point), settings.bits));
        Ga { settings, dims, seed, pool: Pool::default(), best: Best::default() }
    }

    /// Whether this can be the state of a search that began as `fresh`.
    pub(super) fn continues(&self, fresh: &Self) -> bool {
        let is_genome = |genome: &Genome| genome.len() == self.dims;
        (self.dims, &self.settings) == (fresh.dims, &fresh.settings)
            && self.seed.as_ref().is_none_or(is_genome)
            && self.pool.all(is_genome)
            && self.best.is_of(self.dims)
    }

    fn first(&self, rng: &mut Rng) -> Vec<Genome> {
        let GaSettings { mutation, bits, .. } = self.settings;
        let size = self.settings.population.max(2);
        match &self.seed {
            Some(seed) => {
                let mutants = (1..size).map(|_| mutate(seed.clone(), mutation, bits, rng));
                std::iter::once(seed.clone()).chain(mutants).collect()
            }
            // Bits that flip with probability 1/2 are random bits.
            None => (0..size).map(|_| mutate(vec![0; self.dims], 0.5, bits, rng)).collect(),
        }
    }

    fn next(&self, rng: &mut Rng) -> Vec<Genome> {
        let size = self.settings.population.max(2);
        let mut genomes: Vec<Genome> = self.pool.elite(self.settings.elite.min(size - 1)).cloned().collect();
        while genomes.len() < size {
            genomes.push(self.child(rng));
        }
        genomes
    }

    fn child(&self, rng: &mut Rng) -> Genome {
        let GaSettings { mutation, crossover, tournament, bits, .. } = self.settings;
        let mut child = self.pool.tournament(tournament, rng).clone();
        if rng.random::<f64>() < crossover {
            cross(&mut child, self.pool.tournament(tournament, rng), bits, rng);
        }
        mutate(child, mutation, bits, rng)
    }
}

impl Search for Ga {
    fn ask(&mut self, rng: &mut Rng) -> Vec<UnitPoint> {
        let genomes = if self.pool.is_empty() { self.first(rng) } else { self.next(rng) };
        genomes.iter().map(|genome| decode(genome, self.settings.bits)).collect()
    }

    fn tell(&mut self, population: &[UnitPoint], costs: &[f64]) {
        self.best.see(population, costs);
        let evaluated = population.iter().map(|point| encode(point, self.settings.bits)).zip(costs.iter().copied());
        // The best stays in the pool even when `elite` is 0.
        self.pool.succeed(evaluated, self.settings.elite.max(1), self.settings.population.max(2));
    }

    fn best(&self) -> Option<(&[f64], f64)> {
        self.best.get()
    }
}

/// `count` mutants of a seed, each bit flipped with probability `p`: the paper's neighbourhood of a controller, from
/// which the tests of step 2 are topped up (there called p'_m). The seed itself is not among them, unless by chance.
pub fn neighbours(seed: &[f64], count: usize, p: f64, bits: u32, rng: &mut Rng) -> Vec<UnitPoint> {
    let genome = encode(seed, bits);
    (0..count).map(|_| decode(&mutate(genome.clone(), p, bits, rng), bits)).collect()
}

fn encode(point: &[f64], bits: u32) -> Genome {
    point.iter().map(|&u| gray::encode(u, bits)).collect()
}

fn decode(genome: &[u32], bits: u32) -> UnitPoint {
    genome.iter().map(|&word| gray::decode(word, bits)).collect()
}

fn mutate(mut genome: Genome, p: f64, bits: u32, rng: &mut Rng) -> Genome {
    for word in &mut genome {
        for bit in 0..bits.clamp(1, gray::MAX_BITS) {
            if rng.random::<f64>() < p {
                *word ^= 1 << bit;
            }
        }
    }
    genome
}

/// Everything behind a random cut of the bit string, most significant bits first, comes from the other parent.
fn cross(child: &mut Genome, other: &Genome, bits: u32, rng: &mut Rng) {
    if child.is_empty() {
        return;
    }
    let bits = bits.clamp(1, gray::MAX_BITS);
    let word = rng.random_range(0..child.len());
    let low_bits = (1u32 << rng.random_range(0..bits)) - 1;
    child[word] = (child[word] & !low_bits) | (other[word] & low_bits);
    child[word + 1..].copy_from_slice(&other[word + 1..]);
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::random::stream;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn genomes_survive_the_round_trip(genome in prop::collection::vec(0u32..1 << 12, 0..9)) {
            prop_assert_eq!(encode(&decode(&genome, 12), 12), genome);
        }

        #[test]
        fn a_child_has_only_its_parents_bits(a in prop::collection::vec(0u32..256, 1..6), draw: u64) {
            let b: Genome = a.iter().map(|word| !word & 255).collect();
            let mut child = a.clone();
            cross(&mut child, &b, 8, &mut stream(draw, &[]));
            // The bit string reads a..a b..b: exactly one change of parent, or none.
            let from_b = |i: usize| (child[i / 8] ^ a[i / 8]) >> (7 - i % 8) & 1;
            prop_assert!((1..a.len() * 8).all(|i| from_b(i) >= from_b(i - 1)));
        }
    }

    #[test]
    fn the_seed_opens_the_first_population() {
        let settings = GaSettings { mutation: 0.05, ..GaSettings::default() };
        let seed = [0.0, 1.0, 0.25];
        let population = Ga::new(settings, 3, Some(&seed)).ask(&mut stream(1, &[]));
        assert_eq!(population[0], decode(&encode(&seed, 16), 16));
        assert!(population[1..].iter().any(|p| *p != population[0]));
    }

    #[test]
    fn mutation_flips_the_given_share_of_bits() {
        let flips: u32 = neighbours(&[0.3; 10], 100, 0.1, 16, &mut stream(2, &[]))
            .iter()
            .flat_map(|p| encode(p, 16))
            .map(|word| (word ^ gray::encode(0.3, 16)).count_ones())
            .sum();
        // 16000 bits at 0.1: 1600, standard deviation 38.
        assert!((1410..1790).contains(&flips), "{flips}");
    }

    #[test]
    fn counts_ones() {
        let settings = GaSettings { bits: 8, mutation: 0.01, population: 30, ..GaSettings::default() };
        let ones = |p: &UnitPoint| encode(p, 8).iter().map(|word| word.count_ones()).sum::<u32>();
        let mut ga = Ga::new(settings, 8, None);
        for generation in 0..80 {
            let population = ga.ask(&mut stream(3, &[generation]));
            let costs: Vec<f64> = population.iter().map(|p| 64.0 - f64::from(ones(p))).collect();
            ga.tell(&population, &costs);
        }
        // 2400 random strings of 64 bits would reach about 47 ones.
        let cost = ga.best().unwrap().1;
        assert!(cost <= 2.0, "{cost} of 64 bits are still wrong");
    }
}
