//! The response of a residual to inertias, in which it is linear where the motion is prescribed: learnt direction by
//! direction from simulations, and added up from then on.

use rayon::prelude::*;
use std::sync::Arc;

/// Sizes by which the numbers of a link are compared: its mass, mass times centre of mass, and inertia.
const SIZES: [f64; 10] = [1.0, 0.1, 0.1, 0.1, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01];
/// A change with less than this share in directions that are not known is added up; with more than the second, it makes
/// a new direction known. Between them, rounding would be magnified too much.
const SHARES: [f64; 2] = [1e-10, 1e-4];
/// Rows that a thread adds up at a time: they stay in its cache.
const ROWS: usize = 2048;

/// Directions of inertias with their responses.
pub(super) struct InertiaResponse {
    origin: Vec<f64>,
    /// Orthonormal directions, each with the change of the residual along it.
    known: Vec<(Vec<f64>, Arc<Vec<f64>>)>,
}

/// A change as a sum of responses, to be added up once nothing is locked any more: a thread that waits for others may
/// take over work that needs the lock.
pub(super) struct Change {
    rows: usize,
    terms: Vec<(f64, Arc<Vec<f64>>)>,
}

impl Change {
    /// Each row is the same sum in the same order, whichever thread has it.
    pub(super) fn added_up(&self) -> Vec<f64> {
        let mut sum = vec![0.0; self.rows];
        sum.par_chunks_mut(ROWS).enumerate().for_each(|(part, sum)| {
            let rows = part * ROWS..part * ROWS + sum.len();
            self.terms.iter().for_each(|(share, response)| add(sum, *share, &response[rows.clone()]));
        });
        sum
    }
}

impl InertiaResponse {
    /// Nothing is known but the inertias at which there is no change.
    pub(super) fn new(origin: Vec<f64>) -> Self {
        InertiaResponse { origin, known: Vec::new() }
    }

    /// The change of the residual at some inertias; `None` where it does not follow from what is known.
    pub(super) fn change(&self, inertias: &[f64]) -> Option<Change> {
        let Split { along, unknown, whole, .. } = self.split(inertias);
        if unknown > SHARES[0] * whole {
            return None;
        }
        let rows = self.known.first().map_or(0, |(_, response)| response.len());
        let seen = |share: &f64| share.abs() > f64::EPSILON * whole;
        let terms = along.into_iter().zip(&self.known).filter(|(share, _)| seen(share));
        let terms = terms.map(|(share, (_, response))| (share, Arc::clone(response))).collect();
        Some(Change { rows, terms })
    }

    /// Learns from a simulated change.
    pub(super) fn learn(&mut self, inertias: &[f64], change: &[f64]) {
        let Split { along, mut rest, unknown, whole } = self.split(inertias);
        if unknown > SHARES[1] * whole {
            let mut response = change.to_vec();
            along.iter().zip(&self.known).for_each(|(share, (_, known))| add(&mut response, -share, known));
            [&mut rest, &mut response].into_iter().flatten().for_each(|x| *x /= unknown);
            self.known.push((rest, Arc::new(response)));
        }
    }

    fn split(&self, inertias: &[f64]) -> Split {
        let scaled = |(k, (to, from)): (usize, (&f64, &f64))| (to - from) / SIZES[k % SIZES.len()];
        let mut rest: Vec<f64> = inertias.iter().zip(&self.origin).enumerate().map(scaled).collect();
        let whole = norm(&rest);
        let mut along = vec![0.0; self.known.len()];
        // Twice, so that the rest is orthogonal in spite of rounding.
        for _ in 0..2 {
            for (share, (direction, _)) in along.iter_mut().zip(&self.known) {
                let part: f64 = rest.iter().zip(direction).map(|(a, b)| a * b).sum();
                add(&mut rest, -part, direction);
                *share += part;
            }
        }
        Split { along, unknown: norm(&rest), rest, whole }
    }
}

/// Inertias by the directions that are known.
struct Split {
    along: Vec<f64>,
    /// What is left of them, ...
    rest: Vec<f64>,
    /// ... how large that is, and how large they are.
    unknown: f64,
    whole: f64,
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn add(to: &mut [f64], share: f64, what: &[f64]) {
    to.iter_mut().zip(what).for_each(|(to, what)| *to += share * what);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_direction_is_simulated_once_and_then_added_up() {
        let truth = |x: &[f64]| vec![3.0 * x[0] - x[1], 0.5 * x[1] + 2.0 * x[2], x[0] - 40.0 * x[5]];
        let (mut response, mut asked) = (InertiaResponse::new(vec![0.0; 10]), 0);
        let mut at = |x: [f64; 3]| {
            let mut inertias = vec![0.0; 10];
            (inertias[0], inertias[1], inertias[5]) = (x[0], x[1], x[2]);
            match response.change(&inertias) {
                Some(change) => {
                    change
                        .added_up()
                        .iter()
                        .zip(truth(&inertias))
                        .for_each(|(a, b)| assert!((a - b).abs() < 1e-9, "{a} {b}"));
                }
                None => {
                    asked += 1;
                    response.learn(&inertias, &truth(&inertias));
                }
            }
            asked
        };
        assert_eq!(at([1.0, 0.2, 0.0]), 1);
        assert_eq!(at([2.0, 0.4, 0.0]), 1);
        assert_eq!(at([1.0, 0.0, 0.01]), 2);
        assert_eq!(at([0.0, 0.1, 0.0]), 3);
        assert_eq!(at([-3.0, 0.7, 0.05]), 3);
        assert_eq!(at([0.0; 3]), 3);
    }

    #[test]
    fn rows_of_all_threads_are_the_serial_sum() {
        let response = |seed: f64| (0..2 * ROWS + 5).map(|i| (seed * i as f64).sin()).collect::<Vec<f64>>();
        let terms: Vec<(f64, Arc<Vec<f64>>)> = [1.1, 0.7].map(|seed| (seed, Arc::new(response(seed)))).to_vec();
        let serial = |i: usize| terms.iter().fold(0.0, |sum, (share, response)| sum + share * response[i]);
        let expected: Vec<f64> = (0..2 * ROWS + 5).map(serial).collect();
        assert_eq!(Change { rows: 2 * ROWS + 5, terms }.added_up(), expected);
    }
}
