//! What an error looks like that no effect explains: a law of at most three terms at one place.
//!
//! Terms answer to the same probes as effects do. For each place (a joint's torque, its command, its reading) the terms
//! are picked greedily, all amplitudes being refitted after each pick (Y. C. Pati, R. Rezaiifar and P. S.
//! Krishnaprasad, "Orthogonal matching pursuit", 1993), in what the base's own parameters cannot do. The best places
//! are then fitted in earnest and judged on logs that nothing was fitted to.
//!
//! A search costs two rollouts per probe, and two fits: with about 70 probes a joint, some 650 rollouts for an arm of three
//! joints and four logs. There are at most two searches.

use crate::fit::measure::{ComparisonMeasure, held_out_squares};
use crate::fit::{FitPoint, LogSet, Objective, SearchBudget};
use crate::residual_model::LawTerm;
use btr_core::signal::fft::peak_rate;
use btr_core::signal::stats::autocorrelation_time;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::ops::Range;

/// The most terms of a law.
const MOST_TERMS: usize = 3;
/// How many logs the terms are probed on: those with the largest errors.
const PROBED_LOGS: usize = 2;
/// The size of a probe, in typical sizes.
const PROBE: f64 = 0.3;
/// How many places are fitted in earnest.
const FINALISTS: usize = 2;
/// What a fit may spend.
const EFFORT: SearchBudget = SearchBudget { jacobians: 2, steps: 12 };
/// A fit begins at the best of these multiples of the amplitudes that the probes promise: probes are small, laws are not.
const SHARES: [f64; 3] = [1.0, 0.3, 3.0];
/// A further term must lower what is left to this share of it.
const WORTH: f64 = 0.9;
/// Of places whose criteria are this close, the one that is listed first is preferred: a torque before what a servo
/// makes one of.
const CLOSE: f64 = 10.0;
/// A term stays if the sum of squares without it were larger than this many times.
const NEEDED: f64 = 1.05;
/// A law that explains this share of the excess needs no effects beside it...
const ENOUGH: f64 = 0.8;
/// ... and one that explains less than this is no law.
const LEAST: f64 = 0.3;

/// A law that the error follows.
#[derive(Clone, Debug)]
pub struct ResidualLaw {
    /// Its terms, as indices of the family's features.
    pub terms: Vec<usize>,
    /// The base with it.
    pub fit: FitPoint,
    /// Whether it stands beside the effects that were found, or replaces them.
    pub beside_effects: bool,
    /// The share of the squared error above the noise that it explains on held-out logs.
    pub explains: f64,
}

/// The law that explains most, if any explains enough: first in place of all effects; then beside those that were
/// found, or, where none was, from where the parameters in doubt began: they may have gone astray to make up for the
/// law.
pub(super) fn residual_law(objective: &Objective, bare: &FitPoint, found: Option<&FitPoint>) -> Option<ResidualLaw> {
    let first = law_on(objective, bare, bare);
    if first.as_ref().is_some_and(|(_, law)| law.explains >= ENOUGH) {
        return first.map(|(_, law)| law);
    }
    let second = match found {
        Some(found) => {
            law_on(objective, found, found).map(|(left, law)| (left, ResidualLaw { beside_effects: true, ..law }))
        }
        None => FitPoint::at(objective, bare.active.clone(), vec![0.0; bare.u.len()], &bare.step_error)
            .and_then(|origin| law_on(objective, &origin, bare)),
    };
    preferred(first, second, found.and_then(|found| judged(objective, found)))
}

/// The law that leaves least, of those that explain enough. One that leaves more than the effects alone cannot take
/// their place.
fn preferred(
    first: Option<(f64, ResidualLaw)>,
    second: Option<(f64, ResidualLaw)>,
    effects_leave: Option<f64>,
) -> Option<ResidualLaw> {
    let laws = first.into_iter().chain(second).filter(|(_, law)| law.explains >= LEAST);
    let better = laws.filter(|(left, _)| effects_leave.is_none_or(|effects| *left < effects));
    better.min_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, law)| law)
}

/// The best law on top of a base, with what it leaves of the squares above the noise; what it explains counts from another fit.
fn law_on(objective: &Objective, base: &FitPoint, from: &FitPoint) -> Option<(f64, ResidualLaw)> {
    let (terms, fit) = search(objective, base)?;
    let (before, left) = (judged(objective, from)?, judged(objective, &fit)?.max(0.0));
    let explains = if before > 0.0 { (1.0 - left / before).clamp(0.0, 1.0) } else { 0.0 };
    Some((left, ResidualLaw { terms, fit, beside_effects: false, explains }))
}

