//! The state of a diagnosis: the effects found so far, and how an effect is added or dropped.

mod leave_one_out;
mod restart;

use super::evidence::{LogErrors, MeanSquares};
use super::own;
use super::refit::{FOLLOWER, Rival};
use super::report::{Evidence, MissingEffect, RankedCandidate, RivalPoint};
use super::screen::is_searched;
use super::thresholds::{DECISIVE, HELD_OUT_FALL, LEARNT_FALL};
use crate::LadderStep;
use crate::fit::measure::{ComparisonMeasure, held_out_squares};
use crate::fit::residual_vector::chi;
use crate::fit::{FitPoint, LogSet, Objective, SearchBudget};
use crate::residual_model::Needs;

/// An effect without which, all else unchanged, the sum of squares rises by no more than this share is as good as off.
const IDLE: f64 = 0.001;

/// Starts that leave less than this share of the squares above the noise explain most of what was left: a missing
/// effect acts through a whole log, and other starts hardly make up for it.
const STARTS_LEAVE: f64 = 0.25;

/// What is explained of the error that is left.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Explains {
    Everything,
    Most,
    Little,
}

/// The base of a round and the effects found so far.
#[derive(Clone)]
pub(super) struct DiagnosisState {
    pub(super) fit: FitPoint,
    /// The fit without any effect.
    pub(super) bare: FitPoint,
    /// Squares on the held-out logs.
    pub(super) held_out: Option<f64>,
    pub(super) chosen: Vec<MissingEffect>,
    pub(super) ladder: Vec<LadderStep>,
    pub(super) rivals: Vec<RivalPoint>,
    pub(super) rounds: Vec<Vec<RankedCandidate>>,
    /// What the training logs show best in the last round, if the held-out logs did not confirm it.
    pub(super) unconfirmed: Option<(Rival, MissingEffect)>,
    /// Where each joint is a question of its own: those at which nothing was found since something changed there.
    pub(super) settled: Vec<SettledJoint>,
    /// What the last round ranked first, if it accepted nothing.
    pub(super) left_over: Option<RankedCandidate>,
    /// The integrator's error, in multiples of the noise floor.
    pub(super) integrator: f64,
    /// The errors before the first finding; 0 before that.
    pub(super) unexplained_at_first: MeanSquares,
    pub(super) tried: Tried,
}

/// A joint at which nothing was found.
#[derive(Clone)]
pub(super) struct SettledJoint {
    /// The channels in which its candidates show.
    pub(super) channels: Vec<String>,
    /// What the training logs show best there, if the held-out logs did not confirm it.
    pub(super) unconfirmed: Option<(Rival, MissingEffect)>,
}

/// What was tried where the search ended with an error left.
#[derive(Clone, Copy, Default)]
pub(super) struct Tried {
    pub(super) afresh: bool,
    pub(super) another_first: bool,
}

impl DiagnosisState {
    /// The candidates that may be found next.
    pub(super) fn offered(&self, objective: &Objective) -> Vec<usize> {
        let acts = |needs: &Needs| match needs {
            Needs::Nothing => true,
            Needs::OneOf(others) => others.iter().any(|&other| self.is_chosen(other)),
            Needs::Instance(first) => self.is_chosen(*first),
        };
        let candidates = objective.candidates().iter().enumerate();
        candidates
            .filter(|(index, candidate)| !self.is_chosen(*index) && acts(&candidate.needs))
            .map(|(index, _)| index)
            .collect()
    }

    /// Whether a candidate shows only where nothing was found since something changed there.
    pub(super) fn is_settled(&self, objective: &Objective, candidate: usize) -> bool {
        self.settled.iter().any(|joint| own::shows_in(objective, candidate, &joint.channels))
    }

    /// Forgets what was not confirmed at the joint of a candidate.
    pub(super) fn forget_unconfirmed(&mut self, candidate: usize) {
        let at_joint = |joint: &&mut SettledJoint| {
            joint.unconfirmed.as_ref().is_some_and(|(rival, _)| rival.candidate == candidate)
        };
        self.settled.iter_mut().filter(at_joint).for_each(|joint| joint.unconfirmed = None);
    }

    pub(super) fn is_chosen(&self, candidate: usize) -> bool {
        self.chosen.iter().any(|found| found.candidate == candidate)
    }

