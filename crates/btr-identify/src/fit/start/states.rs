//! Marginalisation of start states. The start of a log is measured with noise, and its velocities not at all. The
//! response of the residual to another start state is therefore projected out, so that it is attributed to no parameter
//! and no effect. Where the start has a prior, with B the responses to one standard deviation of each of its numbers, r
//! becomes (1 + B·Bᵀ)^(-1/2)·r: white again, as if B's part of it were noise. Offsets of whole runs, where these differ
//! from run to run, are projected out in the same way.

use crate::fit::rollouts::{each, rows_near, shared};
use crate::residual_model::{ModelDescription, RecordedLog, ResidualModel, ResidualRequest, TimeStep};
use nalgebra::{DMatrix, DVector};

/// Smallest norm of a direction, relative to the longest one of its log.
const NEGLIGIBLE: f64 = 1e-3;
/// Smallest response, in noise floors, that is projected out.
const UNSEEN: f64 = 0.03;

/// For each log, the responses of its windows to their start states.
#[derive(Clone)]
pub(in crate::fit) struct StartStates(Vec<Vec<StartWindow>>);

/// The responses of some rows of a residual to their start state: orthonormal directions.
#[derive(Clone)]
struct StartWindow(Vec<Direction>);

/// A direction of a residual, in its rows that are not 0 (a start may show in one limb alone), and the share of it that
/// is projected out.
#[derive(Clone)]
struct Direction {
    rows: Vec<usize>,
    values: Vec<f64>,
    share: f64,
}

/// A rollout in which some numbers of a log's start are nudged.
struct NudgedRollout {
    log: usize,
    nudged: Vec<usize>,
    moved: Vec<f64>,
}

impl NudgedRollout {
    fn of(description: &ModelDescription, log: usize, nudged: Vec<usize>) -> Self {
        let mut moved = vec![0.0; description.starts[log].numbers.len()];
        nudged.iter().for_each(|&number| moved[number] = 1.0);
        NudgedRollout { log, nudged, moved }
    }
}

impl StartStates {
    /// The responses of the model at `u`, and the number of simulated logs.
    pub(in crate::fit) fn at(
        model: &dyn ResidualModel,
        description: &ModelDescription,
        u: &[f64],
    ) -> (StartStates, usize) {
        // The first rollout of each log has its recorded start.
        let nudged =
            |log: usize| shared(description.starts[log].numbers.iter().map(|number| number.channels.as_slice()));
        let rollouts = |log: usize| {
            std::iter::once(Vec::new()).chain(nudged(log)).map(move |n| NudgedRollout::of(description, log, n))
        };
        let has_offsets = |log: usize| description.logs[log].channels.iter().any(|channel| channel.offset_differs);
        let is_uncertain = |&log: &usize| !description.starts[log].numbers.is_empty() || has_offsets(log);
        let logs = (0..description.logs.len()).filter(is_uncertain);
        let rollouts: Vec<NudgedRollout> = logs.flat_map(rollouts).collect();
        let requests: Vec<ResidualRequest> =
            rollouts.iter().map(|rollout| ResidualRequest { u, log: rollout.log, moved: &rollout.moved }).collect();
        let simulate = |requests: &[ResidualRequest]| model.residuals(requests, TimeStep::USUAL);
        let residuals = each(description.batch_size, &requests, &simulate, &|_, residual| residual.ok());
        let windows = |log: usize| {
            let of_log = || rollouts.iter().zip(&residuals).filter(move |(rollout, _)| rollout.log == log);
            let Some(usual) = of_log().next().and_then(|(_, usual)| usual.as_ref()) else { return Vec::new() };
            let mut changes: Vec<(usize, Vec<f64>)> = Vec::new();
            for (rollout, nudged) in of_log().skip(1) {
                let Some(nudged) = nudged else { continue };
                let change = |&number: &usize| (number, change(description, log, number, usual, nudged));
                changes.extend(rollout.nudged.iter().map(change));
            }
            changes.sort_by_key(|(number, _)| *number);
            let changes: Vec<Vec<f64>> =
                changes.into_iter().map(|(_, change)| change).chain(offsets(&description.logs[log], usual)).collect();
            rows(description, log)
                .into_iter()
                .map(|rows| StartWindow::new(&rows, &changes, description.start_spread))
                .collect()
        };
        let starts = (0..description.logs.len()).map(windows).collect();
        (StartStates(starts), rollouts.len())
    }

    /// Degrees of freedom that the start of a log takes from its residual. A start with a prior takes none: the
    /// residual stays white.
    pub(in crate::fit) fn rank(&self, log: usize) -> usize {
        self.0[log].iter().flat_map(|window| &window.0).filter(|direction| direction.share >= 1.0).count()
    }

    /// Projects the response to the start state out of a residual.
    pub(in crate::fit) fn project(&self, log: usize, residual: &mut [f64]) {
        for window in &self.0[log] {
            window.project(residual);
        }
    }
}

/// The change of the residual by one number of a start, in the channels that it affects.
fn change(description: &ModelDescription, log: usize, number: usize, usual: &[f64], nudged: &[f64]) -> Vec<f64> {
    let mut change = vec![0.0; usual.len()];
    for row in
        rows_near(&description.logs[log], &description.starts[log].numbers[number].channels).into_iter().flatten()
    {
        let moved = nudged[row] - usual[row];
        change[row] = if moved.is_finite() { moved } else { 0.0 };
    }
    change
}

