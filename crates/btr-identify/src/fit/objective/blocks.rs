//! Blocks of a Jacobian. Where the motion is prescribed, a joint's torque depends on what acts in that joint and on the
//! links; on a held base, a limb's motion depends on that limb. Most of the Jacobian is zero then: sums over it skip
//! that, and updates leave it.

use crate::fit::rollouts::rows_near;
use crate::residual_model::{ModelDescription, RecordedLog};
use nalgebra::{DMatrix, DVector, DVectorView};
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;

/// For each parameter of what acts in one joint of a prescribed motion, or in one limb, the channels in which it shows.
pub(super) struct OwnChannels {
    channels: HashMap<usize, Vec<String>>,
    /// Parameters that, where they are not 0, let what acts in one limb show in the others.
    joining: Vec<usize>,
}

impl OwnChannels {
    pub(super) fn new(description: &ModelDescription) -> Self {
        if !description.is_decoupled {
            let channels = description.limb_parameters.iter().cloned().collect();
            return OwnChannels { channels, joining: description.joining.clone() };
        }
        let candidates = description.candidates.iter().zip(&description.candidate_channels);
        let of_candidates = candidates.flat_map(|(candidate, near)| candidate.parameters().map(move |k| (k, near)));
        let laws = description.law_terms.iter().flat_map(|law| law.term.parameters().map(|k| (k, &law.channels)));
        let of_joints = description.joint_laws.iter();
        let in_joints = of_joints.flat_map(|laws| laws.parameters.iter().map(move |&k| (k, &laws.channels)));
        let all = of_candidates.chain(laws).chain(in_joints);
        let near = all.filter(|(_, near)| !near.is_empty()).map(|(k, near)| (k, near.clone()));
        OwnChannels { channels: near.collect(), joining: Vec::new() }
    }

    /// Whether parameters show in their channels alone at a point.
    pub(super) fn hold_at(&self, u: &[f64]) -> bool {
        self.joining.iter().all(|&k| u[k] == 0.0)
    }

    /// The channels of a parameter; empty where it shows in all.
    pub(super) fn of(&self, parameter: usize) -> &[String] {
        self.channels.get(&parameter).map_or(&[], Vec::as_slice)
    }

    /// The blocks of the Jacobian of these logs with respect to some parameters; none where it is dense.
    pub(super) fn blocks(&self, logs: &[&RecordedLog], active: &[usize]) -> Vec<Block> {
        if self.channels.is_empty() || active.iter().any(|k| self.joining.contains(k)) {
            return Vec::new();
        }
        let mut blocks: Vec<(&String, Block)> = Vec::new();
        let mut first = 0;
        for log in logs {
            for name in log.channels.iter().map(|channel| &channel.name) {
                let rows = rows_near(log, std::slice::from_ref(name)).into_iter();
                let rows = rows.map(|rows| first + rows.start..first + rows.end);
                match blocks.iter_mut().find(|(known, _)| *known == name) {
                    Some((_, block)) => block.rows.extend(rows),
                    None => blocks.push((name, Block { rows: rows.collect(), columns: self.columns(name, active) })),
                }
            }
            first += log.rows();
        }
        blocks.into_iter().map(|(_, block)| block).collect()
    }

    /// Which of some parameters show in a channel.
    fn columns(&self, channel: &String, active: &[usize]) -> Vec<usize> {
        let shows = |parameter: usize| {
            let near = self.of(parameter);
            near.is_empty() || near.contains(channel)
        };
        (0..active.len()).filter(|&k| shows(active[k])).collect()
    }
}

/// Rows, and the columns that may differ from zero there.
pub(in crate::fit) struct Block {
    rows: Vec<Range<usize>>,
    columns: Vec<usize>,
}

/// Jᵀr, by several threads. Each number is the dot product that `tr_mul` has.
pub(crate) fn gradient(jacobian: &DMatrix<f64>, residual: &[f64]) -> DVector<f64> {
    let residual = DVectorView::from_slice(residual, residual.len());
    let sums: Vec<f64> = (0..jacobian.ncols()).into_par_iter().map(|k| jacobian.column(k).dot(&residual)).collect();
    DVector::from_vec(sums)
}