/// The sum of squares above the noise on the logs to judge on.
fn judged(objective: &Objective, fit: &FitPoint) -> Option<f64> {
    match objective.samples(LogSet::HeldOut) {
        0 => Some(fit.squares() - objective.samples(LogSet::Learn) as f64),
        samples => held_out_squares(objective, &fit.u).map(|squares| squares - samples as f64),
    }
}

/// The terms of the best law on top of a base, and the fit with it.
fn search(objective: &Objective, base: &FitPoint) -> Option<(Vec<usize>, FitPoint)> {
    let mut base = base.clone();
    if !base.fresh {
        base.differentiate(objective);
    }
    let picture = LawPicture::new(objective, &base)?;
    let places = places(objective.model.features());
    let mut drafts: Vec<Draft> = places.into_iter().filter_map(|place| picture.draft(place)).collect();
    drafts.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    drafts.truncate(FINALISTS);
    let fits: Vec<(Vec<usize>, FitPoint)> = drafts.iter().filter_map(|draft| finish(objective, &base, draft)).collect();
    let measure =
        ComparisonMeasure::of(objective, fits.iter().map(|(_, fit)| fit).min_by(|a, b| a.cost.total_cmp(&b.cost))?);
    let least = fits.iter().map(|(_, fit)| measure.criterion(fit)).fold(f64::INFINITY, f64::min);
    let close = fits.into_iter().filter(|(_, fit)| measure.criterion(fit) <= least + CLOSE);
    close.min_by(|(a, _), (b, _)| a.cmp(b))
}

/// The features of each place; those of one place follow one another.
fn places(features: &[LawTerm]) -> Vec<Range<usize>> {
    let mut places: Vec<Range<usize>> = Vec::new();
    for (i, feature) in features.iter().enumerate() {
        let same = i > 0 && features[i - 1].on == feature.on && features[i - 1].term.site == feature.term.site;
        match places.last_mut().filter(|_| same) {
            Some(place) => place.end = i + 1,
            None => places.push(i..i + 1),
        }
    }
    places
}

/// The fit with everything that is in doubt, from where the probes point.
fn finish(objective: &Objective, base: &FitPoint, draft: &Draft) -> Option<(Vec<usize>, FitPoint)> {
    let (features, parameters) = (objective.model.features(), objective.model.parameters());
    let mut active = base.active.clone();
    draft.terms.iter().for_each(|term| active.extend(features[term.feature].term.parameters()));
    let start = |share: &f64| {
        let mut u = base.u.clone();
        for term in &draft.terms {
            let candidate = &features[term.feature].term;
            candidate.shapes.iter().zip(&term.shapes).for_each(|(&k, &x)| u[k] = x);
            candidate
                .amplitudes
                .iter()
                .zip(&term.amplitudes)
                .for_each(|(&k, &x)| u[k] = parameters[k].clamp(share * x));
        }
        FitPoint::at(objective, active.clone(), u, &base.step_error)
    };
    let mut fit = SHARES.iter().filter_map(start).min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    fit.solve(objective, EFFORT);
    let terms = draft.terms.iter().map(|term| term.feature).collect();
    Some(needed(objective, terms, fit))
}

/// Drops the terms that the fit can do without: far from where they were probed, some turn out to do nothing.
fn needed(objective: &Objective, mut terms: Vec<usize>, mut fit: FitPoint) -> (Vec<usize>, FitPoint) {
    for term in terms.clone().into_iter().rev() {
        if terms.len() == 1 {
            break;
        }
        let parameters: Vec<usize> = objective.model.features()[term].term.parameters().collect();
        let mut u = fit.u.clone();
        parameters.iter().for_each(|&parameter| u[parameter] = 0.0);
        let active = fit.active.iter().copied().filter(|parameter| !parameters.contains(parameter)).collect();
        let without = FitPoint::at(objective, active, u, &fit.step_error);
        if let Some(without) = without.filter(|without| without.squares() <= NEEDED * fit.squares()) {
            fit = without;
            terms.retain(|other| *other != term);
        }
    }
    (terms, fit)
}

