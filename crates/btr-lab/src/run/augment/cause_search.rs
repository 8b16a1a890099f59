//! Search for the effects that explain real tests: each effect is screened at every site, and the most promising ones
//! are fitted together with all of S.

use super::explanation::{ExplanationCost, PresentExplanation, QuickEstimate};
use super::extended::{Added, Extended};
use crate::execution::ExecutionContext;
use crate::identification::{has_dry_friction, sites};
use crate::scales::RobotScales;
use btr_core::coevolve::{Abduction, Cost, EstimateError, Estimated, Extension, Posterior};
use btr_core::space::{Dim, Space};
use btr_core::world::{Cancelled, Simulator};
use btr_identify::diagnose::{Evidence, MissingEffect};
use btr_identify::fit::Estimate;
use btr_identify::residual_model::CandidateKind;
use btr_physics::effects::{DryFriction, EFFECTS, SiteKind};
use btr_physics::model::Model;
use btr_physics::robot::site::matches;
use std::ops::Range;

/// Most candidates estimated per round from each of the two base points in S.
const TRIED: usize = 6;
/// Turns of a quick estimate.
const QUICK_TURNS: usize = 4;
/// Number of candidates that are fitted in full.
const FITTED: usize = 3;
/// An effect is kept if it explains at least this share of the unexplained error.
const HELPS: f64 = 0.2;
/// Explanations whose costs differ by less than this are indistinguishable.
const ALIKE: f64 = 10.0;
/// Standard deviations from the mean of a 95 % interval to its ends.
pub(super) const TWO_SIDED_95: f64 = 1.96;

/// A search for missing effects on the real tests of one run.
pub(super) struct CauseSearch<'a> {
    pub abduction: Abduction<'a>,
    pub model: &'a Model,
    pub scales: RobotScales,
    pub context: &'a ExecutionContext,
    /// s_0, the mean of the prior over S.
    pub start: Vec<f64>,
}

