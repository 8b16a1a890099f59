//! Which effects are worth fitting: every candidate is tried with finite probes, while all that is in doubt may adapt.
//!
//! Probes are finite because some effects have no slope at zero (backlash, delay, a limit). What the base's parameters can do
//! as well is projected out, so that only what they cannot do counts for a candidate.

use crate::family::{Candidate, Law, Step};
use crate::fit::{Bench, Fit, Logs, Residual, corrected};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Amplitudes of the probes, in typical sizes.
const PROBES: [f64; 2] = [0.3, 1.5];
/// Limits act from some threshold on and are probed around it; they are not scaled.
const LIMITS: [f64; 6] = [0.12, 0.18, 0.27, 0.4, 0.6, 1.0];
/// An amplitude so many times the probe's is as far as the probe is believed.
const STRETCH: f64 = 4.0;
/// With more starts than this, only the best few by the most telling log are probed in full.
const FEW_STARTS: usize = 3;
/// How many candidates are simulated where their probes promise most.
const VERIFIED: usize = 16;
/// A base that could lower its cost by a smaller share is at its optimum.
const AT_REST: f64 = 0.01;
/// Stiffness of what stands at a bound, relative to what the logs tell of it.
const HELD: f64 = 1e9;
/// Points that are simulated at once; bounds the memory.
const BATCH: usize = 48;

/// A candidate at a promising point.
#[derive(Clone, Debug)]
pub(super) struct Start {
    /// Index of the candidate.
    pub candidate: usize,
    /// The point.
    pub u: Vec<f64>,
    /// The cost there: promised, then simulated.
    pub cost: f64,
}

/// The base around its optimum: what its own parameters can do about any change of the residual.
struct Base<'a> {
    fit: &'a Fit,
    jacobian: &'a DMatrix<f64>,
    factors: Cholesky<f64, Dyn>,
    gradient: DVector<f64>,
}

/// A point to be simulated: a candidate with one of its amplitudes at some size.
struct Probe {
    candidate: usize,
    shapes: Vec<f64>,
    amplitude: usize,
    size: f64,
}

/// About how many logs a screening simulates.
pub(super) fn rollouts(bench: &Bench) -> usize {
    let probes =
        |candidate: &Candidate| candidate.starts.len().min(FEW_STARTS) * candidate.amplitudes.len() * PROBES.len();
    bench.family.candidates().iter().map(probes).sum::<usize>() * bench.logs(Logs::Learn).len()
}

/// All candidates but the chosen ones, most promising first, with the costs that were really simulated.
pub(super) fn screen(bench: &Bench, base: &mut Fit, chosen: &[usize]) -> Vec<Start> {
    base.differentiate_finely(bench);
    let Some(prepared) = Base::new(bench, base) else { return Vec::new() };
    let mut promising: Vec<Start> = (0..bench.family.candidates().len())
        .filter(|candidate| !chosen.contains(candidate))
        .filter_map(|candidate| prepared.promise(bench, candidate))
        .collect();
    promising.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    promising.truncate(VERIFIED);
    verify(bench, base, promising)
}

/// Simulates every promise once.
fn verify(bench: &Bench, base: &Fit, promising: Vec<Start>) -> Vec<Start> {
    let points: Vec<Vec<f64>> = promising.iter().map(|start| start.u.clone()).collect();
    let residuals = bench.residuals(&points, Logs::Learn, Step::Usual);
    let mut verified: Vec<Start> = promising
        .into_iter()
        .zip(residuals)
        .filter_map(|(start, residual)| {
            let residual = corrected(residual?, &base.step_error);
            let active = with(base, &bench.family.candidates()[start.candidate]);
            Some(Start { cost: crate::fit::cost(bench.family.knobs(), &active, &start.u, &residual), ..start })
        })
        .collect();
    verified.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    verified
}

/// The base's free knobs and a candidate's.
pub(super) fn with(base: &Fit, candidate: &Candidate) -> Vec<usize> {
    base.active.iter().copied().chain(candidate.knobs()).collect()
}

