//! Least squares within bounds, for distances that are sums of squares.
//!
//! Levenberg and Marquardt's method uses every sample with its sign, where a search with one cost per point uses their
//! sum only; it needs a hundredth of the evaluations to separate parameters that act alike. Two things carry it over a
//! rough landscape, such as that of a walk, whose touchdowns jump by a whole time step. Differences are taken over a
//! wide reach at first, which shrinks with the steps. And samples far off the usual error of their channel count less
//! (Cauchy's weights): they have just jumped, and say nothing about the slope. The caller judges the points by the
//! distance itself.

use super::damped::QuadraticModel;
use crate::random::Rng;
use crate::search::{UnitPoint, is_on_cube};
use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use serde::{Deserialize, Serialize};

/// Errors of one point, in blocks that share a scale (one channel each). Not a number: no error known.
pub type Residuals = Vec<Vec<f64>>;

/// Half the width of the first differences, and the least it shrinks to; of the unit cube.
const REACH: [f64; 2] = [0.05, 0.0005];
/// The longest step in any parameter.
const STRIDE: f64 = 0.3;
/// How far a new start lies from the best point, at least and at most.
const DISTURBANCE: [f64; 2] = [0.005, 0.15];
/// The first damping, relative to the diagonal, and its limits.
const DAMPING: [f64; 3] = [1e-3, 1e-9, 1e3];
/// What is tried in each turn: a factor of the damping, and one of the step it gives.
const TRIES: [(f64, f64); 4] = [(0.1, 2.0), (0.1, 1.0), (0.1, 0.4), (10.0, 1.0)];
/// A fall of the cost by a smaller share is no progress; under noise, the last percents of the parameters are worth
/// less than a thousandth of it.
const PROGRESS: f64 = 1e-7;
/// No block counts for more than if its usual error were this share of the largest block's.
const LEAST_SCALE: f64 = 0.01;
/// An error so many times the median of its block has half the weight.
const HALF_WEIGHT: f64 = 2.0;

/// State of the method. One turn is: evaluate [`probes`](Self::probes), [`linearise`](Self::linearise), evaluate
/// [`tries`](Self::tries), [`settle`](Self::settle).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LeastSquares {
    here: UnitPoint,
    reach: f64,
    damping: f64,
    done: bool,
}

/// The residuals around a point, as a weighted linear function of the parameters.
pub struct Linear {
    weights: Vec<Vec<f64>>,
    cost: f64,
    normal: QuadraticModel,
    /// Zero for what is held at a bound.
    held: Vec<Option<f64>>,
}

impl LeastSquares {
    /// Starts at a point of the unit cube.
    pub fn new(start: UnitPoint) -> Self {
        LeastSquares { here: start, reach: REACH[0], damping: DAMPING[0], done: false }
    }

    /// Starts anew near a point, at a distance of any order of magnitude: the way out of a local minimum, be it wide or
    /// narrow.
    pub fn near(point: &[f64], rng: &mut Rng) -> Self {
        let [least, most] = DISTURBANCE;
        let by = least * (most / least).powf(rng.random::<f64>());
        let disturbed = |x: &f64| (x + by * (2.0 * rng.random::<f64>() - 1.0)).clamp(0.0, 1.0);
        let here = point.iter().map(disturbed).collect();
        LeastSquares { reach: (by / 3.0).clamp(REACH[1], REACH[0]), ..LeastSquares::new(here) }
    }

    /// Whether it can be at work in `dims` dimensions.
    pub(crate) fn is_of(&self, dims: usize) -> bool {
        let ([widest, least], [_, lowest, highest]) = (REACH, DAMPING);
        is_on_cube(dims, &self.here)
            && (least..=widest).contains(&self.reach)
            && (lowest..=highest).contains(&self.damping)
    }

    /// Whether no further turn makes progress.
    pub fn done(&self) -> bool {
        self.done
    }

