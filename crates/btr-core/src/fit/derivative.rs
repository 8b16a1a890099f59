//! How the residual changes with the free knobs: finite differences, cheap ones for the way and careful ones for what is said
//! about the end of it.

use super::bench::{Bench, Logs, Residual};
use super::estimate::told;
use super::solve::Fit;
use crate::family::{Knob, Step};
use nalgebra::{DMatrix, DVector};

/// How much finer than the usual ones fine differences are.
const FINE: f64 = 0.1;
/// Directions with more than this share of their prior's deviation left are looked at again, with wide steps...
const WEAK: f64 = 0.05;
/// ... so many times: after the first, errors of short steps no longer decide which directions these are.
const LOOKS: usize = 2;

impl Fit {
    /// Takes the Jacobian by forward differences (backward at an upper bound). Columns that blow up are zero.
    pub fn differentiate(&mut self, bench: &Bench) {
        let columns = columns(bench, &self.u, &self.active, &self.residual, &self.step_error);
        let mut jacobian = DMatrix::zeros(self.residual.len(), self.active.len());
        for (k, column) in columns.iter().enumerate() {
            jacobian.column_mut(k).copy_from_slice(column);
        }
        (self.jacobian, self.fresh) = (Some(jacobian), true);
    }

    /// Takes the Jacobian by finer differences of second order: central ones, or one-sided ones beside a bound.
    pub fn differentiate_finely(&mut self, bench: &Bench) {
        let knobs = bench.family.knobs();
        let stencils: Vec<[(f64, f64); 2]> = self.active.iter().map(|&k| stencil(&knobs[k], self.u[k])).collect();
        let moved = |(&knob, stencil): (&usize, &[(f64, f64); 2])| {
            stencil.map(|(offset, _)| {
                let mut point = self.u.clone();
                point[knob] += offset;
                point
            })
        };
        let points: Vec<Vec<f64>> = self.active.iter().zip(&stencils).flat_map(moved).collect();
        let there = bench.residuals(&points, Logs::Learn, Step::Usual);
        let mut jacobian = DMatrix::zeros(self.residual.len(), self.active.len());
        for (k, (stencil, there)) in stencils.iter().zip(there.chunks(2)).enumerate() {
            let [Some(near), Some(far)] = there else { continue };
            for (row, here) in self.residual.iter().zip(&self.step_error).map(|(r, e)| r - e).enumerate() {
                jacobian[(row, k)] = stencil[0].1 * (near[row] - here) + stencil[1].1 * (far[row] - here);
            }
        }
        (self.jacobian, self.fresh) = (Some(jacobian), true);
    }

    /// Takes the Jacobian as far out as the logs leave the knobs in doubt: fine differences first, then along each direction of
    /// which little is told once more, in steps of the deviation that is left of it. The errors of short steps (a servo that
    /// sticks a sample earlier, a solver's tolerance) would otherwise pass for something that the logs tell, and intervals
    /// would be too narrow just where they matter.
    pub fn differentiate_widely(&mut self, bench: &Bench) {
        self.differentiate_finely(bench);
        let knobs = bench.family.knobs();
        // Beside a bound there are only one-sided differences, and those stay.
        let has_room = |&k: &usize| {
            let (knob, u) = (&knobs[self.active[k]], self.u[self.active[k]]);
            u - knob.reach >= knob.bounds.0 && u + knob.reach <= knob.bounds.1
        };
        let free: Vec<usize> = (0..self.active.len()).filter(has_room).collect();
        for _ in 0..LOOKS {
            let Some(told) = told(knobs, self).filter(|_| !free.is_empty()) else { return };
            let eigen = told.select_rows(&free).select_columns(&free).symmetric_eigen();
            let deviations = eigen.eigenvalues.map(|told| (1.0 + told.max(0.0)).powf(-0.5));
            let weak = (0..free.len()).filter(|&i| deviations[i] > WEAK);
            let steps = weak.map(|i| (eigen.eigenvectors.column(i).into_owned(), deviations[i])).collect();
            self.look_along(bench, &free, steps);
        }
    }

