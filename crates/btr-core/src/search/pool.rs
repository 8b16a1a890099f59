//! Parents: who survives a generation, and who gets to breed. Shared by the genetic algorithms.

use crate::random::Rng;
use rand::RngExt;
use serde::{Deserialize, Serialize};

/// Individuals that succeeded, with their costs, best first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Pool<G>(Vec<(G, f64)>);

impl<G> Default for Pool<G> {
    fn default() -> Self {
        Pool(Vec::new())
    }
}

impl<G: Clone + PartialEq> Pool<G> {
    /// Replaces the pool by an evaluated generation, except that the `elite` best of the old pool stay with their cost.
    /// A good individual is therefore not lost when it is not proposed again, or fails when it is. Failures (infinite
    /// or NaN cost) are dropped; when everything failed the old pool stays whole.
    pub(crate) fn succeed(&mut self, evaluated: impl Iterator<Item = (G, f64)>, elite: usize, size: usize) {
        let mut next: Vec<(G, f64)> = evaluated.filter(|(_, cost)| cost.is_finite()).collect();
        if next.is_empty() {
            return;
        }
        for (genome, cost) in self.0.drain(..).take(elite) {
            match next.iter_mut().find(|(known, _)| *known == genome) {
                Some((_, known)) => *known = known.min(cost),
                None => next.push((genome, cost)),
            }
        }
        next.sort_by(|a, b| a.1.total_cmp(&b.1));
        next.truncate(size);
        self.0 = next;
    }

    /// Whether all individuals are as they have to be.
    pub(crate) fn all(&self, fits: impl Fn(&G) -> bool) -> bool {
        self.0.iter().all(|(genome, cost)| fits(genome) && cost.is_finite())
    }

    /// True before any evaluation has succeeded.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The best individuals, at most `count`.
    pub(crate) fn elite(&self, count: usize) -> impl Iterator<Item = &G> {
        self.0.iter().take(count).map(|(genome, _)| genome)
    }

    /// The best of `entrants` individuals drawn with replacement (at least one). The pool must not be empty.
    pub(crate) fn tournament(&self, entrants: usize, rng: &mut Rng) -> &G {
        let winner = (0..entrants.max(1)).map(|_| rng.random_range(0..self.0.len())).min().unwrap_or(0);
        &self.0[winner].0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_lowest_cost_never_rises(
            generations in prop::collection::vec(prop::collection::vec((0u8..6, prop_oneof![
                Just(f64::INFINITY), Just(f64::NAN), -1.0..1.0f64
            ]), 1..6), 1..10)
        ) {
            let mut pool = Pool::default();
            let mut lowest = f64::INFINITY;
            for generation in generations {
                pool.succeed(generation.iter().copied(), 1, 4);
                if let Some((_, cost)) = pool.0.first() {
                    prop_assert!(*cost <= lowest);
                    lowest = *cost;
                }
            }
        }
    }

    #[test]
    fn tournaments_prefer_the_better_with_the_expected_odds() {
        let mut pool = Pool::default();
        pool.succeed([("bad", 2.0), ("good", 1.0)].into_iter(), 0, 2);
        let mut rng = stream(1, &[]);
        let wins = (0..4000).filter(|_| *pool.tournament(2, &mut rng) == "good").count();
        // 3/4 of 4000, standard deviation 27.
        assert!((2860..3140).contains(&wins), "{wins}");
    }
}
