//! Laws for an error that no effect explains: at most three terms at one place.
//!
//! Terms are probed like effects. For each place (a joint's torque, its command, its reading) the terms
//! are picked greedily, all amplitudes being refitted after each pick (Y. C. Pati, R. Rezaiifar and P. S.
//! Krishnaprasad, "Orthogonal matching pursuit", 1993), with the response of the base's parameters projected out. The
//! best places are then fitted in full and judged on held-out logs.
//!
//! A search costs two rollouts per probe, and two fits: with about 70 probes a joint, some 680 rollouts for an arm of
//! three joints and four logs. There are at most two searches.

mod draft;
mod law;

pub use law::ResidualLaw;

use crate::fit::measure::{ComparisonMeasure, held_out_squares};
use crate::fit::residual_vector::squares;
use crate::fit::{FitPoint, LogSet, Objective, SearchBudget};
use crate::residual_model::LawTerm;
use draft::{Draft, LawKind, LinearLawModel};
use std::ops::Range;

/// Number of places that are fitted in full.
const FINALISTS: usize = 2;
/// Budget of a fit.
const BUDGET: SearchBudget = SearchBudget { jacobians: 2, steps: 12 };
/// A fit begins at the best of these multiples of the amplitudes that the probes predict: probes are small, laws need
/// not be.
const SHARES: [f64; 3] = [1.0, 0.3, 3.0];
/// Of places whose criteria are this close, the first one listed is preferred: a torque before a command or reading
/// that a servo turns into one.
const CLOSE: f64 = 10.0;
/// A term is needed if the sum of squares without it is larger by more than this factor.
const NEEDED: f64 = 1.05;
/// A law that explains this share of the excess error replaces all effects...
const ENOUGH: f64 = 0.8;
/// ... and one that explains less than this is no law.
const LEAST: f64 = 0.3;

/// The law that explains most, if any explains enough: first in place of all effects; then in addition to those that
/// were found or, without any, from the given values of the free parameters, which may have been biased by
/// compensating for the law.
pub(super) fn residual_law(objective: &Objective, bare: &FitPoint, found: Option<&FitPoint>) -> Option<ResidualLaw> {
    // Where joints are questions of their own, a law at one takes no effect's place at another.
    let instead = !(objective.description.is_decoupled && found.is_some());
    let first = instead.then(|| law_on(objective, bare, bare)).flatten();
    if first.as_ref().is_some_and(|(_, law)| law.explains >= ENOUGH) {
        return first.map(|(_, law)| law);
    }
    let second = match found {
        Some(found) => {
            law_on(objective, found, found).map(|(left, law)| (left, ResidualLaw { beside_effects: true, ..law }))
        }
        None => FitPoint::at(objective, bare.active.clone(), vec![0.0; bare.u.len()], &bare.step_error)
            .ok()
            .and_then(|origin| law_on(objective, &origin, bare)),
    };
    preferred(first, second, found.and_then(|found| judged(objective, found)))
}

/// Of the laws that explain enough, the one with the lowest error. A law that leaves more than the effects alone does
/// not replace them.
fn preferred(
    first: Option<(f64, ResidualLaw)>,
    second: Option<(f64, ResidualLaw)>,
    effects_leave: Option<f64>,
) -> Option<ResidualLaw> {
    let laws = first.into_iter().chain(second).filter(|(_, law)| law.explains >= LEAST);
    let better = laws.filter(|(left, _)| effects_leave.is_none_or(|effects| *left < effects));
    better.min_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, law)| law)
}

/// The best law on top of a base, with the squares above the noise that it leaves. The share that it explains is
/// relative to the fit `from`. Of a prescribed motion, where one log may be all there is, laws of plain terms alone are
/// tried as well: they are held out better. There the law that explains most of the squares counts.
fn law_on(objective: &Objective, base: &FitPoint, from: &FitPoint) -> Option<(f64, ResidualLaw)> {
    let kinds: &[LawKind] = match objective.description.is_decoupled {
        true => &[LawKind::OfAnyTerms, LawKind::OfPlainTerms],
        false => &[LawKind::OfAnyTerms],
    };
    let laws = kinds.iter().flat_map(|&kind| search(objective, base, kind));
    let weighed = laws.filter_map(|(terms, fit)| weighed(objective, from, terms, fit));
    let best = weighed.max_by(|a, b| a.gained.total_cmp(&b.gained))?;
    Some((best.left, best.law))
}

/// A law with what it leaves and gains.
struct WeighedLaw {
    law: ResidualLaw,
    /// The sum of squares above the noise that it leaves, in all channels.
    left: f64,
    /// By how much it lowers that sum in the channels where it shows.
    gained: f64,
}