impl<'a> CauseSearch<'a> {
    /// Fits S without further effects; `None` if it cannot be simulated.
    pub(super) fn begin(&self, cost: &mut Cost) -> Result<Option<PresentExplanation<'a>>, Cancelled> {
        let Some(extended) = self.extended(Vec::new()) else { return Ok(None) };
        let prior = self.prior(extended.simulations());
        self.fitted(extended, &prior, cost)
    }

    /// Adds one effect; `None` if no effect helps enough.
    pub(super) fn round(
        &self,
        state: &PresentExplanation<'a>,
        cost: &mut Cost,
    ) -> Result<Option<(PresentExplanation<'a>, MissingEffect)>, Cancelled> {
        let quick_estimates = self.quick_estimates(state, cost)?;
        let mut fitted: Vec<PresentExplanation> = Vec::new();
        for candidate in quick_estimates.iter().take(FITTED) {
            // Once a candidate explains everything, candidates that do not even explain the beginnings cannot compete.
            if !candidate.explains && fitted.iter().any(|tried| tried.fitted.estimated.explains) {
                break;
            }
            fitted.extend(self.tried(&candidate.added, &candidate.belief, cost)?);
        }
        fitted.sort_by(|a, b| 0.0f64.total_cmp(&ExplanationCost::of(a).less_than(ExplanationCost::of(b))));
        let before = state.fitted.estimated.chi.powi(2);
        let Some(leader) = fitted.first() else { return Ok(None) };
        let helps = before - leader.fitted.estimated.chi.powi(2) > HELPS * (before - 1.0);
        let found = self.found(state, &fitted).filter(|_| helps);
        Ok(found.map(|found| (fitted.swap_remove(0), found)))
    }

    /// Quick estimates of the candidates, best first. Candidates are screened at the current belief and at the unbiased
    /// prior.
    fn quick_estimates(
        &self,
        state: &PresentExplanation<'a>,
        cost: &mut Cost,
    ) -> Result<Vec<QuickEstimate>, Cancelled> {
        let spaces: Vec<Extended> =
            self.offered(&state.added).into_iter().filter_map(|added| self.extended(added)).collect();
        let extensions: Vec<Extension> =
            spaces.iter().map(|extended| Extension { simulator: extended, probes: extended.probes() }).collect();
        let mut quick_estimates: Vec<QuickEstimate> = Vec::new();
        for base in [state.fitted.estimated.belief.clone(), self.abduction.unbiased(&state.prior)] {
            let suspects = self.abduction.screen(&state.extended, &state.prior, &base, &extensions, cost)?;
            for suspect in suspects.iter().take(TRIED) {
                let extended = &spaces[suspect.extension];
                let prior = self.prior(extended.simulations());
                let from = self.abduction.beginning(&base, suspect, &prior);
                let estimated = self.abduction.glance(extended, &prior, &from, QUICK_TURNS, cost);
                let estimated = EstimateError::unless_cancelled(estimated)?;
                let Some(Estimated { chi, belief, explains, .. }) = estimated else { continue };
                quick_estimates.push(QuickEstimate { added: extended.added().to_vec(), belief, chi, explains });
            }
        }
        quick_estimates.sort_by(|a, b| a.chi.total_cmp(&b.chi));
        let mut names: Vec<Option<String>> = Vec::new();
        quick_estimates.retain(|candidate| {
            let name = candidate.added.last().map(Added::name);
            let first = !names.contains(&name);
            names.push(name);
            first
        });
        Ok(quick_estimates)
    }

    /// Fits S with these effects; `None` if it cannot be simulated.
    pub(super) fn tried(
        &self,
        added: &[Added],
        from: &Posterior,
        cost: &mut Cost,
    ) -> Result<Option<PresentExplanation<'a>>, Cancelled> {
        let Some(extended) = self.extended(added.to_vec()) else { return Ok(None) };
        self.fitted(extended, from, cost)
    }

    fn fitted(
        &self,
        extended: Extended<'a>,
        from: &Posterior,
        cost: &mut Cost,
    ) -> Result<Option<PresentExplanation<'a>>, Cancelled> {
        let prior = self.prior(extended.simulations());
        let fitted = EstimateError::unless_cancelled(self.abduction.fit(&extended, &prior, from, cost))?;
        let added = extended.added().to_vec();
        Ok(fitted.map(|fitted| PresentExplanation { added, fitted, prior, extended }))
    }

    /// Indices in a state's space of the parameters of its `k`th added effect.
    pub(super) fn places(&self, state: &PresentExplanation, k: usize) -> Range<usize> {
        let count = |added: &Added| added.effect.spec().params.len();
        let from = self.model.simulations().len() + state.added[..k].iter().map(count).sum::<usize>();
        from..from + count(&state.added[k])
    }

    /// The report of the best candidate, with the candidates that explain as much.
    fn found(&self, before: &PresentExplanation, tried: &[PresentExplanation]) -> Option<MissingEffect> {
        let leader = tried.first()?;
        let last = leader.added.last()?;
        let cost = ExplanationCost::of(leader);
        let excess_cost = |other: &PresentExplanation| cost.less_than(ExplanationCost::of(other));
        let close = |other: &&PresentExplanation| excess_cost(other) < ALIKE;
        let alike = tried.iter().skip(1).filter(close).filter_map(|other| Some(other.added.last()?.name()));
        let rivals: f64 = tried.iter().skip(1).map(|other| (-0.5 * excess_cost(other)).exp()).sum();
        Some(MissingEffect {
            kind: CandidateKind::Effect,
            evidence: Evidence::default(),
            effect: last.effect.spec().name.to_owned(),
            site: last.site.clone(),
            alike: alike.collect(),
            probability: 1.0 / (1.0 + rivals),
            rivals: Vec::new(),
            probability_cap: None,
            delta_bic: ExplanationCost::of(before).whole - cost.whole,
            parameters: Vec::new(),
            close: Vec::new(),
            is_granted: false,
            candidate: 0,
        })
    }

    /// Estimates of the parameters of the `k`th added effect.
    pub(super) fn parameters(&self, state: &PresentExplanation, k: usize) -> Vec<Estimate> {
        let places = self.places(state, k);
        let known = &state.extended.simulations().dims()[places.clone()];
        let belief = &state.fitted.estimated.belief;
        let trusted = state.fitted.estimated.explains;
        let number = |(place, dim): (usize, &Dim)| {
            let (u, half) = (belief.mean()[place], TWO_SIDED_95 * belief.sd(place));
            let at_bound = !(1e-3..=1.0 - 1e-3).contains(&u) && dim.nominal.is_none();
            let ci95 = (trusted && !at_bound).then(|| [dim.from_unit(u - half), dim.from_unit(u + half)]);
            let value = dim.from_unit(u);
            Estimate {
                name: dim.name.clone(),
                unit: dim.unit.clone(),
                value,
                ci95,
                at_bound,
                by_bounds: false,
                prior_sd: None,
            }
        };
        places.zip(known).map(number).collect()
    }

    /// All candidates for the next addition: every effect at every site where it has something to act on, and joint
    /// effects also on all joints at once.
    fn offered(&self, added: &[Added]) -> Vec<Vec<Added>> {
        let mut offered = Vec::new();
        for effect in EFFECTS.iter().copied() {
            let spec = effect.spec();
            let all = (spec.site == SiteKind::Joint).then(|| "*".to_owned());
            for site in sites(effect, self.model).into_iter().chain(all) {
                let next = Added { effect, site };
                let rubs = |known: &Added| {
                    known.effect.dry_friction() == DryFriction::Adds && matches(&known.site, &next.site)
                };
                let acts = effect.dry_friction() != DryFriction::Changes
                    || has_dry_friction(self.model, &next.site)
                    || added.iter().any(rubs);
                if acts && !added.iter().any(|known| known.name() == next.name()) {
                    offered.push(added.iter().cloned().chain([next]).collect());
                }
            }
        }
        offered
    }

    pub(super) fn extended(&self, added: Vec<Added>) -> Option<Extended<'a>> {
        Extended::new(self.model, added, &self.scales, self.context).ok()
    }

    /// Prior over a space: S around its start, effects off.
    pub(super) fn prior(&self, space: &Space) -> Posterior {
        let off = space.dims().iter().skip(self.start.len()).map(|dim| dim.nominal.map_or(0.5, |off| dim.to_unit(off)));
        let base = space.dims().iter().zip(&self.start).map(|(dim, value)| dim.to_unit(*value));
        Posterior::of_bounds(&base.chain(off).collect::<Vec<_>>())
    }
}
