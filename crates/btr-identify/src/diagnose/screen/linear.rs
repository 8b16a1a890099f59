//! The linear approximation around a base that ranks candidates: the residual's change grows with the amplitude of a
//! probe, and the part that the base's parameters can produce as well is projected out.

use super::onset::{Onsets, WITHIN};
use super::start_point::{ProbeSizes, StartPoint, has_two_sides, is_searched, with};
use crate::diagnose::own;
use crate::fit::{FitPoint, Objective, rows_near, shared};
use crate::residual_model::Parametrisation;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

/// Largest amplitude for which a probe is extrapolated, in multiples of the probe's.
pub(super) const STRETCH: f64 = 4.0;
/// The same for a compliance, as a factor in both directions.
const NEAR: f64 = 2.0;
/// A base whose cost could fall by less than this share is at its optimum.
const AT_REST: f64 = 0.01;
/// Stiffness of parameters at a bound, relative to the information that the logs have about them.
const HELD: f64 = 1e9;
/// Size of a limit that is only reached where another parameter of its effect is on, in typical sizes.
const UNREACHED: f64 = 0.6;
/// Number of points that are simulated at once, and of starts that are probed at once; limits the memory.
const BATCH: usize = 48;
const STARTS: usize = 12;

/// The linear model of a base on some of the logs: how its parameters respond to any change of the residual.
pub(super) struct BasePoint<'a> {
    index: usize,
    logs: Vec<usize>,
    fit: &'a FitPoint,
    jacobian: &'a DMatrix<f64>,
    systems: Vec<NormalSystem>,
}

/// The normal equations around a base. A parameter at a bound may be held there by the missing effect, and leave it
/// once that is added: there is a system for each case.
struct NormalSystem {
    factors: Cholesky<f64, Dyn>,
    gradient: DVector<f64>,
}

/// A point to be simulated: a candidate with one of its amplitudes at some size.
#[derive(Clone)]
struct Probe {
    candidate: usize,
    shapes: Vec<f64>,
    amplitude: usize,
    size: f64,
}

/// The mirror images of probes, where their amplitudes have another side.
fn mirrored(objective: &Objective, probes: &[Probe]) -> Vec<Probe> {
    let two_sided = |probe: &Probe| objective.parameters()[probe.amplitude].bounds.0 < 0.0;
    let mirror =
        |probe: &Probe| Probe { size: if two_sided(probe) { -probe.size } else { probe.size }, ..probe.clone() };
    probes.iter().map(mirror).collect()
}

impl NormalSystem {
    fn new(normal: DMatrix<f64>, mut gradient: DVector<f64>, cost: f64) -> Option<Self> {
        let factors = normal.cholesky()?;
        // Near an optimum the remaining gradient lies along poorly determined directions; a step along it would only
        // add noise.
        if gradient.dot(&factors.solve(&gradient)) < AT_REST * cost {
            gradient.fill(0.0);
        }
        Some(NormalSystem { factors, gradient })
    }

    /// By how much the cost falls if the base's parameters alone adapt.
    fn falls_by(&self) -> f64 {
        self.gradient.dot(&self.factors.solve(&self.gradient))
    }
}

impl<'a> BasePoint<'a> {
    pub(super) fn new(objective: &Objective, index: usize, fit: &'a FitPoint, logs: Vec<usize>) -> Option<Self> {
        let jacobian = fit.jacobian.as_ref()?;
        let mut normal = objective.curvature(jacobian, &logs, &fit.active);
        let mut gradient = jacobian.tr_mul(&DVector::from_column_slice(&fit.residual));
        let mut held = Vec::new();
        for (k, &index) in fit.active.iter().enumerate() {
            let parameter = &objective.parameters()[index];
            let (u, weight) = (fit.u[index], parameter.prior_sd().powi(-2));
            normal[(k, k)] += weight;
            gradient[k] += weight * u;
            if (u <= parameter.bounds.0 && gradient[k] > 0.0) || (u >= parameter.bounds.1 && gradient[k] < 0.0) {
                held.push(k);
            }
        }
        let mut systems = vec![NormalSystem::new(normal.clone(), gradient.clone(), fit.cost)?];
        if !held.is_empty() {
            for k in held {
                normal[(k, k)] += HELD * (1.0 + normal[(k, k)]);
                gradient[k] = 0.0;
            }
            systems.push(NormalSystem::new(normal, gradient, fit.cost)?);
        }
        Some(BasePoint { index, logs, fit, jacobian, systems })
    }