    /// This point, then for every parameter one to its right and one to its left.
    pub fn probes(&self) -> Vec<UnitPoint> {
        let moved = |k: usize, by: f64| {
            let mut point = self.here.clone();
            point[k] = (point[k] + by).clamp(0.0, 1.0);
            point
        };
        let sides = (0..self.here.len()).flat_map(|k| [moved(k, self.reach), moved(k, -self.reach)]);
        std::iter::once(self.here.clone()).chain(sides).collect()
    }

    /// Linearises the residuals about this point; `None` where the point itself could not be evaluated. A parameter
    /// with no valid probe on either side is held.
    pub fn linearise(&mut self, probes: &[UnitPoint], residuals: &[Option<Residuals>]) -> Option<Linear> {
        let Some(here) = residuals.first().and_then(Option::as_ref) else {
            self.done = true;
            return None;
        };
        let side = |i: usize| residuals[i].as_ref().map_or((0, here), |r| (i, r));
        let sides: Vec<_> = (0..self.here.len())
            .map(|k| {
                let ((right, above), (left, below)) = (side(2 * k + 1), side(2 * k + 2));
                Sides { above, below, up: probes[right][k] - self.here[k], down: self.here[k] - probes[left][k] }
            })
            .collect();
        let columns: Vec<Option<Vec<f64>>> = sides.iter().map(Sides::slopes).collect();
        let weights = weights(here, &bends(here, &sides));
        let flat_weights = weights.concat();
        let errors = here.concat();
        let dot = |a: &[f64], b: &[f64]| -> f64 {
            a.iter().zip(b).zip(&flat_weights).map(|((a, b), w)| known(a * b) * w).sum()
        };
        let gradient = DVector::from_fn(columns.len(), |i, _| columns[i].as_ref().map_or(0.0, |a| dot(a, &errors)));
        // What would leave the cube is held, or the step of the others would count on it.
        let held = |k: usize| (self.here[k] >= 1.0 && gradient[k] < 0.0) || (self.here[k] <= 0.0 && gradient[k] > 0.0);
        let held = (0..columns.len()).map(|k| held(k).then_some(0.0)).collect();
        let curvature = DMatrix::from_fn(columns.len(), columns.len(), |i, j| match (&columns[i], &columns[j]) {
            (Some(a), Some(b)) => dot(a, b),
            _ => 0.0,
        });
        Some(Linear { cost: cost(here, &weights), weights, normal: QuadraticModel { curvature, gradient }, held })
    }

    /// Steps of several lengths and directions between the gradient's and Gauss and Newton's.
    pub fn tries(&self, linear: &Linear) -> Vec<UnitPoint> {
        let reached = |(factor, length): &(f64, f64)| {
            let step = linear.step(self.damping * factor);
            let moved = |(x, d): (&f64, &f64)| (x + (length * d).clamp(-STRIDE, STRIDE)).clamp(0.0, 1.0);
            self.here.iter().zip(step.iter()).map(moved).collect()
        };
        TRIES.iter().map(reached).collect()
    }

    /// Moves to the best of the tried points, or shrinks the reach where none is better, or ends.
    pub fn settle(&mut self, linear: &Linear, tries: &[UnitPoint], residuals: &[Option<Residuals>]) {
        let costs = residuals.iter().map(|r| r.as_ref().map_or(f64::INFINITY, |r| cost(r, &linear.weights)));
        let best = costs.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        let [widest, least] = REACH;
        match best {
            Some((i, cost)) if cost < linear.cost * (1.0 - PROGRESS) => {
                let [_, lowest, highest] = DAMPING;
                let longest = tries[i].iter().zip(&self.here).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                self.reach = (longest / 2.0).clamp(least, self.reach.min(widest));
                self.damping = (self.damping * TRIES[i].0).clamp(lowest, highest);
                self.here.clone_from(&tries[i]);
            }
            _ if self.reach > least => {
                self.reach = (self.reach / 5.0).max(least);
                self.damping = DAMPING[0];
            }
            _ => self.done = true,
        }
    }
}

impl Linear {
    /// The step with this damping; none where the numbers allow for none.
    fn step(&self, damping: f64) -> DVector<f64> {
        self.normal.step(damping, &self.held).unwrap_or_else(|| DVector::zeros(self.held.len()))
    }
}