    /// Number of effects found, companions and further instances left out.
    pub(super) fn effects(&self, objective: &Objective) -> usize {
        let alone = |found: &&MissingEffect| objective.candidates()[found.candidate].needs == Needs::Nothing;
        self.chosen.iter().filter(alone).count()
    }

    /// A rival beside what was found since it was fitted, at other joints.
    pub(super) fn beside_others(&self, objective: &Objective, rival: Rival) -> Rival {
        if self.fit.active.iter().all(|parameter| rival.fit.active.contains(parameter)) {
            return rival;
        }
        // Where both cannot be simulated, the rival stays as it was.
        self.with_rival(objective, &rival).unwrap_or(rival)
    }

    /// The current fit with a rival's values of its own parameters; `None` where that cannot be simulated.
    pub(super) fn with_rival(&self, objective: &Objective, rival: &Rival) -> Option<Rival> {
        let candidate = &objective.candidates()[rival.candidate];
        let is_added = |parameter: &usize| candidate.parameters().any(|own| own == *parameter);
        let mut u = self.fit.u.clone();
        candidate.parameters().for_each(|parameter| u[parameter] = rival.fit.u[parameter]);
        let added = rival.fit.active.iter().copied().filter(is_added);
        let active = self.fit.active.iter().copied().chain(added).collect();
        let fit = FitPoint::at(objective, active, u, &self.fit.step_error).ok()?;
        Some(Rival { fit, ..rival.clone() })
    }

    /// Makes the winner the new base.
    pub(super) fn accept(
        &mut self,
        objective: &mut Objective,
        rival: Rival,
        found: MissingEffect,
        on_step: &dyn Fn(&LadderStep),
    ) {
        let before = LogErrors::of(objective, found.candidate, &self.fit, self.held_out);
        let own_at_first = self.own_at_first(objective, found.candidate);
        self.fit = rival.fit;
        self.integrator = self.fit.renew_step_error(objective);
        self.fit.jacobian = None;
        self.fit.solve(objective, SearchBudget::FULL);
        if is_searched(objective, found.candidate) {
            self.fit.sharpen(objective);
        } else if self.leaves_something(objective, &self.fit) {
            self.fit.polish(objective);
            self.perturb(objective, found.candidate);
        }
        let step = objective.candidates()[found.candidate].step();
        self.chosen.push(found);
        self.record(objective, step, on_step);
        self.unexplained_at_first = self.unexplained_at_first.max(before.mean);
        let Some(found) = self.chosen.last().map(|found| found.candidate) else { return };
        self.settled
            .retain(|joint| own::is_apart(objective, found) && !own::shows_in(objective, found, &joint.channels));
        let after = LogErrors::of(objective, found, &self.fit, self.held_out);
        let evidence = Evidence::of(&before, &after, own_at_first.unwrap_or(self.unexplained_at_first));
        if let Some(found) = self.chosen.last_mut() {
            found.evidence = evidence;
        }
    }

    /// The squares on the held-out logs in the channels where a candidate shows; `None` where these hold nothing of it.
    pub(super) fn own_held_out(&self, objective: &Objective, candidate: usize) -> Option<f64> {
        let whole = self.held_out?;
        if !own::is_apart(objective, candidate) {
            return Some(whole);
        }
        let is_judged = own::samples(objective, candidate, LogSet::HeldOut) > 0;
        is_judged.then(|| own::held_out(objective, candidate, &self.fit.u)).flatten()
    }

    /// The errors before the first finding in the channels where a candidate shows; `None` where these are all.
    pub(super) fn own_at_first(&self, objective: &Objective, candidate: usize) -> Option<MeanSquares> {
        own::is_apart(objective, candidate).then(|| LogErrors::of(objective, candidate, &self.bare, self.held_out).mean)
    }

