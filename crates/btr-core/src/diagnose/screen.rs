//! Which effects are worth fitting: every candidate is tried with finite probes, while all that is in doubt may adapt.
//!
//! Probes are finite because some effects have no slope at zero (backlash, delay, a limit). What the base's parameters can do
//! as well is projected out, so that only what they cannot do counts for a candidate. A first glance takes the log with the
//! largest error alone; what is promising there is probed on all of them.

use crate::family::{Candidate, Law};
use crate::fit::{Bench, Fit, Logs, corrected, rows_near, shared};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// How large probes are.
struct Sizes {
    /// Amplitudes, in typical sizes.
    amplitudes: &'static [f64],
    /// Limits act from some threshold on and are probed around it; they are not scaled.
    limits: &'static [f64],
}

/// For the first glance, and for a closer look.
const GLANCE: Sizes = Sizes { amplitudes: &[0.5], limits: &[0.15, 0.3, 0.6] };
const LOOK: Sizes = Sizes { amplitudes: &[0.3, 1.5], limits: &[0.12, 0.18, 0.27, 0.4, 0.6, 1.0] };
/// An amplitude so many times the probe's is as far as the probe is believed.
const STRETCH: f64 = 4.0;
/// How many candidates survive the glance at one log.
const GLANCED: usize = 16;
/// How many candidates are simulated where their probes promise most.
const VERIFIED: usize = 10;
/// How many of those that promise most go on however they fare when they are simulated.
const PROMISED: usize = 4;
/// How many are simulated where the glance alone saw them best: all logs together may hide what one log shows.
const STRIKING: usize = 3;
/// Which shares of the way to a promise are simulated.
const SHARES: [f64; 2] = [1.0, 0.3];
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
    /// Index of the base it goes on from.
    pub base: usize,
    /// The point.
    pub u: Vec<f64>,
    /// The cost there: promised, then simulated.
    pub cost: f64,
}

/// The base around its optimum, as some of the logs show it: what its own parameters can do about any change of the residual.
struct Base<'a> {
    index: usize,
    logs: Vec<usize>,
    fit: &'a Fit,
    jacobian: &'a DMatrix<f64>,
    pictures: Vec<Picture>,
}

/// The normal equations around a base. What stands at a bound may be held there by what is missing, or come off it once that is
/// added: there is a picture of both.
struct Picture {
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
    let (candidates, logs) = (bench.family.candidates(), bench.logs(Logs::Learn).len());
    let probes = |candidate: &Candidate| candidate.starts.len() * candidate.amplitudes.len() * GLANCE.amplitudes.len();
    let all: Vec<usize> = (0..candidates.len()).collect();
    let kinds = all.chunk_by(|&a, &b| candidates[a].effect == candidates[b].effect);
    let glances =
        kinds.map(|kind| probes(&candidates[kind[0]]) * shared(kind.iter().map(|&c| bench.family.near(c))).len());
    glances.sum::<usize>() + logs * LOOK.amplitudes.len() * GLANCED.min(candidates.len())
}

/// Those of the candidates `offered` that promise most, best first, with the costs that were really simulated. Each is seen from
/// all bases and goes on from the one where it promises most: what is in doubt may have gone astray to make up for it.
pub(super) fn screen(bench: &Bench, bases: &mut [Fit], offered: &[usize]) -> Vec<Start> {
    for (index, base) in bases.iter_mut().enumerate() {
        if index == 0 { base.differentiate_finely(bench) } else { base.differentiate(bench) }
    }
    let Some((log, rows)) = bases.first().and_then(|base| bench.worst_logs(&base.residual, 1).pop()) else {
        return Vec::new();
    };
    let all = |&candidate: &usize| (candidate, bench.family.candidates()[candidate].starts.clone());
    let offered: Vec<(usize, Vec<Vec<f64>>)> = offered.iter().map(all).collect();
    let glance = |(index, base): (usize, &Fit)| {
        let there = base.in_rows(rows.clone());
        let seen = Base::new(bench, index, &there, vec![log]);
        seen.map_or_else(Vec::new, |seen| seen.promising_together(bench, &offered, &GLANCE))
    };
    let glanced = best(bases.iter().enumerate().flat_map(glance).collect(), GLANCED);
    // Everyone is looked at from the first base, and from the one where it promised most.
    let look = |(index, base): (usize, &Fit)| {
        let own = glanced.iter().filter(|start| index == 0 || start.base == index);
        let own: Vec<(usize, Vec<Vec<f64>>)> = own.map(|s| (s.candidate, vec![s.shapes(bench)])).collect();
        let seen = Base::new(bench, index, base, bench.logs(Logs::Learn).to_vec());
        seen.map_or_else(Vec::new, |seen| seen.promising(bench, &own, &LOOK))
    };
    let mut promising = best(bases.iter().enumerate().flat_map(look).collect(), VERIFIED);
    promising.extend(glanced.iter().take(STRIKING).cloned());
    verify(bench, bases, promising)
}

