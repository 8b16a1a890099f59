//! MAP-Elites: not one best point but the best of each kind.
//!
//! J.-B. Mouret and J. Clune, "Illuminating search spaces by mapping elites", 2015. A point is reported with its cost
//! and its descriptor, which says of what kind it is; a grid over the descriptors keeps the best point in each of its
//! cells. Children are made as in V. Vassiliades and J.-B. Mouret, "Discovering the elite hypervolume by leveraging
//! interspecies correlation", GECCO 2018: a small step in all directions, and one along the line to another elite.

use super::{UnitPoint, sample};
use crate::random::{Rng, normal};
use rand::RngExt;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The best point of its kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Elite {
    /// The point of the unit cube.
    pub unit: UnitPoint,
    /// Its cost; finite.
    pub cost: f64,
    /// Of what kind it is, in [0, 1] per axis.
    pub descriptor: Vec<f64>,
}

/// A grid over [0, 1] per axis, with the same number of cells along each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Grid {
    axes: usize,
    cells: usize,
}

impl Grid {
    /// At least one cell per axis; `None` where cells are more than can be counted.
    pub fn new(axes: usize, cells: usize) -> Option<Self> {
        let cells = cells.max(1);
        (cells as u64).checked_pow(u32::try_from(axes).ok()?).map(|_| Grid { axes, cells })
    }

    /// How many cells there are.
    pub fn count(&self) -> u64 {
        (self.cells as u64).pow(self.axes as u32)
    }

    /// The number of the cell in which a descriptor lies: its place along the first axis counts most. The upper edge of
    /// the grid belongs to the last cells.
    pub fn cell(&self, descriptor: &[f64]) -> u64 {
        let place = |x: &f64| ((x.clamp(0.0, 1.0) * self.cells as f64) as usize).min(self.cells - 1) as u64;
        descriptor.iter().take(self.axes).fold(0, |cell, x| cell * self.cells as u64 + place(x))
    }
}

/// How children differ from their parents.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Variation {
    /// Standard deviation of the step in every dimension.
    pub step: f64,
    /// Standard deviation of the step along the line to another elite, as a share of the distance to it.
    pub line: f64,
}

/// The search. Its ask-and-tell interface is that of [`Search`](super::Search), but takes descriptors as well.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapElites {
    dims: usize,
    population: usize,
    variation: Variation,
    grid: Grid,
    elites: BTreeMap<u64, Elite>,
}

impl MapElites {
    /// An empty map of points in `dims` dimensions.
    pub fn new(dims: usize, grid: Grid, population: usize, variation: Variation) -> Self {
        MapElites { dims, population: population.max(1), variation, grid, elites: BTreeMap::new() }
    }

    /// Whether this can be the state of a map that began as `fresh`.
    pub(crate) fn continues(&self, fresh: &Self) -> bool {
        let fits = |(cell, elite): (&u64, &Elite)| {
            sample::is_on_cube(self.dims, &elite.unit)
                && elite.cost.is_finite()
                && sample::is_on_cube(self.grid.axes, &elite.descriptor)
                && self.grid.cell(&elite.descriptor) == *cell
        };
        (self.dims, self.population, self.variation, self.grid)
            == (fresh.dims, fresh.population, fresh.variation, fresh.grid)
            && self.elites.iter().all(fits)
    }

    /// The next population to evaluate: children of elites, or random points while there are none. `rng` belongs
    /// to this generation.
    pub fn ask(&self, rng: &mut Rng) -> Vec<UnitPoint> {
        let elites: Vec<&Elite> = self.elites.values().collect();
        let one = |_| match elites.as_slice() {
            [] => sample::uniform(self.dims, rng),
            elites => {
                let mut parent = || &elites[rng.random_range(0..elites.len())].unit;
                let (parent, other) = (parent(), parent());
                self.child(parent, other, rng)
            }
        };
        (0..self.population).map(one).collect()
    }

    /// A step in all directions and one along the line to the other parent. Steps beyond a bound end on it.
    fn child(&self, parent: &[f64], other: &[f64], rng: &mut Rng) -> UnitPoint {
        let along = self.variation.line * normal(rng);
        let one = |(x, y): (&f64, &f64)| (x + along * (y - x) + self.variation.step * normal(rng)).clamp(0.0, 1.0);
        parent.iter().zip(other).map(one).collect()
    }

    /// Reports costs, and descriptors in [0, 1] per axis; values outside are clamped. A point
    /// takes its cell where that is empty or costs more. Failures (infinite or NaN, in either) do not count.
    pub fn tell(&mut self, population: &[UnitPoint], costs: &[f64], descriptors: &[Vec<f64>]) {
        for ((unit, &cost), descriptor) in population.iter().zip(costs).zip(descriptors) {
            let whole = descriptor.len() == self.grid.axes && descriptor.iter().all(|x| x.is_finite());
            if !(whole && cost.is_finite()) {
                continue;
            }
            let descriptor: Vec<f64> = descriptor.iter().map(|x| x.clamp(0.0, 1.0)).collect();
            let cell = self.grid.cell(&descriptor);
            if self.elites.get(&cell).is_none_or(|elite| cost < elite.cost) {
                self.elites.insert(cell, Elite { unit: unit.clone(), cost, descriptor });
            }
        }
    }

