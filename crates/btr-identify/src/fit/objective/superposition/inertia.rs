//! The response of a residual to inertias, in which it is linear where the motion is prescribed: learnt direction by
//! direction from simulations, and added up from then on.

/// Sizes by which the numbers of a link are compared: its mass, mass times centre of mass, and inertia.
const SIZES: [f64; 10] = [1.0, 0.1, 0.1, 0.1, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01];
/// A change with less than this share in directions that are not known is added up; with more than the second, it makes
/// a new direction known. Between them, rounding would be magnified too much.
const SHARES: [f64; 2] = [1e-10, 1e-4];

/// Directions of inertias with their responses.
pub(super) struct InertiaResponse {
    origin: Vec<f64>,
    /// Orthonormal directions, each with the change of the residual along it.
    known: Vec<(Vec<f64>, Vec<f64>)>,
}

impl InertiaResponse {
    /// Nothing is known but the inertias at which there is no change.
    pub(super) fn new(origin: Vec<f64>) -> Self {
        InertiaResponse { origin, known: Vec::new() }
    }

    /// The change of the residual at some inertias; `simulate` is asked for it where it does not follow from what is
    /// known. `None` where that fails.
    pub(super) fn change(&mut self, inertias: &[f64], simulate: impl FnOnce() -> Option<Vec<f64>>) -> Option<Vec<f64>> {
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
        let unknown = norm(&rest);
        if unknown > SHARES[0] * whole {
            let change = simulate()?;
            if unknown > SHARES[1] * whole {
                let mut response = change.clone();
                along.iter().zip(&self.known).for_each(|(share, (_, known))| add(&mut response, -share, known));
                [&mut rest, &mut response].into_iter().flatten().for_each(|x| *x /= unknown);
                self.known.push((rest, response));
            }
            return Some(change);
        }
        let rows = self.known.first().map_or(0, |(_, response)| response.len());
        let mut change = vec![0.0; rows];
        let seen = |share: &f64| share.abs() > f64::EPSILON * whole;
        along.iter().zip(&self.known).filter(|(share, _)| seen(share)).for_each(|(share, (_, response))| {
            add(&mut change, *share, response);
        });
        Some(change)
    }
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
    use std::cell::Cell;

    #[test]
    fn each_direction_is_simulated_once_and_then_added_up() {
        let truth = |x: &[f64]| vec![3.0 * x[0] - x[1], 0.5 * x[1] + 2.0 * x[2], x[0] - 40.0 * x[5]];
        let (mut response, asked) = (InertiaResponse::new(vec![0.0; 10]), Cell::new(0));
        let mut at = |x: [f64; 3]| {
            let mut inertias = vec![0.0; 10];
            (inertias[0], inertias[1], inertias[5]) = (x[0], x[1], x[2]);
            let simulate = || {
                asked.set(asked.get() + 1);
                Some(truth(&inertias))
            };
            let change = response.change(&inertias, simulate).unwrap_or_default();
            change.iter().zip(truth(&inertias)).for_each(|(a, b)| assert!((a - b).abs() < 1e-9, "{a} {b}"));
            asked.get()
        };
        assert_eq!(at([1.0, 0.2, 0.0]), 1);
        assert_eq!(at([2.0, 0.4, 0.0]), 1);
        assert_eq!(at([1.0, 0.0, 0.01]), 2);
        assert_eq!(at([0.0, 0.1, 0.0]), 3);
        assert_eq!(at([-3.0, 0.7, 0.05]), 3);
        assert_eq!(at([0.0; 3]), 3);
    }
}
