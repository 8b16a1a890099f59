//! When a response begins.

use super::steps::Response;

/// Steps in which the onset is searched, as a share of the clock's step, and in s.
const FINENESS: (f64, f64) = (0.1, 0.001);
/// Onsets are searched from this many steps of the clock before the command's change ...
const EARLIEST: f64 = 2.0;
/// ... and at most this long, in s, before the joint has certainly moved.
const LONGEST_S: f64 = 0.3;

/// Residuals below this share of a response are errors of the integrals, and tell no order.
const EXACT: f64 = 3e-4;

/// The onset of one response.
#[derive(Clone, Copy, Debug)]
pub(super) struct Onset {
    /// Time from the command's change, in s.
    pub after_s: f64,
    /// Standard deviation by the fit's residual, in s.
    pub sd_s: f64,
    /// Twice the negative logarithm of the likelihood, but for a constant, plus twice the number of coefficients.
    pub misfit: f64,
}

/// The onset of a response of a system of this order: x^(order) = a·step(t - onset) + b·x + c·x' + ... Integrated as
/// often, this is linear in all but the onset, and integrals of the readings have little noise. A line is allowed for,
/// for a drift at rest.
pub(super) fn onset(response: &Response, order: usize, step_s: f64) -> Option<Onset> {
    let Response { t, moved, latest_s, size } = response;
    let mut columns = vec![vec![1.0; t.len()], t.clone(), integral(t, moved)];
    for _ in 1..order {
        columns.push(integral(t, columns.last()?));
    }
    let basis = orthonormal(columns);
    let rows = t.len() as f64;
    let freedom = rows - (basis.len() + 2) as f64;
    let left = without(&basis, moved.clone());
    let total = dot(&left, &left);
    let squares = |onset_s: f64| {
        let power = t.iter().map(|t| (t - onset_s).max(0.0).powi(order as i32)).collect();
        let column = without(&basis, power);
        let (along, size) = (dot(&left, &column), dot(&column, &column));
        // A response against its command is none.
        if along > 0.0 && size > 0.0 { total - along * along / size } else { total }
    };
    let from_s = (-EARLIEST * step_s).max(latest_s - LONGEST_S);
    let fineness_s = (FINENESS.0 * step_s).min(FINENESS.1);
    let count = ((latest_s - from_s) / fineness_s) as u32;
    let searched: Vec<(f64, f64)> =
        (0..=count).map(|k| latest_s - fineness_s * f64::from(k)).map(|at_s| (at_s, squares(at_s))).collect();
    let (after_s, least) = searched.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)).filter(|_| freedom > 0.0)?;
    let variance = (least / freedom).max(f64::MIN_POSITIVE);
    let within =
        || searched.iter().filter(|(_, squares)| *squares <= least + variance).map(|(at_s, _)| (at_s - after_s).abs());
    let misfit = rows * (least / rows).max((EXACT * size).powi(2)).ln() + 2.0 * (rows - freedom);
    Some(Onset { after_s, sd_s: within().fold(0.5 * fineness_s, f64::max), misfit })
}

/// The integral of a series from its start, by trapezia.
fn integral(t: &[f64], x: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    let areas = t.windows(2).zip(x.windows(2)).map(|(t, x)| 0.5 * (t[1] - t[0]) * (x[0] + x[1]));
    std::iter::once(0.0)
        .chain(areas.map(|area| {
            sum += area;
            sum
        }))
        .collect()
}

/// An orthonormal basis of the space of these columns, by Gram and Schmidt.
fn orthonormal(columns: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for column in columns {
        let size = dot(&column, &column).sqrt();
        // Twice, so that what rounding leaves of the others goes as well.
        let mut rest = without(&basis, without(&basis, column));
        let left = dot(&rest, &rest).sqrt();
        if left > 1e-10 * size {
            rest.iter_mut().for_each(|x| *x /= left);
            basis.push(rest);
        }
    }
    basis
}

/// What is left of a series without its part in the space of an orthonormal basis.
fn without(basis: &[Vec<f64>], mut series: Vec<f64>) -> Vec<f64> {
    for column in basis {
        let along = dot(column, &series);
        series.iter_mut().zip(column).for_each(|(x, c)| *x -= along * c);
    }
    series
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