    /// The grid.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// The elites with the numbers of their cells, in the order of these.
    pub fn elites(&self) -> impl ExactSizeIterator<Item = (u64, &Elite)> {
        self.elites.iter().map(|(cell, elite)| (*cell, elite))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::random::stream;
    use proptest::prelude::*;

    fn empty(dims: usize, axes: usize, cells: usize) -> MapElites {
        MapElites::new(dims, Grid::new(axes, cells).unwrap(), 30, Variation { step: 0.05, line: 0.2 })
    }

    /// A cost and a descriptor that may lie outside, with failures in either.
    fn judged(point: &[f64], axes: usize) -> (f64, Vec<f64>) {
        let lot = (point.iter().sum::<f64>() * 7919.0).fract();
        let cost = if lot < 0.1 { f64::INFINITY } else { point.iter().map(|x| (x - 0.3).powi(2)).sum() };
        let first = if lot > 0.9 { f64::NAN } else { 1.4 * point[0] - 0.2 };
        (cost, std::iter::once(first).chain(point[1..axes].iter().copied()).collect())
    }

    fn generation(map: &mut MapElites, draw: u64, generation: u64) -> Vec<UnitPoint> {
        let population = map.ask(&mut stream(draw, &[generation]));
        let (costs, descriptors): (Vec<f64>, Vec<Vec<f64>>) =
            population.iter().map(|point| judged(point, map.grid.axes)).unzip();
        map.tell(&population, &costs, &descriptors);
        population
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn elites_lie_in_their_cells_and_cells_only_improve(draw: u64, axes in 1usize..4, cells in 1usize..9) {
            let mut map = empty(4, axes, cells);
            for g in 0..20 {
                let before = map.clone();
                let population = generation(&mut map, draw, g);
                prop_assert!(population.iter().flatten().all(|x| (0.0..=1.0).contains(x)));
                for (cell, elite) in before.elites() {
                    prop_assert!(map.elites[&cell].cost <= elite.cost);
                }
                for (cell, elite) in map.elites() {
                    prop_assert_eq!(map.grid.cell(&elite.descriptor), cell);
                    prop_assert!(cell < map.grid.count());
                    let (cost, descriptor) = judged(&elite.unit, axes);
                    prop_assert_eq!(cost.to_bits(), elite.cost.to_bits());
                    let kept = descriptor.iter().zip(&elite.descriptor);
                    prop_assert!(kept.into_iter().all(|(x, kept)| x.clamp(0.0, 1.0).to_bits() == kept.to_bits()));
                }
            }
        }

        #[test]
        fn nothing_reported_is_better_than_the_elite_of_its_cell(draw: u64) {
            let mut map = empty(3, 2, 4);
            let mut reported = Vec::new();
            for g in 0..10 {
                reported.extend(generation(&mut map, draw, g));
            }
            for point in reported {
                let (cost, descriptor) = judged(&point, 2);
                if cost.is_finite() && descriptor.iter().all(|x| x.is_finite()) {
                    prop_assert!(map.elites[&map.grid.cell(&descriptor)].cost <= cost);
                }
            }
        }

        #[test]
        fn a_saved_map_goes_on_bit_by_bit(draw: u64, saved in 0u64..8) {
            let mut map = empty(4, 2, 5);
            for g in 0..saved {
                generation(&mut map, draw, g);
            }
            let mut back: MapElites = postcard::from_bytes(&postcard::to_allocvec(&map).unwrap()).unwrap();
            for g in saved..saved + 8 {
                prop_assert_eq!(generation(&mut map, draw, g), generation(&mut back, draw, g));
            }
            prop_assert_eq!(back, map);
        }
    }

    #[test]
    fn a_map_fills_and_finds_the_best_of_each_kind() {
        let mut map = empty(3, 2, 5);
        for g in 0..1000 {
            generation(&mut map, 1, g);
        }
        assert_eq!(map.elites().len() as u64, map.grid().count());
        // The descriptor leaves the third coordinate open, which is best at 0.3 in every cell.
        for (_, elite) in map.elites() {
            assert!((elite.unit[2] - 0.3).abs() < 0.1, "{elite:?}");
        }
    }

    #[test]
    fn a_grid_that_cannot_be_counted_is_none() {
        assert_eq!(Grid::new(3, 4).unwrap().count(), 64);
        assert!(Grid::new(64, 2).is_none() && Grid::new(63, 2).is_some());
    }
}
