//! What a run with a posterior asks when nothing in S explains its real tests: which effects, added to S, do. Effect after
//! effect, each screened at every place, the most promising ones estimated with all of S free, and judged by tests that were
//! held out.

use super::cause::Cause;
use super::extended::{Added, Extended};
use crate::execution::ExecutionContext;
use crate::experiment::Experiment;
use crate::identification::sites;
use crate::scales::RobotScales;
use btr_core::coevolve::{
    Abduction, Coevolution, Cost, Entry, Estimated, Explanation, Extension, FittedExtension, Posterior, PosteriorPhase,
    Suspect,
};
use btr_core::space::{Dim, Space};
use btr_core::world::{Simulator, WorldError};
use btr_identify::LadderStep;
use btr_identify::diagnose::{MissingEffect, Verdict};
use btr_identify::fit::Estimate;
use btr_physics::effects;
use btr_physics::effects::{EFFECTS, SiteKind};
use btr_physics::model::Model;
use std::ops::Range;

/// The most real tests that are looked at.
const MOST_TESTS: usize = 4;
/// The most effects that are named.
const MOST_EFFECTS: usize = 3;
/// How many suspects are looked at in a round, from each of two places in S; for so many turns.
const TRIED: usize = 6;
const GLANCE_TURNS: usize = 4;
/// How many of those are estimated to the end.
const FITTED: usize = 3;
/// These shares of each test are estimated before all of it; effects are screened by the first.
const BEGINNINGS: [f64; 3] = [0.3, 0.5, 0.7];
/// Turns of an estimate at most. Nobody waits at the robot while a cause is looked for.
const TURNS: usize = 12;
/// An effect is kept that explains at least this share of what is unexplained.
const HELPS: f64 = 0.2;
/// Two explanations whose deviance, with what their numbers cost, differs by less than this cannot be told apart.
const ALIKE: f64 = 10.0;
/// Standard deviations from the middle of a 95 % interval to its ends.
const TWO_SIDED_95: f64 = 1.96;

/// What the present S comes to, and what it is made of.
struct PresentExplanation<'a> {
    added: Vec<Added>,
    fitted: FittedExtension,
    prior: Posterior,
    extended: Extended<'a>,
}

/// A suspect after a few turns.
struct QuickEstimate {
    added: Vec<Added>,
    belief: Posterior,
    chi: f64,
    explains: bool,
}

/// What an explanation costs: its deviance, with what each of its numbers costs (Schwarz's criterion).
#[derive(Clone, Copy)]
struct ExplanationCost {
    explains: bool,
    /// In the beginnings of the tests.
    early: f64,
    /// In all of them.
    whole: f64,
}

impl ExplanationCost {
    fn of(state: &PresentExplanation) -> Self {
        let numbers = state.extended.simulations().len() as f64;
        let price = |estimated: &Estimated| estimated.deviance + numbers * estimated.samples.ln();
        let FittedExtension { early, estimated, .. } = &state.fitted;
        ExplanationCost { explains: estimated.explains, early: price(early), whole: price(estimated) }
    }

    /// By how much another explanation is dearer. Two that explain everything are compared in the beginnings: further on a
    /// deviance depends on what an ensemble takes for unpredictable, by more than a number costs.
    fn less_than(self, other: ExplanationCost) -> f64 {
        match (self.explains, other.explains) {
            (true, true) => other.early - self.early,
            (false, false) => other.whole - self.whole,
            (true, false) => f64::INFINITY,
            (false, true) => f64::NEG_INFINITY,
        }
    }
}