/// A law in the linear picture that the probes give.
struct Draft {
    terms: Vec<Drafted>,
    cost: f64,
}

/// A term of it: its shapes and amplitudes as coordinates.
#[derive(Clone)]
struct Drafted {
    feature: usize,
    shapes: Vec<f64>,
    amplitudes: Vec<f64>,
}

/// A feature with its shapes, and its columns among those of its place.
struct TermTrial {
    feature: usize,
    shapes: Vec<f64>,
    columns: Range<usize>,
}

/// The logs with the largest errors, and what the base's own parameters can do about them.
struct LawPicture<'a> {
    objective: &'a Objective<'a>,
    base: &'a FitPoint,
    logs: Vec<(usize, Range<usize>)>,
    residual: DVector<f64>,
    jacobian: DMatrix<f64>,
    factors: Cholesky<f64, Dyn>,
}

impl<'a> LawPicture<'a> {
    fn new(objective: &'a Objective<'a>, base: &'a FitPoint) -> Option<Self> {
        let logs = objective.worst_logs(&base.residual, PROBED_LOGS);
        let rows: Vec<usize> = logs.iter().flat_map(|(_, rows)| rows.clone()).collect();
        let residual = DVector::from_iterator(rows.len(), rows.iter().map(|&row| base.residual[row]));
        let jacobian = base.jacobian.as_ref()?.select_rows(&rows);
        let mut normal = jacobian.tr_mul(&jacobian);
        for (k, &parameter) in base.active.iter().enumerate() {
            normal[(k, k)] += objective.model.parameters()[parameter].spread.powi(-2);
        }
        Some(LawPicture { objective, base, logs, residual, jacobian, factors: normal.cholesky()? })
    }

    /// What is left of columns when the base's parameters answer them.
    fn own(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        columns - &self.jacobian * self.factors.solve(&self.jacobian.tr_mul(columns))
    }

    /// The best law of a place.
    fn draft(&self, place: Range<usize>) -> Option<Draft> {
        let features = self.objective.model.features();
        let (mut trials, mut columns) = (Vec::new(), Vec::new());
        let steady: Vec<(usize, Vec<f64>)> = place
            .clone()
            .filter(|&i| features[i].swings.is_none())
            .flat_map(|i| features[i].term.starts.iter().map(move |shapes| (i, shapes.clone())))
            .collect();
        self.probe(&steady, &mut trials, &mut columns);
        let rate = |i: usize| {
            let plain = trials.iter().find(|trial| Some(trial.feature) == features[i].swings)?;
            let parameter = &self.objective.model.parameters()[*features[i].term.shapes.first()?];
            Some((i, vec![parameter.clamp(parameter.coordinate(self.rate(&columns[plain.columns.start])?))]))
        };
        let swinging: Vec<(usize, Vec<f64>)> = place.filter_map(rate).collect();
        self.probe(&swinging, &mut trials, &mut columns);
        if columns.is_empty() {
            return None;
        }
        let columns = DMatrix::from_columns(&columns);
        self.pursue(&trials, &columns)
    }

    /// Simulates features of given shapes, and notes the columns of those that do not blow up.
    fn probe(&self, wanted: &[(usize, Vec<f64>)], trials: &mut Vec<TermTrial>, columns: &mut Vec<DVector<f64>>) {
        let (features, parameters) = (self.objective.model.features(), self.objective.model.parameters());
        let mut points = Vec::new();
        for (i, shapes) in wanted {
            let term = &features[*i].term;
            for &amplitude in &term.amplitudes {
                let mut u = self.base.u.clone();
                term.shapes.iter().zip(shapes).for_each(|(&k, &x)| u[k] = parameters[k].clamp(x));
                u[amplitude] = PROBE;
                points.push(u);
            }
        }
        let mut responses = self.respond(&points).into_iter();
        for (feature, shapes) in wanted {
            let own: Vec<Option<DVector<f64>>> =
                responses.by_ref().take(features[*feature].term.amplitudes.len()).collect();
            if let Some(own) = own.into_iter().collect::<Option<Vec<_>>>() {
                let start = columns.len();
                columns.extend(own);
                trials.push(TermTrial { feature: *feature, shapes: shapes.clone(), columns: start..columns.len() });
            }
        }
    }