    /// Drops earlier effects that the latest one has made superfluous; and the latest, if it is as good as off: what it
    /// seemed to explain may have been a better fit of the others.
    pub(super) fn eliminate(&mut self, objective: &Objective) {
        let mut index = 0;
        while self.chosen.len() > 1 && index + 1 < self.chosen.len() {
            if self.has_further_instances(objective, index) || !self.may_depend_on_latest(objective, index) {
                index += 1;
                continue;
            }
            let without = self.without(objective, index);
            let measure = ComparisonMeasure::of(objective, &self.fit);
            let needless = without.filter(|fit| {
                let costs = measure.behind(fit, &self.fit);
                let left = |fit: &FitPoint| own::learnt(objective, self.chosen[index].candidate, fit);
                costs <= DECISIVE || left(fit) <= (1.0 + LEARNT_FALL) * left(&self.fit)
            });
            match needless {
                Some(fit) => {
                    // What the earlier one explained, the latest explains in its place.
                    let explained = self.chosen[index].evidence;
                    self.drop_with(objective, index, fit);
                    self.chosen.last_mut().into_iter().for_each(|latest| latest.evidence.add(&explained));
                }
                None => index += 1,
            }
        }
        let latest = self.chosen.len().saturating_sub(1);
        let off = if latest > 0 { self.less(objective, &[latest]) } else { None };
        let idle = |off: &FitPoint| {
            let left = |fit: &FitPoint| own::learnt(objective, self.chosen[latest].candidate, fit);
            left(off) <= (1.0 + IDLE) * left(&self.fit)
        };
        if let Some(fit) = off.filter(idle) {
            self.drop_with(objective, latest, fit);
        }
    }

    /// Drops findings that have become needless since: what the links have adapts to each finding, and with it what is
    /// left at joints where nothing was found any more.
    pub(super) fn drop_needless(&mut self, objective: &Objective) {
        let mut index = 0;
        while self.chosen.len() > 1 && index < self.chosen.len() {
            let candidate = self.chosen[index].candidate;
            let kept = self.has_further_instances(objective, index);
            let mut without = if kept { None } else { self.less(objective, &[index]) };
            if let Some(fit) = &mut without {
                own::solve(objective, candidate, fit, FOLLOWER);
            }
            let left = |fit: &FitPoint| own::learnt(objective, candidate, fit);
            match without.filter(|fit| left(fit) <= (1.0 + LEARNT_FALL) * left(&self.fit)) {
                Some(fit) => self.drop_with(objective, index, fit),
                None => index += 1,
            }
        }
    }

    /// Whether the latest finding can make a difference to one: not where they show in different channels.
    pub(super) fn may_depend_on_latest(&self, objective: &Objective, index: usize) -> bool {
        !self.chosen.is_empty() && self.may_depend_on(objective, index, self.chosen.len() - 1)
    }

    /// Whether one finding can make a difference to another: not where they show in different channels.
    pub(super) fn may_depend_on(&self, objective: &Objective, index: usize, on: usize) -> bool {
        let (Some(one), Some(other)) = (self.chosen.get(index), self.chosen.get(on)) else { return false };
        let apart = |found: &MissingEffect| own::is_apart(objective, found.candidate);
        !apart(one) || !apart(other) || own::are_together(objective, one.candidate, other.candidate)
    }

    /// Drops a finding; `fit` is the fit without it.
    pub(super) fn drop_with(&mut self, objective: &Objective, index: usize, fit: FitPoint) {
        self.fit = fit;
        self.held_out = held_out_squares(objective, &self.fit.u).filter(|_| self.held_out.is_some());
        let gone = self.chosen.remove(index);
        self.ask_again_at(objective, gone.candidate);
        self.ladder.push(self.step(objective, format!("- {}@{}", gone.effect, gone.site)));
    }

    /// Lets the joint where a candidate shows be asked again.
    pub(super) fn ask_again_at(&mut self, objective: &Objective, candidate: usize) {
        self.settled.retain(|joint| !own::shows_in(objective, candidate, &joint.channels));
    }

    /// Measures the errors before the first finding once more, as the noise floors are others now.
    pub(super) fn renew_first_errors(&mut self, objective: &Objective) {
        if !self.chosen.is_empty() {
            let held_out = self.held_out.and_then(|_| held_out_squares(objective, &self.bare.u));
            self.unexplained_at_first = LogErrors::in_all(objective, &self.bare, held_out).mean;
        }
    }

    /// Whether another finding only changes how this one acts.
    pub(super) fn has_companions(&self, objective: &Objective, index: usize) -> bool {
        let candidate = self.chosen[index].candidate;
        let needs_it = |needs: &Needs| matches!(needs, Needs::OneOf(others) if others.contains(&candidate));
        self.chosen.iter().any(|found| needs_it(&objective.candidates()[found.candidate].needs))
    }

