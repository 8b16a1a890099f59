//! Levenberg and Marquardt's step: damped normal equations, with parameters held where bounds require it.
//!
//! Both searches of least squares use it: [`LeastSquares`](super::LeastSquares), which asks for populations, and the
//! fit of a model to logs, which keeps a Jacobian across steps. Marquardt's damping is relative to the diagonal: D. W.
//! Marquardt, "An Algorithm for Least-Squares Estimation of Nonlinear Parameters", J. SIAM 11(2), 1963.

use nalgebra::{DMatrix, DVector};

/// The local quadratic model of half a sum of squares.
#[derive(Clone, Debug)]
pub struct QuadraticModel {
    /// Curvature: the products of the Jacobian's columns, and the information of priors. Square, symmetric.
    pub curvature: DMatrix<f64>,
    /// Slope: the products of the Jacobian's columns with the residual, and the slopes of priors.
    pub gradient: DVector<f64>,
}

impl QuadraticModel {
    /// The step that cancels the gradient with the diagonal multiplied by 1 + `damping`. A parameter with a number in
    /// `held` moves by that number; `held` is empty or has one entry per parameter. A parameter without curvature stays
    /// where it is. `None` where the numbers allow for no finite step.
    pub fn step(&self, damping: f64, held: &[Option<f64>]) -> Option<DVector<f64>> {
        let (mut damped, mut gradient) = (self.curvature.clone(), self.gradient.clone());
        for k in 0..damped.nrows() {
            damped[(k, k)] = if damped[(k, k)] > 0.0 { damped[(k, k)] * (1.0 + damping) } else { 1.0 };
        }
        let held = || held.iter().enumerate().filter_map(|(k, by)| Some((k, (*by)?)));
        for (k, by) in held() {
            gradient.axpy(by, &damped.column(k), 1.0);
            damped.row_mut(k).fill(0.0);
            damped.column_mut(k).fill(0.0);
            damped[(k, k)] = 1.0;
        }
        for (k, by) in held() {
            gradient[k] = -by;
        }
        let step = -damped.cholesky()?.solve(&gradient);
        step.iter().all(|x| x.is_finite()).then_some(step)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn an_undamped_step_ends_at_the_least_squares_and_held_parameters_move_as_told(
            numbers in prop::collection::vec(-3.0..3.0f64, 40),
            by in -1.0..1.0f64,
        ) {
            let jacobian = DMatrix::from_fn(9, 4, |i, k| numbers[4 * i + k] + if i == k { 9.0 } else { 0.0 });
            let residual = DVector::from_column_slice(&numbers[31..40]);
            let normal =
                QuadraticModel { curvature: jacobian.tr_mul(&jacobian), gradient: jacobian.tr_mul(&residual) };
            for held in [vec![], vec![None, Some(by), None, Some(0.0)]] {
                let step = normal.step(0.0, &held).unwrap();
                let slope = jacobian.tr_mul(&(&residual + &jacobian * &step));
                for k in 0..4 {
                    match held.get(k).copied().flatten() {
                        Some(by) => prop_assert!((step[k] - by).abs() < 1e-12),
                        None => prop_assert!(slope[k].abs() < 1e-8, "{slope}"),
                    }
                }
                let damped = normal.step(10.0, &held).unwrap();
                let free = |step: &DVector<f64>| -> f64 { [0, 2].iter().map(|&k| step[k].powi(2)).sum() };
                prop_assert!(!held.is_empty() || free(&damped) <= free(&step) + step.norm_squared());
            }
        }
    }

    #[test]
    fn what_has_no_effect_stays() {
        let normal = QuadraticModel {
            curvature: DMatrix::from_row_slice(2, 2, &[4.0, 0.0, 0.0, 0.0]),
            gradient: DVector::from_column_slice(&[-2.0, 0.0]),
        };
        assert_eq!(normal.step(0.0, &[]).unwrap().as_slice(), [0.5, -0.0]);
    }
}