fn weighed(objective: &Objective, from: &FitPoint, terms: Vec<usize>, fit: FitPoint) -> Option<WeighedLaw> {
    let channels = terms.first().map_or(&[][..], |&term| objective.law_terms()[term].channels.as_slice());
    let (before, after) = (judged_in(objective, channels, from)?, judged_in(objective, channels, &fit)?.max(0.0));
    let explains = if before > 0.0 { (1.0 - after / before).clamp(0.0, 1.0) } else { 0.0 };
    let left = if channels.is_empty() { after } else { judged(objective, &fit)?.max(0.0) };
    let law = ResidualLaw { terms, fit, beside_effects: false, explains };
    Some(WeighedLaw { law, left, gained: before - after })
}

/// The sum of squares above the noise on the held-out logs; without such, on the training logs.
fn judged(objective: &Objective, fit: &FitPoint) -> Option<f64> {
    judged_in(objective, &[], fit)
}

/// The same in some channels; in all without any.
fn judged_in(objective: &Objective, channels: &[String], fit: &FitPoint) -> Option<f64> {
    let own = |logs: LogSet, residual: &[f64]| {
        let rows = objective.rows_near(logs, channels);
        let samples: usize = rows.iter().map(Range::len).sum();
        rows.into_iter().map(|rows| squares(&residual[rows])).sum::<f64>() - samples as f64
    };
    let held_out = objective.samples(LogSet::HeldOut);
    match (held_out, channels) {
        (0, []) => Some(fit.squares() - objective.samples(LogSet::Learn) as f64),
        (0, _) => Some(own(LogSet::Learn, &fit.residual)),
        (samples, []) => held_out_squares(objective, &fit.u).map(|squares| squares - samples as f64),
        _ => objective.residual(&fit.u, LogSet::HeldOut).ok().map(|residual| own(LogSet::HeldOut, &residual)),
    }
}

/// The terms of the best law on top of a base, and the fit with it; where laws show in different channels, the best of
/// each place.
fn search(objective: &Objective, base: &FitPoint, kind: LawKind) -> Vec<(Vec<usize>, FitPoint)> {
    let fits = finalists(objective, base, kind).unwrap_or_default();
    if objective.description.is_decoupled {
        return fits;
    }
    best(objective, fits).into_iter().collect()
}

/// The fits of the best drafts; of every place where laws show in different channels.
fn finalists(objective: &Objective, base: &FitPoint, kind: LawKind) -> Option<Vec<(Vec<usize>, FitPoint)>> {
    let mut base = base.clone();
    if !base.fresh {
        base.differentiate(objective);
    }
    let linear = LinearLawModel::new(objective, &base)?;
    let places = places(objective.law_terms());
    let mut drafts: Vec<Draft> = places.into_iter().filter_map(|place| linear.draft(place, kind)).collect();
    drafts.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    if !objective.description.is_decoupled {
        drafts.truncate(FINALISTS);
    }
    Some(drafts.iter().filter_map(|draft| finish(objective, &base, draft)).collect())
}

/// The law with the lowest criterion; of close ones the first one listed.
fn best(objective: &Objective, fits: Vec<(Vec<usize>, FitPoint)>) -> Option<(Vec<usize>, FitPoint)> {
    let measure =
        ComparisonMeasure::of(objective, fits.iter().map(|(_, fit)| fit).min_by(|a, b| a.cost.total_cmp(&b.cost))?);
    let least = fits.iter().map(|(_, fit)| measure.criterion(fit)).fold(f64::INFINITY, f64::min);
    let close = fits.into_iter().filter(|(_, fit)| measure.criterion(fit) <= least + CLOSE);
    close.min_by(|(a, _), (b, _)| a.cmp(b))
}

/// The law terms of each place; those of one place are adjacent.
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

/// The fit of a draft with all free parameters, starting from the amplitudes that the probes predict.
fn finish(objective: &Objective, base: &FitPoint, draft: &Draft) -> Option<(Vec<usize>, FitPoint)> {
    let (features, parameters) = (objective.law_terms(), objective.parameters());
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
        FitPoint::at(objective, active.clone(), u, &base.step_error).ok()
    };
    let mut fit = SHARES.iter().filter_map(start).min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    fit.solve(objective, BUDGET);
    let terms = draft.terms.iter().map(|term| term.feature).collect();
    Some(needed(objective, terms, fit))
}

/// Drops the terms that the fit does not need: at larger amplitudes than probed, some have no effect.
fn needed(objective: &Objective, mut terms: Vec<usize>, mut fit: FitPoint) -> (Vec<usize>, FitPoint) {
    for term in terms.clone().into_iter().rev() {
        if terms.len() == 1 {
            break;
        }
        let parameters: Vec<usize> = objective.law_terms()[term].term.parameters().collect();
        let mut u = fit.u.clone();
        parameters.iter().for_each(|&parameter| u[parameter] = 0.0);
        let active = fit.active.iter().copied().filter(|parameter| !parameters.contains(parameter)).collect();
        let without = FitPoint::at(objective, active, u, &fit.step_error);
        if let Some(without) = without.ok().filter(|without| without.squares() <= NEEDED * fit.squares()) {
            fit = without;
            terms.retain(|other| *other != term);
        }
    }
    (terms, fit)
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
