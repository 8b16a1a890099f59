//! Drafts of laws: orthogonal matching pursuit in the linear model from probes of the terms.

use crate::fit::{FitPoint, Objective};
use btr_core::signal::fft::peak_rate;
use btr_core::signal::stats::autocorrelation_time;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::ops::Range;

/// The most terms of a law.
const MOST_TERMS: usize = 3;
/// Number of logs on which terms are probed: those with the largest errors.
const PROBED_LOGS: usize = 2;
/// The size of a probe, in typical sizes.
const PROBE: f64 = 0.3;
/// Share to which a further term must lower the cost.
const WORTH: f64 = 0.9;

/// Which terms a law may have.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum LawKind {
    OfAnyTerms,
    /// Without oscillations in time or position, and thresholds: these fit one log and not the next now and then.
    OfPlainTerms,
}

/// A law in the linear model of the probes, with its predicted cost.
pub(super) struct Draft {
    pub(super) terms: Vec<DraftTerm>,
    pub(super) cost: f64,
}

/// A term of a draft: its shapes and amplitudes as coordinates.
#[derive(Clone)]
pub(super) struct DraftTerm {
    pub(super) feature: usize,
    pub(super) shapes: Vec<f64>,
    pub(super) amplitudes: Vec<f64>,
}

/// A term at some shapes, given as coordinates.
struct ShapedTerm {
    feature: usize,
    shapes: Vec<f64>,
}

/// A term with its shapes, and its columns among those of its place.
struct TermTrial {
    feature: usize,
    shapes: Vec<f64>,
    columns: Range<usize>,
}

/// The linear model of a base on the logs with the largest errors.
pub(super) struct LinearLawModel<'a> {
    objective: &'a Objective<'a>,
    base: &'a FitPoint,
    logs: Vec<(usize, Range<usize>)>,
    residual: DVector<f64>,
    jacobian: DMatrix<f64>,
    factors: Cholesky<f64, Dyn>,
}

impl<'a> LinearLawModel<'a> {
    pub(super) fn new(objective: &'a Objective<'a>, base: &'a FitPoint) -> Option<Self> {
        let logs = objective.worst_logs(&base.residual, PROBED_LOGS);
        let rows: Vec<usize> = logs.iter().flat_map(|(_, rows)| rows.clone()).collect();
        let residual = DVector::from_iterator(rows.len(), rows.iter().map(|&row| base.residual[row]));
        let jacobian = base.jacobian.as_ref()?.select_rows(&rows);
        let mut normal = jacobian.tr_mul(&jacobian);
        for (k, &parameter) in base.active.iter().enumerate() {
            normal[(k, k)] += objective.parameters()[parameter].prior_sd().powi(-2);
        }
        Some(LinearLawModel { objective, base, logs, residual, jacobian, factors: normal.cholesky()? })
    }

    /// Columns with the response of the base's parameters projected out.
    fn projected(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        columns - &self.jacobian * self.factors.solve(&self.jacobian.tr_mul(columns))
    }

    /// The best law of a place, of plain terms alone or of those with a shape as well.
    pub(super) fn draft(&self, place: Range<usize>, kind: LawKind) -> Option<Draft> {
        let features = self.objective.law_terms();
        let (mut trials, mut columns) = (Vec::new(), Vec::new());
        let is_offered = |i: &usize| kind == LawKind::OfAnyTerms || features[*i].term.shapes.is_empty();
        let steady: Vec<ShapedTerm> = place
            .clone()
            .filter(|&i| features[i].swings.is_none())
            .filter(is_offered)
            .flat_map(|i| {
                let starts = features[i].term.starts.iter();
                starts.map(move |shapes| ShapedTerm { feature: i, shapes: shapes.clone() })
            })
            .collect();
        self.probe(&steady, &mut trials, &mut columns);
        let rate = |i: usize| {
            let plain = trials.iter().find(|trial| Some(trial.feature) == features[i].swings)?;
            let parameter = &self.objective.parameters()[*features[i].term.shapes.first()?];
            let rate = self.rate(&columns[plain.columns.start])?;
            Some(ShapedTerm { feature: i, shapes: vec![parameter.clamp(parameter.coordinate(rate))] })
        };
        let oscillating: Vec<ShapedTerm> = place.filter(is_offered).filter_map(rate).collect();
        self.probe(&oscillating, &mut trials, &mut columns);
        if columns.is_empty() {
            return None;
        }
        let columns = DMatrix::from_columns(&columns);
        self.pursue(&trials, &columns)
    }

    /// Simulates terms of given shapes, and keeps the columns of those that can be simulated.
    fn probe(&self, starts: &[ShapedTerm], trials: &mut Vec<TermTrial>, columns: &mut Vec<DVector<f64>>) {
        let (features, parameters) = (self.objective.law_terms(), self.objective.parameters());
        let mut points = Vec::new();
        for ShapedTerm { feature, shapes } in starts {
            let term = &features[*feature].term;
            for &amplitude in &term.amplitudes {
                let mut u = self.base.u.clone();
                term.shapes.iter().zip(shapes).for_each(|(&k, &x)| u[k] = parameters[k].clamp(x));
                u[amplitude] = PROBE;
                points.push(u);
            }
        }
        let mut responses = self.respond(&points).into_iter();
        for ShapedTerm { feature, shapes } in starts {
            let term_columns: Vec<Option<DVector<f64>>> =
                responses.by_ref().take(features[*feature].term.amplitudes.len()).collect();
            if let Some(term_columns) = term_columns.into_iter().collect::<Option<Vec<_>>>() {
                let start = columns.len();
                columns.extend(term_columns);
                trials.push(TermTrial { feature: *feature, shapes: shapes.clone(), columns: start..columns.len() });
            }
        }
    }

