//! Where a log begins is measured with noise, and not at all as far as velocities go. What another start state would do to the
//! residual is therefore projected out of it: neither a parameter nor an effect is praised or blamed for it.

use crate::family::Family;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A direction shorter than this share of the longest one of its log is none.
const NEGLIGIBLE: f64 = 1e-3;

/// For each log, orthonormal columns: the answers of its residual to its start state.
pub(super) struct Starts(Vec<DMatrix<f64>>);

impl Starts {
    /// As the model answers that stands at `u`, and how many logs were simulated for it.
    pub(super) fn at(family: &dyn Family, u: &[f64]) -> (Starts, usize) {
        let jobs: Vec<(usize, Option<usize>)> = (0..family.logs().len())
            .filter(|&log| family.starts(log) > 0)
            .flat_map(|log| std::iter::once((log, None)).chain((0..family.starts(log)).map(move |k| (log, Some(k)))))
            .collect();
        let run = |&(log, nudge): &(usize, Option<usize>)| family.residual_from(u, log, nudge).ok();
        let mut answers = jobs.par_iter().map(run).collect::<Vec<_>>().into_iter();
        let basis = |log: usize| {
            let rows = family.logs()[log].rows();
            let usual = if family.starts(log) > 0 { answers.next().flatten() } else { None };
            let nudged: Vec<Option<Vec<f64>>> = answers.by_ref().take(family.starts(log)).collect();
            let Some(usual) = usual else { return DMatrix::zeros(rows, 0) };
            let change = |there: Vec<f64>| {
                let finite = |x: f64| if x.is_finite() { x } else { 0.0 };
                DVector::from_iterator(rows, there.iter().zip(&usual).map(|(a, b)| finite(a - b)))
            };
            orthonormal(rows, nudged.into_iter().flatten().map(change).collect())
        };
        let bases = (0..family.logs().len()).map(basis).collect();
        (Starts(bases), jobs.len())
    }

    /// How many numbers the start of a log takes.
    pub(super) fn rank(&self, log: usize) -> usize {
        self.0[log].ncols()
    }

    /// What no start state can do.
    pub(super) fn project(&self, log: usize, residual: &mut [f64]) {
        for column in self.0[log].column_iter() {
            let along: f64 = column.iter().zip(residual.iter()).map(|(c, r)| c * r).sum();
            residual.iter_mut().zip(column.iter()).for_each(|(r, c)| *r -= along * c);
        }
    }
}

/// A basis of the same space (Gram and Schmidt, twice for the rounding).
fn orthonormal(rows: usize, columns: Vec<DVector<f64>>) -> DMatrix<f64> {
    let longest = columns.iter().map(|c| c.norm()).fold(0.0, f64::max);
    let mut basis: Vec<DVector<f64>> = Vec::new();
    for mut column in columns {
        for _ in 0..2 {
            basis.iter().for_each(|known| column.axpy(-known.dot(&column), known, 1.0));
        }
        let norm = column.norm();
        if norm > NEGLIGIBLE * longest {
            basis.push(column / norm);
        }
    }
    if basis.is_empty() { DMatrix::zeros(rows, 0) } else { DMatrix::from_columns(&basis) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_start_can_do_is_gone_and_the_rest_stays() {
        let decay = |rate: f64| DVector::from_fn(50, |i, _| (-rate * i as f64).exp());
        let starts = Starts(vec![orthonormal(50, vec![decay(0.1), decay(0.5), decay(0.1) * 3.0 + decay(0.5)])]);
        assert_eq!(starts.rank(0), 2);
        let mut gone: Vec<f64> = (decay(0.1) * 7.0 - decay(0.5) * 2.0).iter().copied().collect();
        starts.project(0, &mut gone);
        assert!(gone.iter().all(|x| x.abs() < 1e-12));
        let mut late: Vec<f64> = (0..50).map(|i| if i == 49 { 1.0 } else { 0.0 }).collect();
        starts.project(0, &mut late);
        assert!((late[49] - 1.0).abs() < 1e-3);
    }
}
