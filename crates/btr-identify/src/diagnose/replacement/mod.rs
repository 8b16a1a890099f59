//! How findings are replaced: by a simpler effect that will do, or by one that could not be told from them before.

mod alike;
mod fewer;
mod split;

use crate::LadderStep;
use crate::diagnose::own;
use crate::diagnose::refit::{CLOSE, Rival, race};
use crate::diagnose::report::RankedCandidate;
use crate::diagnose::screen::{StartPoint, screen, with};
use crate::diagnose::state::{DiagnosisState, earns_its_parameters};
use crate::diagnose::thresholds::{DECISIVE, HELD_OUT_FALL, LEARNT_FALL, TIE};
use crate::fit::measure::{ComparisonMeasure, held_out_squares};
use crate::fit::{FitPoint, Objective, SearchBudget};
use crate::residual_model::Parametrisation;
use std::ops::Range;

impl DiagnosisState {
    /// The best fit without one of the chosen.
    pub(super) fn without(&self, objective: &Objective, index: usize) -> Option<FitPoint> {
        let removed = self.less(objective, &[index]).map(|mut fit| {
            own::solve(objective, self.chosen[index].candidate, &mut fit, SearchBudget { jacobians: 2, steps: 12 });
            fit
        });
        // The latest effect may have adapted to this one: also fits it as if this one had never been found.
        let others = [self.merged(objective, index), self.instead(objective, index)];
        let without = removed.into_iter().chain(others.into_iter().flatten()).min_by(|a, b| a.cost.total_cmp(&b.cost));
        without.map(|mut fit| {
            let near = (1.0 + LEARNT_FALL) * self.fit.squares()..CLOSE * self.fit.squares();
            if near.contains(&fit.squares()) {
                fit.polish(objective);
            }
            fit
        })
    }

    /// The point without some of the chosen; all else stays. `None` where that cannot be simulated: then they stay
    /// chosen.
    pub(super) fn less(&self, objective: &Objective, indices: &[usize]) -> Option<FitPoint> {
        let parameters =
            |&index: &usize| objective.candidates()[self.chosen[index].candidate].parameters().collect::<Vec<_>>();
        let gone: Vec<usize> = indices.iter().flat_map(parameters).collect();
        let mut u = self.fit.u.clone();
        gone.iter().for_each(|&parameter| u[parameter] = 0.0);
        let active = self.fit.active.iter().copied().filter(|parameter| !gone.contains(parameter)).collect();
        FitPoint::at(objective, active, u, &self.fit.step_error).ok()
    }

    /// The latest of the chosen with what a similar one of fewer parameters has given so far: Coulomb's friction is
    /// part of Stribeck's, and the way from both at once to the latter alone leads over a higher cost.
    fn merged(&self, objective: &Objective, index: usize) -> Option<FitPoint> {
        let candidate = |k: usize| &objective.candidates()[self.chosen[k].candidate];
        let latest = self.chosen.len() - 1;
        let (part, whole) = (candidate(index), candidate(latest));
        let is_part = part.similar.contains(&self.chosen[latest].candidate)
            && part.parameters().count() < whole.parameters().count();
        let mut fit = if is_part { self.less(objective, &[index]) } else { None }?;
        let parameters = objective.parameters();
        let is_added = |k: &&usize| parameters[**k].law == Parametrisation::Linear;
        for &amplitude in whole.amplitudes.iter().filter(is_added) {
            let parameter = &parameters[amplitude];
            let same_unit = part.amplitudes.iter().filter(is_added).filter(|&&k| parameters[k].unit == parameter.unit);
            let given: f64 = same_unit.map(|&k| parameters[k].value(self.fit.u[k])).sum();
            let value = parameter.value(fit.u[amplitude]) + given;
            fit.u[amplitude] = parameter.clamp(parameter.coordinate(value));
        }
        let mut fit = FitPoint::at(objective, fit.active, fit.u, &self.fit.step_error).ok()?;
        own::solve(objective, self.chosen[latest].candidate, &mut fit, SearchBudget { jacobians: 2, steps: 12 });
        Some(fit)
    }