    /// The state without any finding, at the fit without them.
    pub(super) fn without_findings(&self, objective: &Objective, bare: FitPoint) -> DiagnosisState {
        let held_out = self.held_out.and_then(|_| held_out_squares(objective, &bare.u));
        let (rivals, chosen, settled) = (Vec::new(), Vec::new(), Vec::new());
        let (unconfirmed, left_over) = (None, None);
        let mut state =
            DiagnosisState { fit: bare, held_out, chosen, rivals, unconfirmed, settled, left_over, ..self.clone() };
        for gone in &self.chosen {
            state.ladder.push(state.step(objective, format!("- {}@{}", gone.effect, gone.site)));
        }
        state
    }

    /// Whether an instance after this one is among the findings.
    pub(super) fn has_further_instances(&self, objective: &Objective, index: usize) -> bool {
        let after = Needs::Instance(self.chosen[index].candidate);
        self.chosen.iter().any(|found| objective.candidates()[found.candidate].needs == after)
    }

    /// Takes another point without any further effect as the base, if its cost is lower: what the base reaches by
    /// itself is not due to an effect.
    pub(super) fn follow(&mut self, objective: &Objective, mut base: FitPoint) {
        base.solve(objective, FOLLOWER);
        if base.cost < self.fit.cost {
            self.fit = base;
            self.renew_last_step(objective);
            if self.chosen.is_empty() {
                self.bare = self.fit.clone();
            }
        }
    }

    /// The fit without any effect, with the current time step; `None` where that diverges.
    pub(super) fn bare_now(&self, objective: &mut Objective) -> Option<FitPoint> {
        let mut bare = FitPoint::at(objective, self.bare.active.clone(), self.bare.u.clone(), &[]).ok()?;
        bare.renew_step_error(objective);
        Some(bare)
    }

    /// Whether the error on the held-out logs is more than noise.
    pub(super) fn fails_on_held_out(&self, objective: &Objective) -> bool {
        self.held_out.is_some_and(|squares| chi(squares, objective.samples(LogSet::HeldOut)) > objective.noise_bound())
    }

    /// What the fit explains with another objective, such as one with starts from the fitted model: everything; or all
    /// but noise where the held-out logs now show more, or, once effects are found, any logs; or, once effects are
    /// found, most of what is left.
    pub(super) fn explains_with(&self, objective: &Objective) -> Explains {
        let again = FitPoint::at(objective, self.fit.active.clone(), self.fit.u.clone(), &self.fit.step_error);
        let Ok(mut fit) = again else { return Explains::Little };
        fit.solve(objective, FOLLOWER);
        let samples = objective.samples(LogSet::HeldOut).max(1);
        let judged = held_out_squares(objective, &fit.u).map_or(f64::INFINITY, |squares| chi(squares, samples));
        let learnt = |fit: &FitPoint| chi(fit.squares(), objective.samples(LogSet::Learn));
        let is_noise = |fit: &FitPoint| learnt(fit) <= objective.noise_bound();
        let is_more_now = self.fails_on_held_out(objective) || !self.chosen.is_empty() && !is_noise(&self.fit);
        let becomes_noise = is_more_now && is_noise(&fit);
        let excess = |fit: &FitPoint| (learnt(fit).powi(2) - 1.0).max(0.0);
        if (becomes_noise || !self.leaves_something(objective, &fit)) && judged <= objective.noise_bound() {
            Explains::Everything
        } else if !self.chosen.is_empty() && excess(&fit) < STARTS_LEAVE * excess(&self.fit) {
            Explains::Most
        } else {
            Explains::Little
        }
    }

    /// Whether there are held-out logs and they do not contradict what has changed.
    pub(super) fn is_no_worse_than(&self, before: &DiagnosisState) -> bool {
        self.held_out.zip(before.held_out).is_some_and(|(now, then)| now < (1.0 + HELD_OUT_FALL) * then)
    }

    /// Continues with another objective.
    pub(super) fn continue_with(&mut self, objective: &mut Objective, step: &str, on_step: &dyn Fn(&LadderStep)) {
        for fit in [&mut self.bare, &mut self.fit] {
            // A point that cannot be simulated from the new starts stays as it was.
            if let Ok(again) = FitPoint::at(objective, fit.active.clone(), fit.u.clone(), &[]) {
                *fit = again;
            }
        }
        self.integrator = self.fit.renew_step_error(objective);
        self.fit.solve(objective, SearchBudget::FULL);
        self.record(objective, step.to_owned(), on_step);
    }