    /// By how much the cost falls if the base's parameters alone adapt; those at their bounds stay there.
    pub(super) fn falls_by(&self) -> f64 {
        self.systems.last().map_or(0.0, NormalSystem::falls_by)
    }

    /// The predicted best points of candidates with the shapes of earlier predictions, probed on the side of their
    /// amplitudes: with slipping or lifting feet, the other side responds differently.
    pub(super) fn predicted(
        &self,
        objective: &Objective,
        starts: &[&StartPoint],
        sizes: &ProbeSizes,
    ) -> Vec<StartPoint> {
        let probes = |start: &&StartPoint| {
            let around = |amplitude: usize| Some(start.u[amplitude]);
            let mut probes = self.probes(objective, start.candidate, &[start.shapes(objective)], sizes, &around);
            probes.iter_mut().filter(|probe| start.u[probe.amplitude] < 0.0).for_each(|probe| probe.size = -probe.size);
            probes
        };
        let of_starts = |starts: &[&StartPoint]| {
            let each: Vec<Vec<Probe>> = starts.iter().map(probes).collect();
            let columns = self.columns(objective, &each.concat());
            self.best_points(objective, &each, &columns)
        };
        starts.chunks(STARTS).flat_map(of_starts).collect()
    }

    /// The predicted best points of candidates, each for the best of its starts; `onsets` are those of limits.
    /// Candidates that affect different channels share a simulation.
    pub(super) fn predicted_together(
        &self,
        objective: &Objective,
        offered: &[(usize, Vec<Vec<f64>>)],
        sizes: &ProbeSizes,
        onsets: &Onsets,
    ) -> Vec<StartPoint> {
        let onset = |amplitude: usize| onsets.get(&amplitude).copied();
        let candidates = objective.candidates();
        let mut predicted = Vec::new();
        for kind in offered.chunk_by(|(a, _), (b, _)| candidates[*a].effect == candidates[*b].effect) {
            let probes = |(candidate, starts): &(usize, Vec<Vec<f64>>)| {
                let mut probes = self.probes(objective, *candidate, starts, sizes, &onset);
                if has_two_sides(objective, &candidates[*candidate]) {
                    probes.extend(mirrored(objective, &probes));
                }
                probes
            };
            let each: Vec<Vec<Probe>> = kind.iter().map(probes).collect();
            let all: Vec<&Probe> = each.iter().flatten().collect();
            let columns = self.columns_together(objective, &all);
            predicted.extend(self.best_points(objective, &each, &columns));
        }
        predicted
    }

    /// The predicted best point of each candidate from its probes, whose columns follow one another.
    fn best_points(
        &self,
        objective: &Objective,
        each: &[Vec<Probe>],
        mut columns: &[Option<DVector<f64>>],
    ) -> Vec<StartPoint> {
        let split = |probes: &'_ Vec<Probe>| columns.split_off(..probes.len()).unwrap_or_default();
        let of_each: Vec<&[Option<DVector<f64>>]> = each.iter().map(split).collect();
        let best =
            |(probes, columns): (&Vec<Probe>, &[Option<DVector<f64>>])| self.best_point(objective, probes, columns);
        each.par_iter().zip(of_each).filter_map(best).collect()
    }