    /// By how much points move the residual, per unit of the probe.
    fn respond(&self, points: &[Vec<f64>]) -> Vec<Option<DVector<f64>>> {
        let mut changes: Vec<Option<Vec<f64>>> = vec![Some(Vec::new()); points.len()];
        for (log, rows) in &self.logs {
            for (change, after) in changes.iter_mut().zip(self.objective.residuals_of(points, &[*log])) {
                let Some((change, after)) = change.as_mut().zip(after) else {
                    *change = None;
                    continue;
                };
                let before = self.base.residual[rows.clone()].iter().zip(&self.base.step_error[rows.clone()]);
                change.extend(after.iter().zip(before).map(|(after, (r, e))| (after - (r - e)) / PROBE));
            }
        }
        changes.into_iter().map(|change| change.map(DVector::from_vec)).collect()
    }

    /// At which rate, in rad/s, a term would have to swing: the peak of the spectrum of what it leaves, times its
    /// response. A slow swing of a term swings its response alike.
    fn rate(&self, response: &DVector<f64>) -> Option<f64> {
        let norm = response.norm_squared();
        let share = if norm > 0.0 { response.dot(&self.residual) / norm } else { return None };
        let left = (&self.residual - share * response).component_mul(response);
        let (mut samples, mut row, mut step_s) = (Vec::new(), 0, 0.0_f64);
        for (log, rows) in &self.logs {
            let clock = self.objective.model.clock_s(*log);
            let last_s = clock.last()?;
            step_s = step_s.max(last_s / clock.len() as f64);
            // All channels of a log are on its clock, one after the other.
            samples
                .extend(clock.iter().cycle().take(rows.len()).copied().zip(left.rows(row, rows.len()).iter().copied()));
            row += rows.len();
        }
        peak_rate(&samples, step_s)
    }

    /// Orthogonal matching pursuit; as many terms as the criterion allows.
    fn pursue(&self, trials: &[TermTrial], columns: &DMatrix<f64>) -> Option<Draft> {
        let own = self.own(columns);
        let residual = self.own(&DMatrix::from_column_slice(self.residual.len(), 1, self.residual.as_slice()));
        let normal = NormalEquations {
            gram: columns.tr_mul(&own) + DMatrix::identity(columns.ncols(), columns.ncols()) * 1e-3,
            pull: own.tr_mul(&self.residual),
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
            + last.columns.iter().zip(&last.amplitudes).map(|(&c, a)| own.column(c) * *a).sum::<DVector<f64>>();
        let samples: usize = self.logs.iter().map(|(log, _)| self.objective.model.logs()[*log].present).sum();
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
        let term = |trial: &TermTrial| Drafted {
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
    pull: DVector<f64>,
    squares: f64,
}

/// The best amplitudes of some columns, and what is left.
struct Solved {
    columns: Vec<usize>,
    amplitudes: Vec<f64>,
    cost: f64,
}

impl NormalEquations {
    fn solve(&self, chosen: &[&TermTrial]) -> Option<Solved> {
        let columns: Vec<usize> = chosen.iter().flat_map(|trial| trial.columns.clone()).collect();
        let pull = self.pull.select_rows(&columns);
        let gram = self.gram.select_rows(&columns).select_columns(&columns);
        let amplitudes = -gram.cholesky()?.solve(&pull);
        let cost = self.squares + pull.dot(&amplitudes);
        cost.is_finite().then(|| Solved { columns, amplitudes: amplitudes.as_slice().to_vec(), cost })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law(explains: f64, beside_effects: bool) -> ResidualLaw {
        let fit = FitPoint {
            active: Vec::new(),
            u: Vec::new(),
            residual: Vec::new(),
            cost: 0.0,
            step_error: Vec::new(),
            jacobian: None,
            fresh: false,
        };
        ResidualLaw { terms: Vec::new(), fit, beside_effects, explains }
    }

    #[test]
    fn a_law_that_leaves_more_than_the_effects_does_not_take_their_place() {
        let instead = || Some((40.0, law(0.6, false)));
        assert!(preferred(instead(), None, Some(5.0)).is_none());
        assert!(preferred(instead(), Some((4.9, law(0.02, true))), Some(5.0)).is_none());
        assert!(preferred(instead(), Some((3.0, law(0.4, true))), Some(5.0)).is_some_and(|law| law.beside_effects));
        assert!(preferred(instead(), None, Some(50.0)).is_some_and(|law| !law.beside_effects));
        assert!(preferred(instead(), None, None).is_some());
    }
}