    /// Whether any effect could be accepted on top of a fit: below the noise and the integrator's error there is
    /// nothing to gain.
    pub(super) fn leaves_something(&self, objective: &Objective, fit: &FitPoint) -> bool {
        let squares = fit.squares() / objective.samples(LogSet::Learn).max(1) as f64;
        // Where motion is chaotic, the noise floors include the integrator's error and are only roughly known.
        if objective.description.is_chaotic {
            return squares > objective.noise_bound().powi(2);
        }
        squares > 1.0 + LEARNT_FALL / 2.0 + self.integrator.powi(2)
    }

    /// Whether the latest finding has at least halved the error.
    pub(super) fn is_falling(&self) -> bool {
        let latest = self.ladder.iter().rposition(|step| step.step.starts_with('+')).filter(|k| *k > 0);
        let before = latest.map(|k| self.ladder[k - 1].train);
        before.zip(self.ladder.last()).is_some_and(|(before, now)| now.train <= 0.5 * before)
    }

    /// Records the current error as a step of the ladder.
    pub(super) fn record(&mut self, objective: &Objective, step: String, on_step: &dyn Fn(&LadderStep)) {
        self.judge(objective);
        let step = self.step(objective, step);
        on_step(&step);
        self.ladder.push(step);
    }

    /// Measures the error of the current fit on the held-out logs, if there are any.
    fn judge(&mut self, objective: &Objective) {
        let judged = objective.samples(LogSet::HeldOut) > 0;
        self.held_out = if judged { held_out_squares(objective, &self.fit.u) } else { None };
    }

    /// Updates the last step of the ladder, which may not have been judged, to the errors of the current fit.
    pub(super) fn judge_last_step(&mut self, objective: &Objective) {
        self.judge(objective);
        if let Some(step) = self.ladder.pop().map(|step| step.step) {
            self.ladder.push(self.step(objective, step));
        }
    }

    /// Moves the estimates to the middle of what the logs leave open, and corrects them for the noise of the motion.
    pub(super) fn settle(&mut self, objective: &Objective) {
        self.fit.settle(objective);
        if let Some(fit) = self.fit.without_attenuation(objective) {
            self.fit = fit;
        }
        self.renew_last_step(objective);
    }

    /// Updates the last step of the ladder to the error of the current fit.
    pub(super) fn renew_last_step(&mut self, objective: &Objective) {
        self.held_out = self.held_out.and_then(|_| held_out_squares(objective, &self.fit.u));
        if let Some(step) = self.ladder.pop().map(|step| step.step) {
            self.ladder.push(self.step(objective, step));
        }
    }

    pub(super) fn step(&self, objective: &Objective, step: String) -> LadderStep {
        LadderStep {
            step,
            train: chi(self.fit.squares(), objective.samples(LogSet::Learn)),
            held_out: self.held_out.map(|squares| chi(squares, objective.samples(LogSet::HeldOut))),
            u: self.fit.u.clone(),
        }
    }
}

/// Whether the parameters that a law has beyond those of a law nested in it lower the error as much as any effect
/// must: a certain difference with next to no effect is more likely one between simulators than a law. `candidate` is
/// the nested law.
pub(super) fn earns_its_parameters(
    objective: &Objective,
    candidate: usize,
    larger: &FitPoint,
    inside: &FitPoint,
) -> bool {
    if own::error(objective, candidate, inside) > objective.noise_bound() {
        return true;
    }
    let falls = |from: f64, to: f64, by: f64| to < (1.0 - by) * from;
    let held_out = |fit: &FitPoint| own::held_out(objective, candidate, &fit.u);
    let on_held_out = || match (held_out(inside), held_out(larger)) {
        (Some(from), Some(to)) => falls(from, to, HELD_OUT_FALL),
        _ => true,
    };
    let learnt = |fit: &FitPoint| own::learnt(objective, candidate, fit);
    falls(learnt(inside), learnt(larger), LEARNT_FALL) && (objective.logs(LogSet::HeldOut).is_empty() || on_held_out())
}