    /// Replaces what the Jacobian says along directions (in units of the priors, of the knobs `free`) by central differences with
    /// steps as given, or as far as the bounds allow. Directions that blow up stay as they are.
    fn look_along(&mut self, bench: &Bench, free: &[usize], steps: Vec<(DVector<f64>, f64)>) {
        let knobs = bench.family.knobs();
        let index = |k: usize| self.active[free[k]];
        let room = |k: usize, along: f64| {
            let (knob, u) = (&knobs[index(k)], self.u[index(k)]);
            (u - knob.bounds.0).min(knob.bounds.1 - u) / (along * knob.spread).abs()
        };
        let shortened = |(along, step): (DVector<f64>, f64)| {
            let step =
                along.iter().enumerate().filter(|(_, x)| **x != 0.0).map(|(k, x)| room(k, *x)).fold(step, f64::min);
            (along, step)
        };
        let steps: Vec<(DVector<f64>, f64)> = steps.into_iter().map(shortened).collect();
        let moved = |(along, step): &(DVector<f64>, f64)| {
            [*step, -step].map(|step| {
                let mut point = self.u.clone();
                (0..free.len()).for_each(|k| point[index(k)] += step * along[k] * knobs[index(k)].spread);
                point
            })
        };
        let points: Vec<Vec<f64>> = steps.iter().flat_map(moved).collect();
        let there = bench.residuals(&points, Logs::Learn, Step::Usual);
        let spreads = DVector::from_fn(free.len(), |k, _| knobs[index(k)].spread);
        let Some(jacobian) = self.jacobian.as_mut() else { return };
        for ((along, step), there) in steps.iter().zip(there.chunks(2)) {
            let [Some(ahead), Some(behind)] = there else { continue };
            let scaled = along.component_mul(&spreads);
            for row in 0..ahead.len() {
                let seen = (ahead[row] - behind[row]) / (2.0 * step);
                let said: f64 = free.iter().zip(scaled.iter()).map(|(&k, x)| jacobian[(row, k)] * x).sum();
                for (k, &column) in free.iter().enumerate() {
                    jacobian[(row, column)] += (seen - said) * along[k] / spreads[k];
                }
            }
        }
    }
}

/// Two offsets and the weights of what changes there, for a derivative of second order.
fn stencil(knob: &Knob, u: f64) -> [(f64, f64); 2] {
    let (h, (least, most)) = (FINE * knob.reach, knob.bounds);
    let one_sided = |h: f64| [(h, 2.0 / h), (2.0 * h, -0.5 / h)];
    match () {
        () if u - h >= least && u + h <= most => [(h, 0.5 / h), (-h, -0.5 / h)],
        () if u + 2.0 * h <= most => one_sided(h),
        () => one_sided(-h),
    }
}

/// d residual / d coordinate of each knob, by finite differences.
pub fn columns(bench: &Bench, u: &[f64], active: &[usize], residual: &[f64], step_error: &[f64]) -> Vec<Vec<f64>> {
    let knobs = bench.family.knobs();
    let reach = |knob: usize| {
        let reach = knobs[knob].reach;
        if u[knob] + reach <= knobs[knob].bounds.1 { reach } else { -reach }
    };
    let moved = |&knob: &usize| {
        let mut point = u.to_vec();
        point[knob] += reach(knob);
        point
    };
    let points: Vec<Vec<f64>> = active.iter().map(moved).collect();
    let there = bench.residuals(&points, Logs::Learn, Step::Usual);
    let column = |(&knob, there): (&usize, Option<Residual>)| match there {
        Some(there) => {
            let bare = residual.iter().zip(step_error).map(|(r, e)| r - e);
            there.iter().zip(bare).map(|(a, b)| (a - b) / reach(knob)).collect()
        }
        None => vec![0.0; residual.len()],
    };
    active.iter().zip(there).map(column).collect()
}