/// MᵀM, where each number off the diagonal is computed once.
fn squared(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let n = matrix.ncols();
    let mut products = DMatrix::zeros(n, n);
    for i in 0..n {
        for j in i..n {
            let product = matrix.column(i).dot(&matrix.column(j));
            (products[(i, j)], products[(j, i)]) = (product, product);
        }
    }
    products
}

/// JᵀJ. Without blocks, the Jacobian is dense.
pub(in crate::fit) fn curvature(jacobian: &DMatrix<f64>, blocks: &[Block]) -> DMatrix<f64> {
    if blocks.is_empty() {
        return squared(jacobian);
    }
    let parts: Vec<(&Vec<usize>, &Range<usize>)> =
        blocks.iter().flat_map(|Block { rows, columns }| rows.iter().map(move |rows| (columns, rows))).collect();
    let sums = |(columns, rows): &(&Vec<usize>, &Range<usize>)| {
        squared(&jacobian.rows(rows.start, rows.len()).select_columns(*columns))
    };
    let sums: Vec<DMatrix<f64>> = parts.par_iter().map(sums).collect();
    let mut curvature = DMatrix::zeros(jacobian.ncols(), jacobian.ncols());
    for ((columns, _), sums) in parts.into_iter().zip(sums) {
        for (i, &row) in columns.iter().enumerate() {
            columns.iter().enumerate().for_each(|(j, &column)| curvature[(row, column)] += sums[(i, j)]);
        }
    }
    curvature
}

/// Broyden's update of a Jacobian after a step, by the `difference` from what it predicted; within blocks, Schubert's.
pub(in crate::fit) fn update(
    jacobian: &mut DMatrix<f64>,
    difference: &DVector<f64>,
    moved: &DVector<f64>,
    blocks: &[Block],
) {
    if blocks.is_empty() {
        jacobian.ger(1.0 / moved.norm_squared(), difference, moved, 1.0);
        return;
    }
    for Block { rows, columns } in blocks {
        let length: f64 = columns.iter().map(|&column| moved[column] * moved[column]).sum();
        if length == 0.0 {
            continue;
        }
        for (rows, &column) in rows.iter().flat_map(|rows| columns.iter().map(move |column| (rows, column))) {
            let part = difference.rows(rows.start, rows.len());
            jacobian.column_mut(column).rows_mut(rows.start, rows.len()).axpy(moved[column] / length, &part, 1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blocks() -> [Block; 2] {
        [Block { rows: vec![0..2, 4..5], columns: vec![0, 2] }, Block { rows: vec![2..3, 3..4], columns: vec![1, 2] }]
    }

    fn jacobian() -> DMatrix<f64> {
        DMatrix::from_row_slice(5, 3, &[1.0, 0.0, 2.0, 3.0, 0.0, 4.0, 0.0, 5.0, 6.0, 0.0, 7.0, 8.0, 9.0, 0.0, 10.0])
    }

    #[test]
    fn sums_over_blocks_are_those_over_the_whole() {
        assert_eq!(curvature(&jacobian(), &blocks()), curvature(&jacobian(), &[]));
    }

    #[test]
    fn products_have_the_bits_of_plain_ones() {
        let jacobian = DMatrix::from_fn(1003, 7, |i, k| (1.7 * i as f64 + k as f64).sin());
        let residual = DVector::from_fn(1003, |i, _| (0.3 * i as f64).cos());
        assert_eq!(curvature(&jacobian, &[]), jacobian.tr_mul(&jacobian));
        assert_eq!(gradient(&jacobian, residual.as_slice()), jacobian.tr_mul(&residual));
    }

    #[test]
    fn an_update_within_blocks_meets_the_difference_and_leaves_zeros() {
        let (mut jacobian, moved) = (jacobian(), DVector::from_vec(vec![0.5, -1.0, 0.25]));
        let change = DVector::from_vec(vec![1.0, -2.0, 3.0, 0.5, 0.25]);
        let difference = &change - &jacobian * &moved;
        update(&mut jacobian, &difference, &moved, &blocks());
        assert!((&jacobian * &moved - change).norm() < 1e-12);
        assert!([(0, 1), (4, 1), (2, 0), (3, 0)].iter().all(|&place| jacobian[place] == 0.0));
    }
}