/// The best of each candidate, best first, at most so many.
fn best(mut starts: Vec<Start>, most: usize) -> Vec<Start> {
    starts.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let mut kept: Vec<Start> = Vec::new();
    for start in starts {
        if kept.len() < most && kept.iter().all(|other| other.candidate != start.candidate) {
            kept.push(start);
        }
    }
    kept
}

impl Start {
    /// Part of the way from a base to here; shapes have nowhere to come from.
    fn partly(&self, bench: &Bench, base: &Fit, share: f64) -> Vec<f64> {
        let mut u: Vec<f64> = base.u.iter().zip(&self.u).map(|(from, to)| from + share * (to - from)).collect();
        bench.family.candidates()[self.candidate].shapes.iter().for_each(|&k| u[k] = self.u[k]);
        u
    }

    fn shapes(&self, bench: &Bench) -> Vec<f64> {
        bench.family.candidates()[self.candidate].shapes.iter().map(|&k| self.u[k]).collect()
    }
}

/// Simulates every promise, all of it and a part of it: a picture drawn with straight lines may promise too much. In the order of
/// what came out, but those that promise most are not lost for it.
fn verify(bench: &Bench, bases: &[Fit], promising: Vec<Start>) -> Vec<Start> {
    let partly = |start: &Start| SHARES.map(|share| start.partly(bench, &bases[start.base], share));
    let points: Vec<Vec<f64>> = promising.iter().flat_map(partly).collect();
    let residuals = bench.residuals(&points, Logs::Learn);
    let cost = |start: &Start, u: &[f64], residual: Vec<f64>| {
        let base = &bases[start.base];
        let active = with(base, &bench.family.candidates()[start.candidate]);
        crate::fit::cost(bench.family.knobs(), &active, u, &corrected(residual, &base.step_error))
    };
    let mut simulated = points.into_iter().zip(residuals);
    let best = |start: Start| {
        let tried = simulated.by_ref().take(SHARES.len()).filter_map(|(u, residual)| {
            let cost = cost(&start, &u, residual?);
            Some(Start { cost, u, ..start.clone() })
        });
        tried.min_by(|a, b| a.cost.total_cmp(&b.cost))
    };
    let all: Vec<Start> = promising.into_iter().filter_map(best).collect();
    let beaten = |start: &&Start| all.iter().any(|o| o.candidate == start.candidate && o.cost < start.cost);
    let mut verified: Vec<Start> = all.iter().filter(|start| !beaten(start)).cloned().collect();
    let rest = verified.len().min(PROMISED);
    verified[rest..].sort_by(|a, b| a.cost.total_cmp(&b.cost));
    verified
}

/// The base's free knobs and a candidate's.
pub(super) fn with(base: &Fit, candidate: &Candidate) -> Vec<usize> {
    base.active.iter().copied().chain(candidate.knobs()).collect()
}

impl Picture {
    fn new(normal: DMatrix<f64>, mut gradient: DVector<f64>, cost: f64) -> Option<Self> {
        let factors = normal.cholesky()?;
        // What is left to win at an optimum lies along directions that hardly matter; going there would only blur the view.
        if gradient.dot(&factors.solve(&gradient)) < AT_REST * cost {
            gradient.fill(0.0);
        }
        Some(Picture { factors, gradient })
    }
}