    /// The latest of the chosen fitted in the place of an earlier one.
    fn instead(&self, objective: &Objective, index: usize) -> Option<FitPoint> {
        let latest = self.chosen.len() - 1;
        self.replaced(objective, &[index, latest], &[self.chosen[latest].candidate]).map(|rival| rival.fit)
    }

    /// The best of some candidates in the place of some of the chosen.
    pub(super) fn replaced(&self, objective: &Objective, indices: &[usize], candidates: &[usize]) -> Option<Rival> {
        self.replaced_from(objective, indices, candidates, Vec::new())
    }

    /// The same with further starts.
    fn replaced_from(
        &self,
        objective: &Objective,
        indices: &[usize],
        candidates: &[usize],
        mut starts: Vec<StartPoint>,
    ) -> Option<Rival> {
        let mut bases = vec![self.less(objective, indices)?];
        starts.extend(screen(objective, &mut bases, candidates));
        race(objective, &bases, &starts, None).into_iter().next()
    }

    /// Starts of candidates in the place of one of the chosen, from the values of its parameters of the same names, or
    /// else, for a law that it contains, from the mean of its amplitudes of the same unit (Coulomb's friction inside
    /// one that depends on the direction): far from the logs without it, no probe predicts much.
    fn carried_over(&self, objective: &Objective, index: usize, candidates: &[usize]) -> Vec<StartPoint> {
        let parameters = objective.parameters();
        let name =
            |k: usize| parameters[k].name.split_once('.').and_then(|(_, rest)| rest.split_once('@')).map(|n| n.0);
        let chosen = &objective.candidates()[self.chosen[index].candidate];
        let found: Vec<usize> = chosen.parameters().collect();
        let value = |k: &usize| parameters[*k].value(self.fit.u[*k]);
        let start = |&candidate: &usize| {
            let effect = &objective.candidates()[candidate];
            let same = |k: usize| found.iter().find(|&&other| name(k).is_some() && name(other) == name(k));
            let mut carried: Vec<(usize, f64)> =
                effect.parameters().filter_map(|k| Some((k, value(same(k)?)))).collect();
            if carried.is_empty() && chosen.nested.contains(&candidate) {
                let of_unit =
                    |k: usize| chosen.amplitudes.iter().filter(move |&&o| parameters[o].unit == parameters[k].unit);
                let mean = |k: usize| of_unit(k).map(value).sum::<f64>() / of_unit(k).count() as f64;
                carried.extend(effect.amplitudes.iter().map(|&k| (k, mean(k))).filter(|(_, mean)| mean.is_finite()));
            }
            let mut u = self.fit.u.clone();
            found.iter().for_each(|&k| u[k] = 0.0);
            effect.shapes.iter().zip(&effect.starts[0]).for_each(|(&k, &shape)| u[k] = shape);
            carried.iter().for_each(|&(k, value)| u[k] = parameters[k].clamp(parameters[k].coordinate(value)));
            (!carried.is_empty()).then_some(StartPoint { candidate, base: 0, u, cost: f64::INFINITY })
        };
        candidates.iter().filter_map(start).collect()
    }

    /// Replaces each of these effects by a similar one with fewer parameters that explains as much, now that other
    /// effects or starts are known, unless the held-out logs contradict it: it may have needed its extra parameters to
    /// compensate for them.
    pub(super) fn simplify(&mut self, objective: &Objective, which: Range<usize>) {
        let candidates = objective.candidates();
        for index in which {
            let effect = &candidates[self.chosen[index].candidate];
            let simpler = |similar: &usize| {
                candidates[*similar].parameters().count() < effect.parameters().count()
                    && self.chosen.iter().all(|found| found.candidate != *similar)
            };
            let similar: Vec<usize> = effect.similar.iter().copied().filter(simpler).collect();
            if similar.is_empty() || !self.may_depend_on_latest(objective, index) {
                continue;
            }
            let starts = self.carried_over(objective, index, &similar);
            if let Some(rival) = self.replaced_from(objective, &[index], &similar, starts) {
                self.rename_if_it_will_do(objective, index, rival);
            }
        }
    }