/// An offset of each channel whose offset differs from run to run, where it was measured.
fn offsets<'a>(log: &'a RecordedLog, usual: &'a [f64]) -> impl Iterator<Item = Vec<f64>> + 'a {
    log.channels.iter().filter(|channel| channel.offset_differs).map(|channel| {
        let size = (channel.samples.len().max(1) as f64).sqrt().recip();
        let at = |row: usize| if channel.samples.contains(&row) && usual[row].is_finite() { size } else { 0.0 };
        (0..usual.len()).map(at).collect()
    })
}

/// The rows of each window of a log.
fn rows(description: &ModelDescription, log: usize) -> Vec<Vec<usize>> {
    let (recorded, windows) = (&description.logs[log], &description.starts[log].windows);
    if windows.is_empty() {
        return vec![(0..recorded.rows()).collect()];
    }
    let of_channel = |first: usize, window: &std::ops::Range<usize>| first + window.start..first + window.end;
    let of = |window| recorded.channels.iter().flat_map(|c| of_channel(c.samples.start, window)).collect();
    windows.iter().map(of).collect()
}

impl StartWindow {
    fn new(rows: &[usize], changes: &[Vec<f64>], spread: f64) -> Self {
        let in_window = |change: &Vec<f64>| DVector::from_iterator(rows.len(), rows.iter().map(|&row| change[row]));
        let columns: Vec<DVector<f64>> = changes.iter().map(in_window).collect();
        let (basis, shares) = if spread.is_finite() {
            whitening(rows.len(), &columns, spread)
        } else {
            let basis = orthonormal(columns);
            let shares = vec![1.0; basis.len()];
            (basis, shares)
        };
        StartWindow(basis.iter().zip(shares).map(|(column, share)| Direction::of(rows, column, share)).collect())
    }

    fn project(&self, residual: &mut [f64]) {
        self.0.iter().for_each(|direction| direction.project(residual));
    }
}

impl Direction {
    fn of(rows: &[usize], column: &DVector<f64>, share: f64) -> Self {
        let (rows, values) = rows.iter().zip(column.iter()).filter(|(_, value)| **value != 0.0).unzip();
        Direction { rows, values, share }
    }

    fn project(&self, residual: &mut [f64]) {
        let along: f64 = self.values.iter().zip(&self.rows).map(|(value, &row)| value * residual[row]).sum();
        self.values.iter().zip(&self.rows).for_each(|(value, &row)| residual[row] -= self.share * along * value);
    }
}

/// Directions of B, and the share that the whitening removes of each.
fn whitening(rows: usize, columns: &[DVector<f64>], spread: f64) -> (Vec<DVector<f64>>, Vec<f64>) {
    if columns.is_empty() || rows == 0 {
        return (Vec::new(), Vec::new());
    }
    let responses = DMatrix::from_columns(columns) * spread;
    let eigen = responses.tr_mul(&responses).symmetric_eigen();
    let lengths = eigen.eigenvalues.map(|square| square.max(0.0).sqrt());
    let seen: Vec<usize> = (0..columns.len()).filter(|&k| lengths[k] > UNSEEN).collect();
    let basis = seen.iter().map(|&k| &responses * eigen.eigenvectors.column(k) / lengths[k]).collect();
    let shares = seen.iter().map(|&k| 1.0 - (1.0 + lengths[k].powi(2)).powf(-0.5)).collect();
    (basis, shares)
}

/// A basis of the same space (Gram-Schmidt, twice because of rounding).
fn orthonormal(columns: Vec<DVector<f64>>) -> Vec<DVector<f64>> {
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
    basis
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decay(rate: f64) -> DVector<f64> {
        DVector::from_fn(50, |i, _| (-rate * i as f64).exp())
    }

    fn starts(spread: f64) -> StartStates {
        let columns = [decay(0.1), decay(0.5), decay(0.1) * 3.0 + decay(0.5)];
        let columns: Vec<Vec<f64>> = columns.iter().map(|c| c.iter().copied().collect()).collect();
        StartStates(vec![vec![StartWindow::new(&(0..50).collect::<Vec<_>>(), &columns, spread)]])
    }

    #[test]
    fn the_response_to_the_start_is_removed_and_the_rest_stays() {
        let starts = starts(f64::INFINITY);
        assert_eq!(starts.rank(0), 2);
        let mut gone: Vec<f64> = (decay(0.1) * 7.0 - decay(0.5) * 2.0).iter().copied().collect();
        starts.project(0, &mut gone);
        assert!(gone.iter().all(|x| x.abs() < 1e-12));
        let mut late: Vec<f64> = (0..50).map(|i| if i == 49 { 1.0 } else { 0.0 }).collect();
        starts.project(0, &mut late);
        assert!((late[49] - 1.0).abs() < 1e-3);
    }

    #[test]
    fn a_start_with_a_prior_leaves_the_residual_white() {
        // W·(1 + B·Bᵀ)·Wᵀ must be the identity.
        let (starts, spread) = (starts(4.0), 4.0);
        let responses = DMatrix::from_columns(&[decay(0.1), decay(0.5), decay(0.1) * 3.0 + decay(0.5)]) * spread;
        let whitened = |column: DVector<f64>| {
            let mut column: Vec<f64> = column.iter().copied().collect();
            starts.project(0, &mut column);
            DVector::from_vec(column)
        };
        let by_rows = |m: DMatrix<f64>| {
            DMatrix::from_columns(&m.column_iter().map(|c| whitened(c.into_owned())).collect::<Vec<_>>())
        };
        let covariance = DMatrix::identity(50, 50) + &responses * responses.transpose();
        let white = by_rows(by_rows(covariance).transpose());
        assert_eq!(starts.rank(0), 0);
        assert!((white - DMatrix::identity(50, 50)).amax() < 1e-3);
    }
}