    /// The change of the residual at each point, per unit of the probe.
    fn respond(&self, points: &[Vec<f64>]) -> Vec<Option<DVector<f64>>> {
        let mut changes: Vec<Option<Vec<f64>>> = vec![Some(Vec::new()); points.len()];
        for (log, rows) in &self.logs {
            for (change, after) in changes.iter_mut().zip(self.objective.residuals_of(points, &[*log])) {
                let Some((change, after)) = change.as_mut().zip(after.ok()) else {
                    *change = None;
                    continue;
                };
                let before = self.base.residual[rows.clone()].iter().zip(&self.base.step_error[rows.clone()]);
                change.extend(after.iter().zip(before).map(|(after, (r, e))| (after - (r - e)) / PROBE));
            }
        }
        changes.into_iter().map(|change| change.map(DVector::from_vec)).collect()
    }

    /// The rate, in rad/s, at which a term should oscillate: the peak of the spectrum of its response times the
    /// residual that it leaves. A slow oscillation of a term modulates its response alike.
    fn rate(&self, response: &DVector<f64>) -> Option<f64> {
        let norm = response.norm_squared();
        let share = if norm > 0.0 { response.dot(&self.residual) / norm } else { return None };
        let left = (&self.residual - share * response).component_mul(response);
        let (mut samples, mut row, mut step_s) = (Vec::new(), 0, 0.0_f64);
        for (log, rows) in &self.logs {
            let clock = self.objective.description.clocks_s[*log].as_slice();
            let last_s = clock.last()?;
            step_s = step_s.max(last_s / clock.len() as f64);
            // All channels of a log are on its clock, one after the other.
            samples
                .extend(clock.iter().cycle().take(rows.len()).copied().zip(left.rows(row, rows.len()).iter().copied()));
            row += rows.len();
        }
        peak_rate(&samples, step_s)
    }

    /// Orthogonal matching pursuit; the criterion determines the number of terms.
    fn pursue(&self, trials: &[TermTrial], columns: &DMatrix<f64>) -> Option<Draft> {
        let projected = self.projected(columns);
        let residual = self.projected(&DMatrix::from_column_slice(self.residual.len(), 1, self.residual.as_slice()));
        let normal = NormalEquations {
            gram: columns.tr_mul(&projected) + DMatrix::identity(columns.ncols(), columns.ncols()) * 1e-3,
            gradient: projected.tr_mul(&self.residual),
            squares: self.residual.dot(&residual.column(0)),
        };
        let mut drafts: Vec<(Vec<&TermTrial>, Solved)> = Vec::new();
        while drafts.len() < MOST_TERMS {
            let chosen = drafts.last().map_or(Vec::new(), |(chosen, _)| chosen.clone());
            let with = |trial| chosen.iter().copied().chain([trial]).collect::<Vec<&TermTrial>>();
            let new = trials.iter().filter(|trial| chosen.iter().all(|c| c.feature != trial.feature));
            let solved = new.filter_map(|trial| Some((with(trial), normal.solve(&with(trial))?)));
            let Some(best) = solved.min_by(|(_, a), (_, b)| a.cost.total_cmp(&b.cost)) else { break };
            if drafts.last().is_some_and(|(_, before)| best.1.cost > WORTH * before.cost) {
                break;
            }
            drafts.push(best);
        }
        let (_, last) = drafts.last()?;
        let left = residual.column(0)
            + last.columns.iter().zip(&last.amplitudes).map(|(&c, a)| projected.column(c) * *a).sum::<DVector<f64>>();
        let samples: usize = self.logs.iter().map(|(log, _)| self.objective.description.logs[*log].present).sum();
        let memory = autocorrelation_time(left.as_slice());
        let scale = memory * (last.cost / samples.max(1) as f64).max(1.0);
        let price = (samples as f64 / memory).ln().max(1.0);
        let criterion = |chosen: &[&TermTrial], solved: &Solved| {
            let shapes: usize = chosen.iter().map(|trial| trial.shapes.len()).sum();
            solved.cost / scale + price * (solved.columns.len() + shapes) as f64
        };
        let (chosen, solved) =
            drafts.into_iter().min_by(|a, b| criterion(&a.0, &a.1).total_cmp(&criterion(&b.0, &b.1)))?;
        let mut amplitudes = solved.amplitudes.into_iter();
        let term = |trial: &TermTrial| DraftTerm {
            feature: trial.feature,
            shapes: trial.shapes.clone(),
            amplitudes: amplitudes.by_ref().take(trial.columns.len()).collect(),
        };
        Some(Draft { terms: chosen.into_iter().map(term).collect(), cost: solved.cost })
    }
}

/// Normal equations of all columns of a place.
struct NormalEquations {
    gram: DMatrix<f64>,
    gradient: DVector<f64>,
    squares: f64,
}

/// The best amplitudes of some columns, and the remaining cost.
struct Solved {
    columns: Vec<usize>,
    amplitudes: Vec<f64>,
    cost: f64,
}

impl NormalEquations {
    fn solve(&self, chosen: &[&TermTrial]) -> Option<Solved> {
        let columns: Vec<usize> = chosen.iter().flat_map(|trial| trial.columns.clone()).collect();
        let gradient = self.gradient.select_rows(&columns);
        let gram = self.gram.select_rows(&columns).select_columns(&columns);
        let amplitudes = -gram.cholesky()?.solve(&gradient);
        let cost = self.squares + gradient.dot(&amplitudes);
        cost.is_finite().then(|| Solved { columns, amplitudes: amplitudes.as_slice().to_vec(), cost })
    }
}