impl<'a> Base<'a> {
    fn new(bench: &Bench, index: usize, fit: &'a Fit, logs: Vec<usize>) -> Option<Self> {
        let jacobian = fit.jacobian.as_ref()?;
        let mut normal = jacobian.tr_mul(jacobian);
        let mut gradient = jacobian.tr_mul(&DVector::from_column_slice(&fit.residual));
        let mut held = Vec::new();
        for (k, &index) in fit.active.iter().enumerate() {
            let knob = &bench.family.knobs()[index];
            let (u, weight) = (fit.u[index], knob.spread.powi(-2));
            normal[(k, k)] += weight;
            gradient[k] += weight * u;
            if (u <= knob.bounds.0 && gradient[k] > 0.0) || (u >= knob.bounds.1 && gradient[k] < 0.0) {
                held.push(k);
            }
        }
        let mut pictures = vec![Picture::new(normal.clone(), gradient.clone(), fit.cost)?];
        if !held.is_empty() {
            for k in held {
                normal[(k, k)] += HELD * (1.0 + normal[(k, k)]);
                gradient[k] = 0.0;
            }
            pictures.push(Picture::new(normal, gradient, fit.cost)?);
        }
        Some(Base { index, logs, fit, jacobian, pictures })
    }

    /// What candidates promise, each at the best of its starts.
    fn promising(&self, bench: &Bench, offered: &[(usize, Vec<Vec<f64>>)], sizes: &Sizes) -> Vec<Start> {
        let promise = |(candidate, starts): &(usize, Vec<Vec<f64>>)| {
            let probes = self.probes(bench, *candidate, starts, sizes);
            let columns = self.columns(bench, &probes);
            self.promise(bench, &probes, &columns)
        };
        offered.iter().filter_map(promise).collect()
    }

    /// The same where candidates that are felt in different places are tried in one simulation.
    fn promising_together(&self, bench: &Bench, offered: &[(usize, Vec<Vec<f64>>)], sizes: &Sizes) -> Vec<Start> {
        let candidates = bench.family.candidates();
        let mut promising = Vec::new();
        for kind in offered.chunk_by(|(a, _), (b, _)| candidates[*a].effect == candidates[*b].effect) {
            let each: Vec<Vec<Probe>> =
                kind.iter().map(|(candidate, starts)| self.probes(bench, *candidate, starts, sizes)).collect();
            let all: Vec<&Probe> = each.iter().flatten().collect();
            let mut columns = self.columns_together(bench, &all).into_iter();
            for probes in &each {
                let own: Vec<Option<DVector<f64>>> = columns.by_ref().take(probes.len()).collect();
                promising.extend(self.promise(bench, probes, &own));
            }
        }
        promising
    }

