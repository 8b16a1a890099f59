//! A law that contains two simpler ones, and these in its place: friction with four constants where Coulomb's and
//! viscous friction will do, and where they will not.

use crate::LadderStep;
use crate::diagnose::evidence::LogErrors;
use crate::diagnose::own;
use crate::diagnose::refit::Rival;
use crate::diagnose::report::{Evidence, MissingEffect};
use crate::diagnose::screen::with;
use crate::diagnose::state::{DiagnosisState, earns_its_parameters};
use crate::diagnose::thresholds::{DECISIVE, LEARNT_FALL, TIE};
use crate::fit::measure::ComparisonMeasure;
use crate::fit::{FitPoint, LogSet, Objective, SearchBudget};

/// Size of each part at the start of its fit, in typical sizes.
const START: f64 = 0.5;

/// Two candidates with their fit in the place of a finding.
struct Parts {
    candidates: [usize; 2],
    fit: FitPoint,
}

impl DiagnosisState {
    /// Replaces those findings that are asked about by two laws that they contain, of fewer parameters together, where
    /// these explain as much.
    pub(in crate::diagnose) fn split(
        &mut self,
        objective: &Objective,
        is_asked: impl Fn(&Self, usize) -> bool,
        on_step: &dyn Fn(&LadderStep),
    ) {
        let mut index = 0;
        while index < self.chosen.len() {
            let parts = if is_asked(self, index) { self.parts(objective, index) } else { None };
            match parts.filter(|parts| self.will_do(objective, parts)) {
                // The next finding takes its place.
                Some(parts) => self.accept_parts(objective, index, parts.candidates, parts.fit, on_step),
                None => index += 1,
            }
        }
    }

    /// The best two laws inside a finding.
    fn parts(&self, objective: &Objective, index: usize) -> Option<Parts> {
        let candidates = objective.candidates();
        let whole = &candidates[self.chosen[index].candidate];
        let inside: Vec<usize> = whole.nested.iter().copied().filter(|&part| !self.is_chosen(part)).collect();
        let pairs = inside.iter().enumerate().flat_map(|(k, &a)| inside[k + 1..].iter().map(move |&b| [a, b]));
        let size = |pair: &[usize; 2]| pair.iter().map(|&part| candidates[part].parameters().count()).sum::<usize>();
        let smaller = pairs.filter(|pair| size(pair) < whole.parameters().count());
        let base = self.less(objective, &[index])?;
        let fitted = smaller.filter_map(|pair| Some(Parts { candidates: pair, fit: fitted(objective, &base, pair)? }));
        fitted.min_by(|a, b| a.fit.cost.total_cmp(&b.fit.cost))
    }

    /// Whether two parts explain as much as the law that contains them: what its further parameters lower the error by
    /// is no more than what any effect must.
    fn will_do(&self, objective: &Objective, parts: &Parts) -> bool {
        let measure = ComparisonMeasure::of(objective, &self.fit);
        let candidate = parts.candidates[0];
        let ties = measure.behind(&parts.fit, &self.fit) <= TIE;
        let learnt = |fit: &FitPoint| own::learnt(objective, candidate, fit);
        let hardly = learnt(&self.fit) >= (1.0 - LEARNT_FALL) * learnt(&parts.fit);
        (ties || hardly) && self.is_borne_out(objective, candidate, &parts.fit)
    }

    /// Replaces laws that were taken for granted by one that contains several of them, where that explains clearly more
    /// even of an error that counts as noise: what runs differ by may hide what they have in common.
    pub(in crate::diagnose) fn join(&mut self, objective: &Objective, on_step: &dyn Fn(&LadderStep)) {
        let candidates = objective.candidates();
        for (whole, candidate) in candidates.iter().enumerate() {
            let is_part = |index: &usize| {
                let found = &self.chosen[*index];
                found.is_granted && candidate.nested.contains(&found.candidate)
            };
            let parts: Vec<usize> = (0..self.chosen.len()).filter(is_part).collect();
            if parts.len() < 2 || self.is_chosen(whole) {
                continue;
            }
            let Some(rival) = self.replaced(objective, &parts, &[whole]) else { continue };
            let measure = ComparisonMeasure::of(objective, &rival.fit);
            let gained = measure.behind(&self.fit, &rival.fit);
            if gained > DECISIVE && earns_its_parameters(objective, whole, &rival.fit, &self.fit) {
                self.accept_whole(objective, &parts, (rival, gained), on_step);
            }
        }
    }

