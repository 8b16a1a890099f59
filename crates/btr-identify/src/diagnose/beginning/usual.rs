//! What nearly every joint has, taken for granted: dry and viscous friction and a rotor. Where the motion is
//! prescribed, they are fitted at all joints at once, for what little it costs, and what else is missing is looked for
//! beside them. Each has to pass the tests of a finding at the end: what the logs do not need, or the held-out logs do
//! not confirm, is dropped.

use crate::LadderStep;
use crate::diagnose::evidence::LogErrors;
use crate::diagnose::own;
use crate::diagnose::refit::{FOLLOWER, Rival};
use crate::diagnose::report::{DiagnoseOptions, MissingEffect};
use crate::diagnose::state::DiagnosisState;
use crate::diagnose::thresholds::{DECISIVE, HELD_OUT_FALL, LEARNT_FALL};
use crate::fit::measure::{ComparisonMeasure, held_out_squares};
use crate::fit::{FitPoint, Objective, SearchBudget};

/// Where the sum of squares at a joint is less than so many times as large without a law, what the links have may take
/// its place: a load near a joint's axis is a rotor as well.
const CLOSE: f64 = 2.0;

/// What something that was taken for granted has to pass.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum GrantedTest {
    /// The training logs show it for certain.
    Shown,
    /// All tests of a finding: something else may still be missing that hid it before.
    Finding,
}

/// The state with the usual laws at all joints, those that are new as findings that are taken for granted; `None` where
/// the motion is not prescribed, nothing is left to explain, or fewer effects may be named.
pub(crate) fn take_for_granted(
    objective: &mut Objective,
    question: DiagnoseOptions,
    state: &DiagnosisState,
) -> Option<DiagnosisState> {
    let candidates = objective.candidates();
    let is_usual = |&c: &usize| candidates[c].is_usual && own::is_apart(objective, c);
    let usual: Vec<usize> = state.offered(objective).into_iter().filter(is_usual).collect();
    // There has to be room for what shows beside them.
    let is_asked = !usual.is_empty() && state.effects(objective) + usual.len() < question.max_effects;
    if !is_asked || !state.leaves_something(objective, &state.fit) {
        return None;
    }
    let granted = |&c: &usize| {
        let size = |candidate: usize| candidates[candidate].parameters().count();
        // Rounds look for laws that contain it or have many more parameters.
        let is_larger = |other: &usize| candidates[*other].nested.contains(&c) || size(*other) > size(c) + 1;
        let close = candidates[c].similar.iter().copied().filter(|other| !is_larger(other)).collect();
        MissingEffect { close, is_granted: true, ..MissingEffect::of(c, &candidates[c], 1.0, 0.0) }
    };
    let chosen = state.chosen.iter().cloned().chain(usual.iter().map(granted)).collect();
    let added = usual.iter().flat_map(|&c| candidates[c].parameters());
    let active = state.fit.active.iter().copied().chain(added).collect();
    let mut fit = FitPoint::at(objective, active, state.fit.u.clone(), &state.fit.step_error).ok()?;
    for of_joint in first_of_each_joint(objective, &usual) {
        own::solve(objective, of_joint, &mut fit, SearchBudget::FULL);
    }
    let integrator = fit.renew_step_error(objective);
    fit.solve(objective, SearchBudget::FULL);
    let held_out = state.held_out.and_then(|_| held_out_squares(objective, &fit.u));
    let before = LogErrors::in_all(objective, &state.fit, state.held_out).mean;
    let unexplained_at_first = state.unexplained_at_first.max(before);
    Some(DiagnosisState { fit, held_out, chosen, integrator, unexplained_at_first, ..state.clone() })
}

/// One of some candidates for each joint.
fn first_of_each_joint(objective: &Objective, candidates: &[usize]) -> Vec<usize> {
    let joints = own::joints(objective, candidates.iter().copied());
    let first = |joint: &&[String]| candidates.iter().copied().find(|&c| own::shows_in(objective, c, joint));
    joints.iter().filter_map(first).collect()
}

