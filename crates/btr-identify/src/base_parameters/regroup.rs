//! Independent columns of a matrix, and how the others depend on them.

use nalgebra::{DMatrix, DVector};

/// Largest length of a column without effect, relative to the longest.
pub(super) const NO_EFFECT: f64 = 1e-10;
/// Largest part of a column of length 1 that counts as rounding error beside the independent ones.
const DEPENDENT: f64 = 1e-7;
/// Smallest share of a column that is no rounding error.
const SHARE: f64 = 1e-6;

/// The columns of a matrix, regrouped.
#[derive(Clone, Debug, PartialEq)]
pub struct Regrouping {
    /// Independent columns, in their order.
    pub base: Vec<usize>,
    /// Columns that depend on them, each with its coefficients along them.
    pub dependent: Vec<(usize, Vec<f64>)>,
    /// Columns that are zero.
    pub without_effect: Vec<usize>,
}

impl Regrouping {
    /// The base coordinates as functions of all `count` coordinates: one row per independent column.
    pub fn map(&self, count: usize) -> DMatrix<f64> {
        let mut map = DMatrix::zeros(self.base.len(), count);
        self.base.iter().enumerate().for_each(|(row, &k)| map[(row, k)] = 1.0);
        for (k, coefficients) in &self.dependent {
            map.set_column(*k, &DVector::from_column_slice(coefficients));
        }
        map
    }
}

/// Chooses independent columns, group after group in the order of their numbers; within a group, the one with the
/// longest part beside those that are chosen comes next (QR factorisation with column pivoting).
pub fn regroup(columns: &DMatrix<f64>, groups: &[usize]) -> Regrouping {
    let lengths: Vec<f64> = columns.column_iter().map(|column| column.norm()).collect();
    let longest = lengths.iter().copied().fold(0.0, f64::max);
    let (acting, without_effect): (Vec<usize>, Vec<usize>) =
        (0..lengths.len()).partition(|&k| lengths[k] > NO_EFFECT * longest);
    let mut scaled = columns.select_columns(&acting);
    scaled.column_iter_mut().zip(&acting).for_each(|(mut column, &k)| column /= lengths[k]);
    // The triangular factor has the same dependences as the columns themselves.
    let factor = scaled.qr().r();
    let mut chosen = independent(&factor, &acting.iter().map(|&k| groups[k]).collect::<Vec<_>>());
    chosen.sort_unstable();
    let rest: Vec<usize> = (0..acting.len()).filter(|i| !chosen.contains(i)).collect();
    let along = along(&factor.select_columns(&chosen), &factor.select_columns(&rest));
    let dependent = |(i, along): (&usize, &DVector<f64>)| {
        let length = lengths[acting[*i]];
        let coefficient = |(c, x): (&usize, &f64)| if x.abs() > SHARE { x * length / lengths[acting[*c]] } else { 0.0 };
        (acting[*i], chosen.iter().zip(along.iter()).map(coefficient).collect())
    };
    Regrouping {
        dependent: rest.iter().zip(&along).map(dependent).collect(),
        base: chosen.iter().map(|&i| acting[i]).collect(),
        without_effect,
    }
}

/// The independent columns of a matrix of columns of length 1.
fn independent(columns: &DMatrix<f64>, groups: &[usize]) -> Vec<usize> {
    let (mut left, mut chosen) = (columns.clone(), Vec::new());
    let mut order: Vec<usize> = groups.to_vec();
    order.sort_unstable();
    order.dedup();
    for group in order {
        let members: Vec<usize> = (0..groups.len()).filter(|&i| groups[i] == group).collect();
        while let Some((next, length)) = longest(&left, &members).filter(|(_, length)| *length > DEPENDENT) {
            let direction = left.column(next) / length;
            for mut column in left.column_iter_mut() {
                let part = column.dot(&direction);
                column.axpy(-part, &direction, 1.0);
            }
            left.column_mut(next).fill(0.0);
            chosen.push(next);
        }
    }
    chosen
}

/// The longest of some columns, and its length.
fn longest(columns: &DMatrix<f64>, members: &[usize]) -> Option<(usize, f64)> {
    let lengths = members.iter().map(|&i| (i, columns.column(i).norm()));
    lengths.max_by(|a, b| a.1.total_cmp(&b.1))
}

/// The coefficients of other columns along independent ones.
fn along(base: &DMatrix<f64>, others: &DMatrix<f64>) -> Vec<DVector<f64>> {
    let qr = base.clone().qr();
    let mut rotated = others.clone();
    qr.q_tr_mul(&mut rotated);
    let top = rotated.rows(0, base.ncols()).into_owned();
    let solved = qr.r().solve_upper_triangular(&top).unwrap_or(top);
    solved.column_iter().map(|column| column.into_owned()).collect()
}