    /// Replaces the latest effect by a law that it contains, fitted from its values, if that explains as much: the race
    /// may not have brought that law as far as this one.
    pub(super) fn simplify_latest(&mut self, objective: &Objective) {
        let Some(index) = self.chosen.len().checked_sub(1) else { return };
        let fitted = self.nested_in_place(objective, index, |_| true).into_iter();
        if let Some(rival) = fitted.min_by(|a, b| a.fit.cost.total_cmp(&b.fit.cost)) {
            self.rename_if_it_will_do(objective, index, rival);
        }
    }

    /// The laws that a finding contains and that are asked about, each fitted in its place from its values.
    pub(super) fn nested_in_place(
        &self,
        objective: &Objective,
        index: usize,
        is_asked: impl Fn(usize) -> bool,
    ) -> Vec<Rival> {
        let nested = &objective.candidates()[self.chosen[index].candidate].nested;
        let nested: Vec<usize> = nested.iter().copied().filter(|&law| !self.is_chosen(law) && is_asked(law)).collect();
        let less = if nested.is_empty() { None } else { self.less(objective, &[index]) };
        let Some(less) = less else { return Vec::new() };
        let fitted = |start: StartPoint| {
            let active = with(&less, &objective.candidates()[start.candidate]);
            let mut fit = FitPoint::at(objective, active, start.u, &self.fit.step_error).ok()?;
            own::solve(objective, start.candidate, &mut fit, SearchBudget::FULL);
            Some(Rival { candidate: start.candidate, fit })
        };
        self.carried_over(objective, index, &nested).into_iter().filter_map(fitted).collect()
    }

    /// Whether the held-out logs do not contradict what takes the place of a finding.
    fn is_borne_out(&self, objective: &Objective, candidate: usize, fit: &FitPoint) -> bool {
        let confirms = |now: f64| {
            own::held_out(objective, candidate, &fit.u).is_some_and(|then| then <= (1.0 + HELD_OUT_FALL) * now)
        };
        self.own_held_out(objective, candidate).is_none_or(confirms)
    }

    /// Replaces a finding by a simpler one that explains as much, unless the held-out logs contradict it.
    fn rename_if_it_will_do(&mut self, objective: &Objective, index: usize, rival: Rival) {
        let measure = ComparisonMeasure::of(objective, &self.fit);
        let costs = measure.behind(&rival.fit, &self.fit);
        let inside = objective.candidates()[self.chosen[index].candidate].nested.contains(&rival.candidate);
        let will_do =
            costs <= TIE || inside && !earns_its_parameters(objective, rival.candidate, &self.fit, &rival.fit);
        if will_do && self.is_borne_out(objective, rival.candidate, &rival.fit) {
            self.rename(objective, index, rival, costs);
        }
    }

    /// Compares findings again with what could not be told from them before the others were known, where an error is
    /// left: replaces each by one that explains decisively more.
    pub(super) fn reconsider(&mut self, objective: &Objective, on_step: &dyn Fn(&LadderStep)) {
        let candidates = objective.candidates();
        for index in 0..self.chosen.len().saturating_sub(1) {
            if !self.leaves_something(objective, &self.fit) {
                return;
            }
            if !self.may_depend_on_latest(objective, index) {
                continue;
            }
            let was_alike = |candidate: &usize| self.chosen[index].alike.contains(&candidates[*candidate].name());
            let alike: Vec<usize> = (0..candidates.len()).filter(|c| was_alike(c) && !self.is_chosen(*c)).collect();
            let confirmed = |now: f64, then: f64| then < (1.0 - HELD_OUT_FALL) * now;
            if self.give_way(objective, index, &alike, confirmed) {
                self.ladder.last().into_iter().for_each(on_step);
            }
        }
    }