/// The residuals on both sides of a point in one parameter, and how far away they are; a side that is missing is the
/// point itself.
struct Sides<'a> {
    above: &'a Residuals,
    below: &'a Residuals,
    up: f64,
    down: f64,
}

impl Sides<'_> {
    fn slopes(&self) -> Option<Vec<f64>> {
        let width = self.up + self.down;
        let pairs = self.above.iter().flatten().zip(self.below.iter().flatten());
        (width > 0.0).then(|| pairs.map(|(above, below)| (above - below) / width).collect())
    }
}

/// How far each sample's errors are from a straight line through the probes, for the worst parameter.
fn bends(here: &Residuals, sides: &[Sides]) -> Residuals {
    let mut bends: Residuals = here.iter().map(|block| vec![0.0; block.len()]).collect();
    for side in sides.iter().filter(|side| side.up > 0.0 && side.down > 0.0) {
        let (up, down) = (side.up / (side.up + side.down), side.down / (side.up + side.down));
        for (b, block) in bends.iter_mut().enumerate() {
            for (i, bend) in block.iter_mut().enumerate() {
                let straight = side.above[b][i] * down + side.below[b][i] * up;
                // `max` passes over what is not known.
                *bend = bend.max(2.0 * (straight - here[b][i]).abs());
            }
        }
    }
    bends
}

/// Cauchy's weights: each block by its own median error, samples with errors or bends far above that by less.
fn weights(residuals: &Residuals, bends: &Residuals) -> Vec<Vec<f64>> {
    let usual: Vec<f64> = residuals.iter().map(|block| median_size(block)).collect();
    let largest = usual.iter().copied().fold(0.0, f64::max);
    // A block that fits exactly is not infinitely important; nor is any where all are exact.
    let floor = if largest > 0.0 { largest * LEAST_SCALE } else { 1.0 };
    let weigh = |((block, bends), usual): ((&Vec<f64>, &Vec<f64>), &f64)| {
        let usual = usual.max(floor);
        let far = |x: &f64| 1.0 + (known(*x) / (HALF_WEIGHT * usual)).powi(2);
        // A jump in a difference looks like a steep slope. It has to weigh less than the slope's square gains.
        block.iter().zip(bends).map(|(r, bend)| (usual.powi(2) * far(r) * far(bend).powi(2)).recip()).collect()
    };
    residuals.iter().zip(bends).zip(&usual).map(weigh).collect()
}

fn median_size(block: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = block.iter().filter(|r| r.is_finite()).map(|r| r.abs()).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let middle = sizes.len() / 2;
    *sizes.select_nth_unstable_by(middle, f64::total_cmp).1
}

fn cost(residuals: &Residuals, weights: &[Vec<f64>]) -> f64 {
    let squares = |(r, w): (&Vec<f64>, &Vec<f64>)| -> f64 { r.iter().zip(w).map(|(r, w)| known(r * r) * w).sum() };
    residuals.iter().zip(weights).map(squares).sum()
}