impl<'a> Base<'a> {
    fn new(bench: &Bench, fit: &'a Fit) -> Option<Self> {
        let jacobian = fit.jacobian.as_ref()?;
        let mut normal = jacobian.tr_mul(jacobian);
        let mut gradient = jacobian.tr_mul(&DVector::from_column_slice(&fit.residual));
        for (k, &index) in fit.active.iter().enumerate() {
            let knob = &bench.family.knobs()[index];
            let (u, weight) = (fit.u[index], knob.spread.powi(-2));
            normal[(k, k)] += weight;
            gradient[k] += weight * u;
            // What a bound holds back cannot make up for anything.
            if (u <= knob.bounds.0 && gradient[k] > 0.0) || (u >= knob.bounds.1 && gradient[k] < 0.0) {
                normal[(k, k)] += HELD * (1.0 + normal[(k, k)]);
                gradient[k] = 0.0;
            }
        }
        let factors = normal.cholesky()?;
        // What is left to win at an optimum lies along directions that hardly matter; going there would only blur the view.
        if gradient.dot(&factors.solve(&gradient)) < AT_REST * fit.cost {
            gradient.fill(0.0);
        }
        Some(Base { fit, jacobian, factors, gradient })
    }

    /// The best point of a candidate, by its probes.
    fn promise(&self, bench: &Bench, candidate: usize) -> Option<Start> {
        let starts = self.best_starts(bench, candidate);
        let probes = self.probes(bench, candidate, &starts);
        let columns = self.columns(bench, &probes);
        // Probes of one start and one size belong together: one column for each amplitude.
        let amplitudes = bench.family.candidates()[candidate].amplitudes.len();
        let groups = probes.chunks(amplitudes).zip(columns.chunks(amplitudes));
        let found = groups.filter_map(|(probes, columns)| self.best_of(bench, probes, columns));
        found.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// The starts to probe: all if they are few, else those that explain most of the log with the largest error.
    fn best_starts(&self, bench: &Bench, index: usize) -> Vec<Vec<f64>> {
        let candidate = &bench.family.candidates()[index];
        if candidate.starts.len() <= FEW_STARTS {
            return candidate.starts.clone();
        }
        let probes: Vec<Probe> = candidate
            .starts
            .iter()
            .flat_map(|shapes| {
                candidate.amplitudes.iter().map(move |&amplitude| Probe {
                    candidate: index,
                    shapes: shapes.clone(),
                    amplitude,
                    size: PROBES[0],
                })
            })
            .collect();
        let points: Vec<Vec<f64>> = probes.iter().map(|probe| self.point(bench, probe)).collect();
        let (log, rows) = bench.worst_log(&self.fit.residual);
        let jacobian = self.jacobian.rows(rows.start, rows.len());
        let there = bench.residuals_of_log(&points, log);
        let before = &self.fit.residual[rows.clone()];
        let step_error = &self.fit.step_error[rows];
        let share = |after: Option<Residual>| {
            let Some(after) = after else { return 0.0 };
            let change = after.iter().zip(step_error).zip(before).map(|((a, e), b)| a + e - b);
            let change = DVector::from_iterator(before.len(), change);
            let seen = jacobian.tr_mul(&change);
            let own = change.norm_squared() - seen.dot(&self.factors.solve(&seen));
            let along = change.dot(&DVector::from_column_slice(before));
            if own > 0.0 { along * along / own } else { 0.0 }
        };
        let shares: Vec<f64> = there.into_iter().map(share).collect();
        let mut ranked: Vec<(f64, &Vec<f64>)> =
            shares.chunks(candidate.amplitudes.len()).map(|s| s.iter().sum()).zip(&candidate.starts).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        ranked.into_iter().take(FEW_STARTS).map(|(_, start)| start.clone()).collect()
    }

    fn probes(&self, bench: &Bench, index: usize, starts: &[Vec<f64>]) -> Vec<Probe> {
        let candidate = &bench.family.candidates()[index];
        let limit = candidate.amplitudes.iter().any(|&k| bench.family.knobs()[k].law == Law::Inverse);
        let sizes: &[f64] = if limit { &LIMITS } else { &PROBES };
        let mut probes = Vec::new();
        for shapes in starts {
            for &size in sizes {
                for &amplitude in &candidate.amplitudes {
                    probes.push(Probe { candidate: index, shapes: shapes.clone(), amplitude, size });
                }
            }
        }
        probes
    }

    fn point(&self, bench: &Bench, probe: &Probe) -> Vec<f64> {
        let mut u = self.fit.u.clone();
        for (&knob, &shape) in bench.family.candidates()[probe.candidate].shapes.iter().zip(&probe.shapes) {
            u[knob] = shape;
        }
        u[probe.amplitude] = bench.family.knobs()[probe.amplitude].clamp(probe.size);
        u
    }

    /// What each probe changes of the residual, per unit of its amplitude; nothing where it blows up.
    fn columns(&self, bench: &Bench, probes: &[Probe]) -> Vec<Option<DVector<f64>>> {
        let mut columns = Vec::with_capacity(probes.len());
        for batch in probes.chunks(BATCH) {
            let points: Vec<Vec<f64>> = batch.iter().map(|probe| self.point(bench, probe)).collect();
            let residuals = bench.residuals(&points, Logs::Learn, Step::Usual);
            for ((probe, point), residual) in batch.iter().zip(&points).zip(residuals) {
                let size = point[probe.amplitude];
                columns.push(residual.map(|residual| {
                    let after = corrected(residual, &self.fit.step_error);
                    let change = after.iter().zip(&self.fit.residual).map(|(a, b)| (a - b) / size);
                    DVector::from_iterator(after.len(), change)
                }));
            }
        }
        columns
    }

    /// The best amplitudes, and the answer of the base's parameters, in the linear picture that a group of probes gives.
    fn best_of(&self, bench: &Bench, probes: &[Probe], columns: &[Option<DVector<f64>>]) -> Option<Start> {
        let knobs = bench.family.knobs();
        let columns: Vec<&DVector<f64>> = columns.iter().map(Option::as_ref).collect::<Option<_>>()?;
        let k = columns.len();
        let residual = DVector::from_column_slice(&self.fit.residual);
        let seen: Vec<DVector<f64>> = columns.iter().map(|column| self.jacobian.tr_mul(column)).collect();
        let answered: Vec<DVector<f64>> = seen.iter().map(|seen| self.factors.solve(seen)).collect();
        let own = DMatrix::from_fn(k, k, |i, j| {
            let prior = if i == j { knobs[probes[i].amplitude].spread.powi(-2) } else { 0.0 };
            columns[i].dot(columns[j]) - seen[i].dot(&answered[j]) + prior
        });
        let pull = DVector::from_fn(k, |i, _| answered[i].dot(&self.gradient) - columns[i].dot(&residual));
        let wanted = own.cholesky()?.solve(&pull);
        let mut u = self.point(bench, &probes[0]);
        let mut amplitudes = DVector::zeros(k);
        for (i, probe) in probes.iter().enumerate() {
            let knob = &knobs[probe.amplitude];
            let reach = STRETCH * probe.size;
            let size = if knob.law == Law::Inverse { probe.size } else { wanted[i].clamp(-reach, reach) };
            u[probe.amplitude] = knob.clamp(size);
            amplitudes[i] = u[probe.amplitude];
        }
        if amplitudes.iter().all(|a| *a == 0.0) {
            return None;
        }
        let change: DVector<f64> = columns.iter().zip(amplitudes.iter()).map(|(c, a)| *c * *a).sum();
        let answer = self.factors.solve(&(&self.gradient + self.jacobian.tr_mul(&change)));
        for (i, &knob) in self.fit.active.iter().enumerate() {
            u[knob] = knobs[knob].clamp(u[knob] - answer[i]);
        }
        let moved =
            DVector::from_iterator(answer.len(), self.fit.active.iter().map(|&knob| u[knob] - self.fit.u[knob]));
        let promised = residual + change + self.jacobian * moved;
        let active = with(self.fit, &bench.family.candidates()[probes[0].candidate]);
        let cost = crate::fit::cost(knobs, &active, &u, promised.as_slice());
        Some(Start { candidate: probes[0].candidate, u, cost })
    }
}
