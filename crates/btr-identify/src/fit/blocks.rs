//! Blocks of a Jacobian. Where the motion is prescribed, a joint's torque depends on what acts in that joint and on the
//! links, so that most of the Jacobian is zero: sums over it skip that, and updates leave it.

use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Rows, and the columns that may differ from zero there.
pub(super) struct Block {
    pub(super) rows: Vec<Range<usize>>,
    pub(super) columns: Vec<usize>,
}

/// JᵀJ. Without blocks, the Jacobian is dense.
pub(super) fn curvature(jacobian: &DMatrix<f64>, blocks: &[Block]) -> DMatrix<f64> {
    if blocks.is_empty() {
        return jacobian.tr_mul(jacobian);
    }
    let mut curvature = DMatrix::zeros(jacobian.ncols(), jacobian.ncols());
    for Block { rows, columns } in blocks {
        for rows in rows {
            let part = jacobian.rows(rows.start, rows.len()).select_columns(columns);
            let sums = part.tr_mul(&part);
            for (i, &row) in columns.iter().enumerate() {
                columns.iter().enumerate().for_each(|(j, &column)| curvature[(row, column)] += sums[(i, j)]);
            }
        }
    }
    curvature
}

/// Broyden's update of a Jacobian after a step, by the `difference` from what it predicted; within blocks, Schubert's.
pub(super) fn update(jacobian: &mut DMatrix<f64>, difference: &DVector<f64>, moved: &DVector<f64>, blocks: &[Block]) {
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
        [Block { rows: vec![0..2, 4..5], columns: vec![0, 2] }, Block { rows: vec![2..4], columns: vec![1, 2] }]
    }

    fn jacobian() -> DMatrix<f64> {
        DMatrix::from_row_slice(5, 3, &[1.0, 0.0, 2.0, 3.0, 0.0, 4.0, 0.0, 5.0, 6.0, 0.0, 7.0, 8.0, 9.0, 0.0, 10.0])
    }

    #[test]
    fn sums_over_blocks_are_those_over_the_whole() {
        assert_eq!(curvature(&jacobian(), &blocks()), curvature(&jacobian(), &[]));
    }

    #[test]
    fn an_update_within_blocks_meets_the_difference_and_leaves_zeros() {
        let (mut jacobian, moved) = (jacobian(), DVector::from_vec(vec![0.5, -1.0, 0.25]));
        let change = DVector::from_vec(vec![1.0, -2.0, 3.0, 0.5, 0.25]);
        let difference = &change - &jacobian * &moved;
        update(&mut jacobian, &difference, &moved, &blocks());
        assert!((&jacobian * &moved - change).norm() < 1e-12);
        assert_eq!([jacobian[(0, 1)], jacobian[(4, 1)], jacobian[(2, 0)], jacobian[(3, 0)]], [0.0; 4]);
    }
}