    /// The best point of a candidate, by its probes.
    fn promise(&self, bench: &Bench, probes: &[Probe], columns: &[Option<DVector<f64>>]) -> Option<Start> {
        // Probes of one start and one size belong together: one column for each amplitude.
        let amplitudes = bench.family.candidates()[probes.first()?.candidate].amplitudes.len();
        let groups = probes.chunks(amplitudes).zip(columns.chunks(amplitudes));
        let found = groups.flat_map(|(probes, columns)| {
            self.pictures.iter().filter_map(move |picture| self.best_of(bench, picture, probes, columns))
        });
        found.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    fn probes(&self, bench: &Bench, index: usize, starts: &[Vec<f64>], sizes: &Sizes) -> Vec<Probe> {
        let candidate = &bench.family.candidates()[index];
        let limit = candidate.amplitudes.iter().any(|&k| bench.family.knobs()[k].law == Law::Inverse);
        let sizes = if limit { sizes.limits } else { sizes.amplitudes };
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

    fn point(&self, bench: &Bench, probes: &[&Probe]) -> Vec<f64> {
        let mut u = self.fit.u.clone();
        for probe in probes {
            for (&knob, &shape) in bench.family.candidates()[probe.candidate].shapes.iter().zip(&probe.shapes) {
                u[knob] = shape;
            }
            u[probe.amplitude] = bench.family.knobs()[probe.amplitude].clamp(probe.size);
        }
        u
    }

    /// What each probe changes of the residual, per unit of its amplitude; nothing where it blows up.
    fn columns(&self, bench: &Bench, probes: &[Probe]) -> Vec<Option<DVector<f64>>> {
        let mut columns = Vec::with_capacity(probes.len());
        for batch in probes.chunks(BATCH) {
            let points: Vec<Vec<f64>> = batch.iter().map(|probe| self.point(bench, &[probe])).collect();
            let residuals = bench.residuals_of(&points, &self.logs);
            for ((probe, point), residual) in batch.iter().zip(&points).zip(residuals) {
                let size = point[probe.amplitude];
                columns.push(residual.map(|residual| self.column(residual, size)));
            }
        }
        columns
    }

    /// The same, several in one simulation: each column as far as its candidate's own channels go.
    fn columns_together(&self, bench: &Bench, probes: &[&Probe]) -> Vec<Option<DVector<f64>>> {
        let near = |probe: &Probe| bench.family.near(probe.candidate);
        let shots = shared(probes.iter().map(|probe| near(probe)));
        let mut columns = vec![None; probes.len()];
        for batch in shots.chunks(BATCH) {
            let point = |shot: &Vec<usize>| {
                let probes: Vec<&Probe> = shot.iter().map(|&i| probes[i]).collect();
                self.point(bench, &probes)
            };
            let points: Vec<Vec<f64>> = batch.iter().map(point).collect();
            let residuals = bench.residuals_of(&points, &self.logs);
            for ((shot, point), residual) in batch.iter().zip(&points).zip(residuals) {
                let Some(residual) = residual else { continue };
                for &i in shot {
                    let column = self.column(residual.clone(), point[probes[i].amplitude]);
                    columns[i] = Some(self.only_near(bench, column, near(probes[i])));
                }
            }
        }
        columns
    }

    /// The change that a residual is of the base's, per unit of an amplitude of this size.
    fn column(&self, residual: Vec<f64>, size: f64) -> DVector<f64> {
        let after = corrected(residual, &self.fit.step_error);
        let change = after.iter().zip(&self.fit.residual).map(|(a, b)| (a - b) / size);
        DVector::from_iterator(after.len(), change)
    }

    /// A column without what is not of these channels.
    fn only_near(&self, bench: &Bench, column: DVector<f64>, near: &[String]) -> DVector<f64> {
        if near.is_empty() {
            return column;
        }
        let (mut only, mut first) = (DVector::zeros(column.len()), 0);
        for log in self.logs.iter().map(|&log| &bench.family.logs()[log]) {
            for row in rows_near(log, near).into_iter().flatten() {
                only[first + row] = column[first + row];
            }
            first += log.rows();
        }
        only
    }

    /// The best amplitudes, and the answer of the base's parameters, in the linear picture that a group of probes gives.
    fn best_of(
        &self,
        bench: &Bench,
        picture: &Picture,
        probes: &[Probe],
        columns: &[Option<DVector<f64>>],
    ) -> Option<Start> {
        let knobs = bench.family.knobs();
        let columns: Vec<&DVector<f64>> = columns.iter().map(Option::as_ref).collect::<Option<_>>()?;
        let k = columns.len();
        let residual = DVector::from_column_slice(&self.fit.residual);
        let seen: Vec<DVector<f64>> = columns.iter().map(|column| self.jacobian.tr_mul(column)).collect();
        let answered: Vec<DVector<f64>> = seen.iter().map(|seen| picture.factors.solve(seen)).collect();
        let own = DMatrix::from_fn(k, k, |i, j| {
            let prior = if i == j { knobs[probes[i].amplitude].spread.powi(-2) } else { 0.0 };
            columns[i].dot(columns[j]) - seen[i].dot(&answered[j]) + prior
        });
        let pull = DVector::from_fn(k, |i, _| answered[i].dot(&picture.gradient) - columns[i].dot(&residual));
        let wanted = own.cholesky()?.solve(&pull);
        let mut u = self.point(bench, &[&probes[0]]);
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
        let answer = picture.factors.solve(&(&picture.gradient + self.jacobian.tr_mul(&change)));
        for (i, &knob) in self.fit.active.iter().enumerate() {
            u[knob] = knobs[knob].clamp(u[knob] - answer[i]);
        }
        let moved =
            DVector::from_iterator(answer.len(), self.fit.active.iter().map(|&knob| u[knob] - self.fit.u[knob]));
        let promised = residual + change + self.jacobian * moved;
        let active = with(self.fit, &bench.family.candidates()[probes[0].candidate]);
        let cost = crate::fit::cost(knobs, &active, &u, promised.as_slice());
        Some(Start { candidate: probes[0].candidate, base: self.index, u, cost })
    }
}