    /// Replaces a similar finding by what only the training logs show, where that explains decisively more and the
    /// held-out logs no less: they may hold too little of it to confirm it. Says whether it did.
    pub(super) fn replace_by_unconfirmed(&mut self, objective: &Objective, on_step: &dyn Fn(&LadderStep)) -> bool {
        let Some(candidate) = self.unconfirmed.take().map(|(rival, _)| rival.candidate) else { return false };
        let not_contradicted = |now: f64, then: f64| then <= now;
        let replaced = (0..self.chosen.len()).any(|index| {
            let is_similar = objective.candidates()[candidate].similar.contains(&self.chosen[index].candidate);
            is_similar && self.give_way(objective, index, &[candidate], not_contradicted)
        });
        if replaced {
            self.ladder.last().into_iter().for_each(on_step);
        }
        replaced
    }

    /// Replaces a finding by one of some candidates that explains decisively more, if the held-out logs, whose sums of
    /// squares now and then are compared, agree. Says whether it did.
    fn give_way(
        &mut self,
        objective: &Objective,
        index: usize,
        candidates: &[usize],
        agree: impl Fn(f64, f64) -> bool,
    ) -> bool {
        let rival = if candidates.is_empty() { None } else { self.replaced(objective, &[index], candidates) };
        let Some(rival) = rival else { return false };
        let measure = ComparisonMeasure::of(objective, &rival.fit);
        let gains = measure.behind(&self.fit, &rival.fit);
        let held_out = |fit: &FitPoint| own::held_out(objective, rival.candidate, &fit.u);
        let now = self.own_held_out(objective, rival.candidate);
        let then = self.held_out.and_then(|_| held_out(&rival.fit));
        let agreed = now.is_none_or(|now| then.is_some_and(|then| agree(now, then)));
        let learnt = |fit: &FitPoint| own::learnt(objective, rival.candidate, fit);
        let better = gains > DECISIVE && learnt(&rival.fit) < (1.0 - LEARNT_FALL) * learnt(&self.fit) && agreed;
        if better {
            self.rename(objective, index, rival, -gains);
            self.chosen[index].alike.clear();
            self.chosen[index].rivals.clear();
        }
        better
    }

    /// Declares a finding and a larger law that contains it alike, if that would still explain something for certain:
    /// then the logs show too little of the difference to decide.
    pub(super) fn declare_larger_laws(&mut self, objective: &Objective, left_over: Option<&RankedCandidate>) {
        let candidates = objective.candidates();
        let larger = candidates.iter().find(|candidate| left_over.is_some_and(|left| left.name == candidate.name()));
        let Some(larger) = larger else { return };
        for found in self.chosen.iter_mut().filter(|found| larger.nested.contains(&found.candidate)) {
            if !found.alike.contains(&larger.name()) {
                found.alike.push(larger.name());
            }
        }
    }

    fn rename(&mut self, objective: &Objective, index: usize, rival: Rival, costs: f64) {
        let before = objective.candidates()[self.chosen[index].candidate].name();
        self.put_in_place(objective, index, rival, (costs, before));
    }

    /// Puts a rival in the place of a finding; `before` names what it takes the place of, which may be more than that
    /// one, and `costs` is how far it is behind, in units of B.
    fn put_in_place(&mut self, objective: &Objective, index: usize, rival: Rival, (costs, before): (f64, String)) {
        let candidates = objective.candidates();
        let (effect, found) = (&candidates[rival.candidate], &mut self.chosen[index]);
        let is_part = candidates[found.candidate].nested.contains(&rival.candidate);
        found.turn_into(rival.candidate, effect);
        found.delta_bic -= costs;
        // A law that the new one is part of leaves it its probability; another one shares it, if it comes close.
        if is_part {
            found.alike.push(before.clone());
        } else if costs >= -DECISIVE {
            found.share_with(vec![(before.clone(), (costs.min(0.0) / 2.0).exp())]);
        }
        if self.rivals.first().is_some_and(|first| !self.chosen.iter().any(|f| f.candidate == first.candidate)) {
            self.rivals.clear();
        }
        self.fit = rival.fit;
        self.fit.jacobian = None;
        self.fit.solve(objective, SearchBudget::FULL);
        self.held_out = held_out_squares(objective, &self.fit.u).filter(|_| self.held_out.is_some());
        self.ladder.push(self.step(objective, format!("{} for {before}", effect.name())));
    }
}