/// Where there is no error known, there is none to lessen.
fn known(x: f64) -> f64 {
    if x.is_nan() { 0.0 } else { x }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::random;

    fn solve(start: &[f64], turns: usize, f: impl Fn(&[f64]) -> Option<Residuals>) -> LeastSquares {
        let mut search = LeastSquares::new(start.to_vec());
        for _ in 0..turns {
            let probes = search.probes();
            assert!(probes.iter().flatten().all(|x| (0.0..=1.0).contains(x)));
            let residuals: Vec<_> = probes.iter().map(|p| f(p)).collect();
            let Some(linear) = search.linearise(&probes, &residuals) else { break };
            let tries = search.tries(&linear);
            assert!(tries.iter().flatten().all(|x| (0.0..=1.0).contains(x)));
            let residuals: Vec<_> = tries.iter().map(|p| f(p)).collect();
            search.settle(&linear, &tries, &residuals);
            if search.done() {
                break;
            }
        }
        search
    }

    /// Two parameters that act nearly alike on sixty samples of two very different channels.
    fn alike(x: &[f64], truth: [f64; 2]) -> Residuals {
        let (a, b) = (x[0] - truth[0], x[1] - truth[1]);
        let t = |i: usize| i as f64 / 60.0;
        vec![
            (0..60).map(|i| (a + 0.95 * b) * (9.0 * t(i)).sin() + a * a * t(i)).collect(),
            (0..60).map(|i| 1e-3 * (b * t(i) + 0.1 * a)).collect(),
        ]
    }

    fn near(search: &LeastSquares, truth: [f64; 2], tolerance: f64) -> bool {
        search.here.iter().zip(truth).all(|(x, t)| (x - t).abs() < tolerance)
    }

    #[test]
    fn parameters_that_act_alike_are_told_apart() {
        let truth = [0.31, 0.77];
        let found = solve(&[0.9, 0.1], 30, |x| Some(alike(x, truth)));
        assert!(near(&found, truth, 1e-6), "{found:?}");
    }

    #[test]
    fn samples_that_jump_do_not_mislead() {
        let truth = [0.31, 0.77];
        // One sample in ten jumps by a hundred times what any parameter does, on a grid of the parameters.
        let jumpy = |x: &[f64]| {
            let mut errors = alike(x, truth);
            for (i, e) in errors.iter_mut().flatten().enumerate().filter(|(i, _)| i % 10 == 3) {
                let cell = (50.0 * (x[0] + 2.0 * x[1])).floor() + i as f64;
                *e += 100.0 * (cell * 12.9898).sin() * (if i < 60 { 1.0 } else { 1e-3 });
            }
            Some(errors)
        };
        let found = solve(&[0.5, 0.5], 40, jumpy);
        assert!(near(&found, truth, 0.01), "{found:?}");
    }

    #[test]
    fn a_truth_beyond_the_bounds_ends_at_the_bound() {
        let found = solve(&[0.5, 0.5], 40, |x| Some(vec![vec![x[0] - 0.4, x[1] - 1.3]]));
        assert!(near(&found, [0.4, 1.0], 1e-6), "{found:?}");
    }

    #[test]
    fn what_is_held_by_a_bound_does_not_mislead_what_acts_alike() {
        // The best second parameter lies outside; with it held at 1, the best first one is this.
        let (sine, cosine) = (|i: usize| (0.15 * i as f64).sin(), |i: usize| (0.15 * i as f64).cos());
        let act = |i: usize| 0.95 * sine(i) + 0.3 * cosine(i);
        let sum = |f: &dyn Fn(usize) -> f64| (0..60).map(f).sum::<f64>();
        let best = 0.4 + 0.3 * sum(&|i| sine(i) * act(i)) / sum(&|i| sine(i) * sine(i));
        for start in [[0.9, 0.1], [0.5, 0.5], [0.1, 0.9]] {
            let f = |x: &[f64]| Some(vec![(0..60).map(|i| (x[0] - 0.4) * sine(i) + (x[1] - 1.3) * act(i)).collect()]);
            let found = solve(&start, 40, f);
            // The weights move the optimum a little.
            assert!(near(&found, [best, 1.0], 0.03), "{found:?} {best}");
        }
    }

    #[test]
    fn failed_probes_missing_samples_and_dead_parameters_are_survived() {
        let found = solve(&[0.6, 0.5], 40, |x| {
            let valid = x[0] < 0.62;
            valid.then(|| vec![vec![x[0] - 0.4, f64::NAN, 2.0 * (x[0] - 0.4)], vec![]])
        });
        assert!((found.here[0] - 0.4).abs() < 1e-6 && found.here[1].to_bits() == 0.5f64.to_bits(), "{found:?}");
        assert!(solve(&[0.5], 3, |_| None).done());
    }

    #[test]
    fn a_new_start_stays_in_the_cube() {
        let start = LeastSquares::near(&[0.0, 1.0, 0.5], &mut random::stream(7, &[1]));
        assert!(
            start.here.iter().all(|x| (0.0..=1.0).contains(x)) && start.here[2].to_bits() != 0.5f64.to_bits(),
            "{start:?}"
        );
    }
}