    /// The predicted best point of a candidate from its probes.
    fn best_point(
        &self,
        objective: &Objective,
        probes: &[Probe],
        columns: &[Option<DVector<f64>>],
    ) -> Option<StartPoint> {
        // Probes of one start and one size belong together: one column for each amplitude.
        let amplitudes = objective.candidates()[probes.first()?.candidate].amplitudes.len();
        let groups = probes.chunks(amplitudes).zip(columns.chunks(amplitudes));
        let found = groups.flat_map(|(probes, columns)| {
            self.systems.iter().filter_map(move |system| self.best_of(objective, system, probes, columns))
        });
        found.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// The probes of a candidate from each of its starts; those of limits are multiples of where `limit` has them.
    fn probes(
        &self,
        objective: &Objective,
        index: usize,
        starts: &[Vec<f64>],
        sizes: &ProbeSizes,
        limit: &dyn Fn(usize) -> Option<f64>,
    ) -> Vec<Probe> {
        let candidate = &objective.candidates()[index];
        let is = |amplitude: usize, law| objective.parameters()[amplitude].law == law;
        let has = |law| candidate.amplitudes.iter().any(|&k| is(k, law));
        let sizes = match (has(Parametrisation::Inverse), has(Parametrisation::Compliance)) {
            _ if is_searched(objective, index) => &[1.0],
            (true, _) => sizes.limits,
            (false, true) => sizes.compliances,
            (false, false) => sizes.amplitudes,
        };
        let sized = |amplitude: usize, size: f64| match is(amplitude, Parametrisation::Inverse) {
            _ if objective.parameters()[amplitude].is_searched() => limit(amplitude),
            true => limit(amplitude).map(|unit| unit * size).filter(|size| *size < WITHIN.1),
            false => Some(size),
        };
        let is_reached = |size: &&f64| candidate.amplitudes.iter().any(|&k| sized(k, **size).is_some());
        let mut probes = Vec::new();
        for shapes in starts {
            for &size in sizes.iter().filter(is_reached) {
                for &amplitude in &candidate.amplitudes {
                    let size = sized(amplitude, size).unwrap_or(UNREACHED);
                    probes.push(Probe { candidate: index, shapes: shapes.clone(), amplitude, size });
                }
            }
        }
        probes
    }

    fn point(&self, objective: &Objective, probes: &[&Probe]) -> Vec<f64> {
        let mut u = self.fit.u.clone();
        for probe in probes {
            for (&parameter, &shape) in objective.candidates()[probe.candidate].shapes.iter().zip(&probe.shapes) {
                u[parameter] = shape;
            }
            u[probe.amplitude] = objective.parameters()[probe.amplitude].clamp(probe.size);
        }
        u
    }

    /// The change of the residual by each probe, per unit of its amplitude; `None` where it cannot be simulated: the
    /// candidate is then not ranked by that probe.
    fn columns(&self, objective: &Objective, probes: &[Probe]) -> Vec<Option<DVector<f64>>> {
        let mut columns = Vec::with_capacity(probes.len());
        for batch in probes.chunks(BATCH) {
            let points: Vec<Vec<f64>> = batch.iter().map(|probe| self.point(objective, &[probe])).collect();
            let residuals = objective.residuals_of(&points, &self.logs);
            let column = |(k, probe): (usize, &Probe)| {
                let residual = residuals[k].as_ref().ok()?;
                Some(self.column(objective, residual, points[k][probe.amplitude], &[]))
            };
            columns.par_extend(batch.par_iter().enumerate().map(column));
        }
        columns
    }

    /// The same with several probes in one simulation: each column is restricted to the channels of its candidate.
    fn columns_together(&self, objective: &Objective, probes: &[&Probe]) -> Vec<Option<DVector<f64>>> {
        let near = |probe: &Probe| objective.description.channels_of(probe.candidate);
        let groups = shared(probes.iter().map(|probe| near(probe)));
        let mut columns = vec![None; probes.len()];
        for batch in groups.chunks(BATCH) {
            let point = |group: &Vec<usize>| {
                let probes: Vec<&Probe> = group.iter().map(|&i| probes[i]).collect();
                self.point(objective, &probes)
            };
            let points: Vec<Vec<f64>> = batch.iter().map(point).collect();
            let residuals = objective.residuals_of(&points, &self.logs);
            let of_group = |(k, group): (usize, &Vec<usize>)| {
                let residual = residuals[k].as_ref().ok()?;
                let column =
                    |&i: &usize| self.column(objective, residual, points[k][probes[i].amplitude], near(probes[i]));
                Some(group.iter().copied().zip(group.iter().map(column)).collect::<Vec<_>>())
            };
            let found: Vec<_> = batch.par_iter().enumerate().filter_map(of_group).collect();
            found.into_iter().flatten().for_each(|(i, column)| columns[i] = Some(column));
        }
        columns
    }

    /// The difference of a residual from the base's, per unit of an amplitude of this size; zero in other channels than
    /// those that are `near`, unless these are none.
    fn column(&self, objective: &Objective, residual: &[f64], size: f64, near: &[String]) -> DVector<f64> {
        let (mut column, mut first) = (DVector::zeros(residual.len()), 0);
        for log in self.logs.iter().map(|&log| &objective.description.logs[log]) {
            for row in rows_near(log, near).into_iter().flatten().map(|row| first + row) {
                column[row] = (residual[row] + self.fit.step_error[row] - self.fit.residual[row]) / size;
            }
            first += log.rows();
        }
        column
    }

    /// The best amplitudes, and the response of the base's parameters, in the linear model of a group of probes.
    fn best_of(
        &self,
        objective: &Objective,
        system: &NormalSystem,
        probes: &[Probe],
        columns: &[Option<DVector<f64>>],
    ) -> Option<StartPoint> {
        let parameters = objective.parameters();
        let columns: Vec<&DVector<f64>> = columns.iter().map(Option::as_ref).collect::<Option<_>>()?;
        let k = columns.len();
        let residual = DVector::from_column_slice(&self.fit.residual);
        let overlap: Vec<DVector<f64>> = columns.iter().map(|column| self.jacobian.tr_mul(column)).collect();
        let response: Vec<DVector<f64>> = overlap.iter().map(|overlap| system.factors.solve(overlap)).collect();
        let reduced = DMatrix::from_fn(k, k, |i, j| {
            let prior = if i == j { parameters[probes[i].amplitude].spread.powi(-2) } else { 0.0 };
            columns[i].dot(columns[j]) - overlap[i].dot(&response[j]) + prior
        });
        let downhill = DVector::from_fn(k, |i, _| response[i].dot(&system.gradient) - columns[i].dot(&residual));
        let optimum = reduced.cholesky()?.solve(&downhill);
        let mut u = self.point(objective, &[&probes[0]]);
        let mut amplitudes = DVector::zeros(k);
        for (i, probe) in probes.iter().enumerate() {
            let parameter = &parameters[probe.amplitude];
            let reach = STRETCH * probe.size.abs();
            let size = match parameter.law {
                Parametrisation::Inverse | Parametrisation::Stair | Parametrisation::Switch => probe.size,
                // A soft joint rings at another frequency than a stiffer one: only near the probe is it linear.
                Parametrisation::Compliance => optimum[i].clamp(probe.size / NEAR, probe.size * NEAR),
                Parametrisation::Linear | Parametrisation::Exponential => optimum[i].clamp(-reach, reach),
            };
            u[probe.amplitude] = parameter.clamp(size);
            amplitudes[i] = u[probe.amplitude];
        }
        if amplitudes.iter().all(|a| *a == 0.0) {
            return None;
        }
        let change: DVector<f64> = columns.iter().zip(amplitudes.iter()).map(|(c, a)| *c * *a).sum();
        let adaptation = system.factors.solve(&(&system.gradient + self.jacobian.tr_mul(&change)));
        let adapts = own::adapting(objective, probes[0].candidate);
        for (i, &parameter) in self.fit.active.iter().enumerate().filter(|(_, parameter)| adapts(**parameter)) {
            u[parameter] = parameters[parameter].clamp(u[parameter] - adaptation[i]);
        }
        let moved = DVector::from_iterator(
            adaptation.len(),
            self.fit.active.iter().map(|&parameter| u[parameter] - self.fit.u[parameter]),
        );
        let predicted = residual + change + self.jacobian * moved;
        let active = with(self.fit, &objective.candidates()[probes[0].candidate]);
        let cost = crate::fit::cost(parameters, &active, &u, predicted.as_slice());
        Some(StartPoint { candidate: probes[0].candidate, base: self.index, u, cost })
    }
}