impl DiagnosisState {
    /// Drops those of what was taken for granted, from the finding `first` on, that do not pass a test beside all
    /// others, the weakest of each joint first, and weighs the rest.
    pub(crate) fn keep_granted(&mut self, objective: &Objective, test: GrantedTest, first: usize) {
        let granted = |state: &Self| -> Vec<usize> {
            state.chosen[first..].iter().filter(|found| found.is_granted).map(|found| found.candidate).collect()
        };
        for at_joint in first_of_each_joint(objective, &granted(self)) {
            while let Some((index, without)) = self.weakest(objective, at_joint, (test, first)) {
                self.drop_with(objective, index, without);
            }
        }
        for candidate in granted(self) {
            self.weigh_beside_others(objective, candidate);
            // One that cannot be told from others has shared it with them.
            let found = self.chosen.iter_mut().find(|found| found.candidate == candidate && found.alike.is_empty());
            found.into_iter().for_each(|found| found.probability = 1.0 / (1.0 + (-found.delta_bic / 2.0).exp()));
        }
    }

    /// What gains least of that which was taken for granted at a joint and does not pass, with the fit without it.
    fn weakest(
        &self,
        objective: &Objective,
        at_joint: usize,
        (test, first): (GrantedTest, usize),
    ) -> Option<(usize, FitPoint)> {
        let measure = ComparisonMeasure::of(objective, &self.fit);
        let is_asked = |&index: &usize| {
            let found = &self.chosen[index];
            let at_joint = own::are_together(objective, found.candidate, at_joint);
            found.is_granted && at_joint && !self.has_companions(objective, index)
        };
        let without = |index: usize| {
            let mut fit = self.less(objective, &[index])?;
            let candidate = self.chosen[index].candidate;
            own::solve(objective, candidate, &mut fit, FOLLOWER);
            let is_close =
                own::learnt(objective, candidate, &fit) < CLOSE * own::learnt(objective, candidate, &self.fit);
            if test == GrantedTest::Finding && is_close {
                fit.solve(objective, FOLLOWER);
            }
            let gains = measure.behind(&fit, &self.fit);
            Some((index, gains, fit))
        };
        let all = (first..self.chosen.len()).filter(is_asked).filter_map(without);
        let fails = |(index, gains, fit): &(usize, f64, FitPoint)| {
            *gains <= DECISIVE || test == GrantedTest::Finding && !self.needs(objective, *index, fit)
        };
        let weakest = all.filter(fails).min_by(|(_, a, _), (_, b, _)| a.total_cmp(b));
        weakest.map(|(index, _, fit)| (index, fit))
    }

    /// Whether the training and the held-out logs are explained worse without a finding.
    fn needs(&self, objective: &Objective, index: usize, without: &FitPoint) -> bool {
        let candidate = self.chosen[index].candidate;
        let learnt = |fit: &FitPoint| own::learnt(objective, candidate, fit);
        let rises = |now: f64| {
            own::held_out(objective, candidate, &without.u).is_none_or(|then| now < (1.0 - HELD_OUT_FALL) * then)
        };
        learnt(&self.fit) < (1.0 - LEARNT_FALL) * learnt(without)
            && self.own_held_out(objective, candidate).is_none_or(rises)
    }

    /// The state with the ladder that leads here from an earlier one, told step by step: first what shows in all
    /// channels, then what gains most. Where nothing was found since, the earlier one.
    pub(crate) fn told_after(
        mut self,
        objective: &Objective,
        earlier: DiagnosisState,
        on_step: &dyn Fn(&LadderStep),
    ) -> Self {
        let (mut all, mut new): (Vec<MissingEffect>, Vec<MissingEffect>) =
            std::mem::take(&mut self.chosen).into_iter().partition(|found| earlier.is_chosen(found.candidate));
        if new.is_empty() {
            return earlier;
        }
        let apart = |found: &MissingEffect| own::is_apart(objective, found.candidate);
        new.sort_by(|a, b| apart(a).cmp(&apart(b)).then(b.delta_bic.total_cmp(&a.delta_bic)));
        let mut told = earlier;
        for (k, found) in new.iter().enumerate() {
            let rival = Rival { candidate: found.candidate, fit: self.fit.clone() };
            let is_last = k + 1 == new.len();
            let Some(mut added) = (if is_last { Some(rival) } else { told.with_rival(objective, &rival) }) else {
                continue;
            };
            if !is_last {
                own::solve(objective, found.candidate, &mut added.fit, FOLLOWER);
            }
            told.fit = added.fit;
            told.record(objective, objective.candidates()[found.candidate].step(), on_step);
        }
        // Beside what is new, other things may show at its joints.
        new.iter().for_each(|found| told.ask_again_at(objective, found.candidate));
        all.extend(new);
        let DiagnosisState { ladder, held_out, settled, .. } = told;
        let (unconfirmed, left_over, rivals) = (None, None, Vec::new());
        DiagnosisState { chosen: all, ladder, held_out, settled, unconfirmed, left_over, rivals, ..self }
    }
}