    /// Puts a law in the place of its parts.
    fn accept_whole(
        &mut self,
        objective: &Objective,
        parts: &[usize],
        (rival, gained): (Rival, f64),
        on_step: &dyn Fn(&LadderStep),
    ) {
        let whole = &objective.candidates()[rival.candidate];
        let name = |&index: &usize| format!("{}@{}", self.chosen[index].effect, self.chosen[index].site);
        let step = format!("{} for {}", whole.name(), parts.iter().map(name).collect::<Vec<_>>().join(" + "));
        parts.iter().rev().for_each(|&index| drop(self.chosen.remove(index)));
        self.fit = rival.fit;
        self.chosen.push(MissingEffect::of(rival.candidate, whole, 1.0 / (1.0 + (-gained / 2.0).exp()), gained));
        self.record(objective, step, on_step);
        self.weigh_beside_others(objective, rival.candidate);
    }

    /// Puts two candidates, with their fit, in the place of a finding.
    pub(in crate::diagnose) fn accept_parts(
        &mut self,
        objective: &Objective,
        index: usize,
        parts: [usize; 2],
        fit: FitPoint,
        on_step: &dyn Fn(&LadderStep),
    ) {
        let candidates = objective.candidates();
        let [first, second] = parts;
        let whole = self.chosen.remove(index);
        let step =
            format!("{} + {} for {}@{}", candidates[first].name(), candidates[second].name(), whole.effect, whole.site);
        self.fit = fit;
        self.record(objective, step, on_step);
        for part in parts {
            self.chosen.push(MissingEffect::of(part, &candidates[part], whole.probability, whole.delta_bic));
        }
        for part in parts {
            self.weigh_beside_others(objective, part);
        }
    }

    /// What speaks for a finding beside all others: the error without it.
    pub(in crate::diagnose) fn weigh_beside_others(&mut self, objective: &Objective, part: usize) {
        let Some(index) = self.chosen.iter().position(|found| found.candidate == part) else { return };
        let Some(mut without) = self.less(objective, &[index]) else { return };
        own::solve(objective, part, &mut without, SearchBudget { jacobians: 2, steps: 12 });
        let judged = !objective.logs(LogSet::HeldOut).is_empty();
        let held_out = |fit: &FitPoint| if judged { own::held_out(objective, part, &fit.u) } else { None };
        let before = LogErrors::of(objective, part, &without, held_out(&without));
        let after = LogErrors::of(objective, part, &self.fit, self.held_out);
        let at_first = self.own_at_first(objective, part).unwrap_or(self.unexplained_at_first);
        let measure = ComparisonMeasure::of(objective, &self.fit);
        let gained = measure.behind(&without, &self.fit);
        let found = &mut self.chosen[index];
        found.evidence = Evidence::of(&before, &after, at_first);
        found.delta_bic = gained;
    }
}

/// Two candidates fitted beside a base.
fn fitted(objective: &Objective, base: &FitPoint, pair: [usize; 2]) -> Option<FitPoint> {
    let mut base = base.clone();
    let mut u = base.u.clone();
    for candidate in pair.map(|part| &objective.candidates()[part]) {
        base.active = with(&base, candidate);
        candidate.amplitudes.iter().for_each(|&k| u[k] = objective.parameters()[k].clamp(START));
        candidate.shapes.iter().zip(&candidate.starts[0]).for_each(|(&k, &shape)| u[k] = shape);
    }
    let mut fit = FitPoint::at(objective, base.active, u, &base.step_error).ok()?;
    own::solve(objective, pair[0], &mut fit, SearchBudget::FULL);
    Some(fit)
}