/// Asks the tests of a run: the cause, and what explains them with it.
pub(super) fn cause(
    experiment: &Experiment,
    run: &Coevolution,
    asked: Cause,
    on_step: &dyn Fn(&LadderStep),
) -> Result<(Cause, Option<Explanation>), String> {
    let (model, plan) = (experiment.model.as_ref(), run.plan());
    let phase = plan.posterior.clone().ok_or("the run has no posterior")?;
    let distance = plan.distance.build();
    let tests = chosen(run);
    if tests.is_empty() {
        return Err("no real test gave a log".to_owned());
    }
    let (learn, held_out) = tests.split_at(tests.len() - usize::from(tests.len() > 1));
    let numbers = |tests: &[&Entry]| tests.iter().map(|test| test.trial.number).collect();
    let part = |share: &f64| learn.iter().map(|test| test.beginning(*share)).collect();
    let beginnings: Vec<Vec<Entry>> = BEGINNINGS.iter().map(part).collect();
    let parts = beginnings.iter().map(|part| part.iter().collect());
    let abduction = Abduction {
        distance: distance.as_ref(),
        learn: parts.chain([learn.to_vec()]).collect(),
        held_out: held_out.to_vec(),
        phase: PosteriorPhase { restarts: 0, turns: TURNS, ..phase },
        seed: experiment.seed,
    };
    let scales = scales(model, learn).map_err(|e| e.to_string())?;
    let mut cost = Cost::default();
    let asking = CauseSearch { abduction, model, scales, context: &experiment.context, start: run.start().to_vec() };
    let mut ladder = Vec::new();
    let mut said = |step: String, fitted: &FittedExtension| {
        let ladder_step = LadderStep { step, train: fitted.estimated.chi, held_out: fitted.held_out };
        on_step(&ladder_step);
        ladder.push(ladder_step);
    };
    let mut state = asking.begin(&mut cost).ok_or("the model blows up on the real tests as it stands")?;
    said("S as it stands".to_owned(), &state.fitted);
    let mut effects = Vec::new();
    while !state.fitted.estimated.explains && effects.len() < MOST_EFFECTS {
        let Some((next, found)) = asking.round(&state, &mut cost) else { break };
        said(format!("+ {}@{}", found.effect, found.site), &next.fitted);
        effects.push(found);
        state = next;
    }
    state = asking.pruned(state, &mut effects, &mut cost);
    state = asking.simplified(state, &mut effects, &mut cost);
    // What was found first is told by what was found last: its values are those beside all others.
    for (k, found) in effects.iter_mut().enumerate() {
        found.parameters = asking.parameters(&state, k);
    }
    let explained = state.fitted.estimated.explains && state.fitted.confirmed;
    let verdict = match (explained, effects.is_empty()) {
        (true, true) => Verdict::NothingMissing,
        (true, false) => Verdict::EffectMissing,
        (false, _) => Verdict::Unexplained,
    };
    let space = state.extended.simulations().clone();
    let explanation = explained.then(|| Explanation { space, estimated: state.fitted.estimated.clone() });
    let cause = Cause {
        verdict: Some(verdict),
        effects,
        error_ladder: ladder,
        learnt: numbers(learn),
        held_out: numbers(held_out),
        rollouts: cost.evaluations as usize,
        ..asked
    };
    Ok((cause, explanation))
}

/// Tests that gave a log, the last ones: they were chosen for what they tell.
fn chosen(run: &Coevolution) -> Vec<&Entry> {
    let gave_a_log = |entry: &&Entry| entry.behaviour().is_some_and(|behaviour| behaviour.log.len() > 1);
    let usable: Vec<&Entry> = run.lately().iter().filter(gave_a_log).collect();
    usable[usable.len().saturating_sub(MOST_TESTS)..].to_vec()
}

/// What is large and what is small for this robot in what it was asked to do.
fn scales(model: &Model, learn: &[&Entry]) -> Result<RobotScales, WorldError> {
    let nominal = model.simulations().nominal();
    let simulated = learn
        .iter()
        .map(|test| model.simulate(model.request(&nominal, test.trial.scenario).controller(&test.trial.controller)));
    RobotScales::seen(&model.robot, &simulated.collect::<Result<Vec<_>, _>>()?)
}

struct CauseSearch<'a> {
    abduction: Abduction<'a>,
    model: &'a Model,
    scales: RobotScales,
    context: &'a ExecutionContext,
    /// s_0, about which S is believed to be before any test.
    start: Vec<f64>,
}

impl<'a> CauseSearch<'a> {
    /// S as it stands.
    fn begin(&self, cost: &mut Cost) -> Option<PresentExplanation<'a>> {
        let extended = self.extended(Vec::new())?;
        let prior = self.prior(extended.simulations());
        let fitted = self.abduction.fit(&extended, &prior, &prior, cost)?;
        Some(PresentExplanation { added: Vec::new(), fitted, prior, extended })
    }

    /// One effect more; `None` where none helps enough.
    fn round(
        &self,
        state: &PresentExplanation<'a>,
        cost: &mut Cost,
    ) -> Option<(PresentExplanation<'a>, MissingEffect)> {
        let glances = self.glances(state, cost);
        let mut fitted: Vec<PresentExplanation> = Vec::new();
        for glance in glances.iter().take(FITTED) {
            // Where one explains all, those that do not even explain the beginnings are no rivals.
            if !glance.explains && fitted.iter().any(|tried| tried.fitted.estimated.explains) {
                break;
            }
            fitted.extend(self.tried(&glance.added, &glance.belief, cost));
        }
        fitted.sort_by(|a, b| 0.0f64.total_cmp(&ExplanationCost::of(a).less_than(ExplanationCost::of(b))));
        let before = state.fitted.estimated.chi.powi(2);
        let leader = fitted.first()?;
        let helps = before - leader.fitted.estimated.chi.powi(2) > HELPS * (before - 1.0);
        let found = self.found(state, &fitted).filter(|_| helps)?;
        Some((fitted.swap_remove(0), found))
    }

    /// The suspects after a few turns, best first: those that promise most where S stands now, and where it began.
    fn glances(&self, state: &PresentExplanation<'a>, cost: &mut Cost) -> Vec<QuickEstimate> {
        let spaces: Vec<Extended> =
            self.offered(&state.added).into_iter().filter_map(|added| self.extended(added)).collect();
        let extensions: Vec<Extension> =
            spaces.iter().map(|extended| Extension { simulator: extended, probes: extended.probes() }).collect();
        let mut glances: Vec<QuickEstimate> = Vec::new();
        for base in [state.fitted.estimated.belief.clone(), self.abduction.unbiased(&state.prior)] {
            self.context.check_cancelled();
            let suspects = self.abduction.screen(&state.extended, &state.prior, &base, &extensions, cost);
            for suspect in suspects.iter().take(TRIED) {
                self.context.check_cancelled();
                let extended = &spaces[suspect.extension];
                let prior = self.prior(extended.simulations());
                let from = self.abduction.beginning(&base, suspect, &prior);
                let estimated = self.abduction.glance(extended, &prior, &from, GLANCE_TURNS, cost);
                let Some(Estimated { chi, belief, explains, .. }) = estimated else { continue };
                glances.push(QuickEstimate { added: extended.added().to_vec(), belief, chi, explains });
            }
        }
        glances.sort_by(|a, b| a.chi.total_cmp(&b.chi));
        let mut names: Vec<Option<String>> = Vec::new();
        glances.retain(|glance| {
            let name = glance.added.last().map(Added::name);
            let first = !names.contains(&name);
            names.push(name);
            first
        });
        glances
    }

    /// Effects with their numbers.
    fn tried(&self, added: &[Added], from: &Posterior, cost: &mut Cost) -> Option<PresentExplanation<'a>> {
        self.context.check_cancelled();
        let extended = self.extended(added.to_vec())?;
        let prior = self.prior(extended.simulations());
        let fitted = self.abduction.fit(&extended, &prior, from, cost)?;
        Some(PresentExplanation { added: added.to_vec(), fitted, prior, extended })
    }

    /// The same effects but for those that nothing is lost without: what was found first may have stood in for what was found
    /// after it, and what was found last may only have led the estimate out of a local minimum.
    fn pruned(
        &self,
        mut state: PresentExplanation<'a>,
        effects: &mut Vec<MissingEffect>,
        cost: &mut Cost,
    ) -> PresentExplanation<'a> {
        let mut k = 0;
        while k < state.added.len() {
            let tried = self.without(&state, k).and_then(|(added, from)| self.tried(&added, &from, cost));
            match tried.filter(|tried| ExplanationCost::of(tried).less_than(ExplanationCost::of(&state)) > 0.0) {
                Some(tried) => {
                    effects.remove(k);
                    state = tried;
                }
                None => k += 1,
            }
        }
        state
    }

    /// The effects of a state but for one of several, and a belief to begin with. `None` for what was found last and is surely
    /// there: that without it more is left unexplained was seen when it was found.
    fn without(&self, state: &PresentExplanation, k: usize) -> Option<(Vec<Added>, Posterior)> {
        let mut added = state.added.clone();
        added.remove(k);
        let (known, belief) = (state.extended.simulations(), &state.fitted.estimated.belief);
        let from = match self.may_be_off(state, k) {
            true => belief.carried(known, self.extended(added.clone())?.simulations())?,
            false if k + 1 < state.added.len() => self.about(state, &added, None),
            false => return None,
        };
        (!added.is_empty()).then_some((added, from))
    }

    /// Whether all intervals of an effect hold the value at which it does nothing.
    fn may_be_off(&self, state: &PresentExplanation, k: usize) -> bool {
        let places = self.places(state, k);
        let known = &state.extended.simulations().dims()[places.clone()];
        let belief = &state.fitted.estimated.belief;
        let holds = |(place, dim): (usize, &Dim)| {
            dim.nominal
                .is_some_and(|off| (dim.to_unit(off) - belief.mean()[place]).abs() < TWO_SIDED_95 * belief.sd(place))
        };
        places.zip(known).all(holds)
    }

    /// Where in its space a state has the numbers of the effect that was added as number `k`.
    fn places(&self, state: &PresentExplanation, k: usize) -> Range<usize> {
        let count = |added: &Added| added.effect.spec().params.len();
        let from = self.model.simulations().len() + state.added[..k].iter().map(count).sum::<usize>();
        from..from + count(&state.added[k])
    }

    /// The same effects with simpler laws in place of those that contain them, where nothing is lost by that.
    fn simplified(
        &self,
        mut state: PresentExplanation<'a>,
        effects: &mut [MissingEffect],
        cost: &mut Cost,
    ) -> PresentExplanation<'a> {
        for k in 0..state.added.len() {
            for (name, _) in state.added[k].effect.spec().nested {
                let Some(simpler) = effects::find(name) else { continue };
                let mut added = state.added.clone();
                added[k].effect = simpler;
                let Some(tried) = self.tried(&added, &self.about(&state, &added, Some(k)), cost) else { continue };
                if ExplanationCost::of(&tried).less_than(ExplanationCost::of(&state)) > 0.0 {
                    (*name).clone_into(&mut effects[k].effect);
                    state = tried;
                    break;
                }
            }
        }
        state
    }

    /// A belief to begin with where some effects of a state remain: their numbers as they are known, and in place of a `replaced`
    /// one's those that have the same unit.
    fn about(&self, state: &PresentExplanation, added: &[Added], replaced: Option<usize>) -> Posterior {
        let (known, mean) = (state.extended.simulations(), state.fitted.estimated.belief.mean());
        let own = self.model.simulations().len();
        let base = Posterior::of_bounds(&mean.as_slice()[..own]);
        let Some(extended) = self.extended(added.to_vec()) else { return base };
        let former = replaced.map(|k| format!("{}.", state.added[k].effect.spec().name));
        let start = extended.simulations().dims()[own..].iter().map(|dim| {
            let same = |other: &Dim| other.name == dim.name;
            let alike = |other: &Dim| {
                let site = dim.name.split_once('@').map(|(_, site)| site);
                let of_former = former.as_ref().is_some_and(|former| other.name.starts_with(former));
                of_former && other.name.split_once('@').map(|(_, site)| site) == site && other.unit == dim.unit
            };
            let place = known.dims().iter().position(same).or_else(|| known.dims().iter().position(alike));
            place.map_or(0.5, |place| dim.to_unit(known.dims()[place].from_unit(mean[place])))
        });
        let suspect = Suspect { extension: 0, start: start.collect(), left: 1.0 };
        self.abduction.beginning(&base, &suspect, &self.prior(extended.simulations()))
    }

    /// The leader as it is told, beside those that explain as much.
    fn found(&self, before: &PresentExplanation, tried: &[PresentExplanation]) -> Option<MissingEffect> {
        let leader = tried.first()?;
        let last = leader.added.last()?;
        let price = ExplanationCost::of(leader);
        let dearer = |other: &PresentExplanation| price.less_than(ExplanationCost::of(other));
        let close = |other: &&PresentExplanation| dearer(other) < ALIKE;
        let alike = tried.iter().skip(1).filter(close).filter_map(|other| Some(other.added.last()?.name()));
        let rivals: f64 = tried.iter().skip(1).map(|other| (-0.5 * dearer(other)).exp()).sum();
        Some(MissingEffect {
            effect: last.effect.spec().name.to_owned(),
            site: last.site.clone(),
            alike: alike.collect(),
            probability: 1.0 / (1.0 + rivals),
            delta_bic: ExplanationCost::of(before).whole - price.whole,
            parameters: Vec::new(),
            candidate: 0,
        })
    }

    /// The numbers of the effect that was added as number `k`.
    fn parameters(&self, state: &PresentExplanation, k: usize) -> Vec<Estimate> {
        let places = self.places(state, k);
        let known = &state.extended.simulations().dims()[places.clone()];
        let belief = &state.fitted.estimated.belief;
        let trusted = state.fitted.estimated.explains;
        let number = |(place, dim): (usize, &Dim)| {
            let (u, half) = (belief.mean()[place], TWO_SIDED_95 * belief.sd(place));
            let at_bound = !(1e-3..=1.0 - 1e-3).contains(&u) && dim.nominal.is_none();
            let ci95 = (trusted && !at_bound).then(|| [dim.from_unit(u - half), dim.from_unit(u + half)]);
            let value = dim.from_unit(u);
            Estimate { name: dim.name.clone(), unit: dim.unit.clone(), value, ci95, at_bound, by_bounds: false }
        };
        places.zip(known).map(number).collect()
    }

    /// Everything that could be added once more: every effect at every place, and those of joints on all of them at once.
    fn offered(&self, added: &[Added]) -> Vec<Vec<Added>> {
        let mut offered = Vec::new();
        for effect in EFFECTS.iter().copied() {
            let spec = effect.spec();
            let all = (spec.site == SiteKind::Joint).then(|| "*".to_owned());
            for site in sites(effect, self.model).into_iter().chain(all) {
                let next = Added { effect, site };
                if !added.iter().any(|known| known.name() == next.name()) {
                    offered.push(added.iter().cloned().chain([next]).collect());
                }
            }
        }
        offered
    }

    fn extended(&self, added: Vec<Added>) -> Option<Extended<'a>> {
        Extended::new(self.model, added, &self.scales).ok()
    }

    /// What is known of a space without any test: S about where it began, effects off.
    fn prior(&self, space: &Space) -> Posterior {
        let off = space.dims().iter().skip(self.start.len()).map(|dim| dim.nominal.map_or(0.5, |off| dim.to_unit(off)));
        let own = space.dims().iter().zip(&self.start).map(|(dim, value)| dim.to_unit(*value));
        Posterior::of_bounds(&own.chain(off).collect::<Vec<_>>())
    }
}
