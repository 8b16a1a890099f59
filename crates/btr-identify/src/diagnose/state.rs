//! What a diagnosis has found so far, and how an effect joins it or leaves it.

use super::judge::earns_its_numbers;
use super::refit::{CLOSE, FOLLOWER, RESHAPED, Rival, race};
use super::screen::screen;
use super::thresholds::{DECISIVE, HELD_OUT_FALL, LEARNT_FALL, TIE};
use super::{MissingEffect, RankedCandidate, Rung, leaves_something};
use crate::fit::measure::{ComparisonMeasure, NOISE, chi, held_out_squares};
use crate::fit::{FitPoint, LogSet, Objective, SearchBudget};

/// How far numbers are moved to begin anew: amplitudes by this share, shapes by so much of their coordinate...
const SHAKEN: (f64, f64) = (0.15, 0.5);
/// ... and how often at most, while the cost falls below this share each time.
const SHAKES: usize = 3;
const LOWER: f64 = 0.99;

/// The base of a round and what was found so far.
pub(super) struct DiagnosisState {
    pub(super) fit: FitPoint,
    /// The fit without any effect.
    pub(super) bare: FitPoint,
    /// Squares on the held-out logs.
    pub(super) held_out: Option<f64>,
    pub(super) chosen: Vec<MissingEffect>,
    pub(super) ladder: Vec<Rung>,
    pub(super) rivals: Vec<(usize, Vec<f64>)>,
    pub(super) rounds: Vec<Vec<RankedCandidate>>,
    /// The integrator's error, in multiples of the noise floor.
    pub(super) integrator: f64,
}

impl DiagnosisState {
    /// Makes the winner the new base.
    pub(super) fn accept(&mut self, bench: &Objective, rival: Rival, found: MissingEffect, tell: &dyn Fn(&Rung)) {
        self.fit = rival.fit;
        self.integrator = self.fit.renew_step_error(bench);
        self.fit.jacobian = None;
        self.fit.solve(bench, SearchBudget::FULL);
        if leaves_something(bench, self, &self.fit) {
            self.fit.polish(bench);
            self.shake(bench, found.candidate);
        }
        let step = format!("+ {}@{}", found.effect, found.site);
        self.chosen.push(found);
        self.climb(bench, step, tell);
    }

    /// A joint that breaks loose or does not makes the error jump, and a search stops before a jump: begins anew on
    /// either side of where each of the latest effect's numbers ended, as long as that leads lower.
    fn shake(&mut self, bench: &Objective, candidate: usize) {
        for _ in 0..SHAKES {
            if bench.family.is_chaotic() || !leaves_something(bench, self, &self.fit) {
                return;
            }
            let own = &bench.family.candidates()[candidate];
            let sides = own.knobs().flat_map(|knob| [-1.0, 1.0].map(|side| (knob, side)));
            let begun = sides.filter_map(|(knob, side)| {
                let mut u = self.fit.u.clone();
                let away = if own.shapes.contains(&knob) { SHAKEN.1 } else { SHAKEN.0 * u[knob].abs() };
                u[knob] = bench.family.knobs()[knob].clamp(u[knob] + side * away);
                let mut fit = FitPoint::at(bench, self.fit.active.clone(), u, &self.fit.step_error)?;
                fit.solve(bench, RESHAPED);
                Some(fit)
            });
            let best = begun.min_by(|a, b| a.cost.total_cmp(&b.cost));
            let Some(mut best) = best.filter(|best| best.cost < LOWER * self.fit.cost) else { return };
            best.solve(bench, FOLLOWER);
            self.fit = best;
        }
    }

    /// Drops earlier effects that the latest one has made superfluous.
    pub(super) fn eliminate(&mut self, bench: &Objective) {
        let mut index = 0;
        while self.chosen.len() > 1 && index + 1 < self.chosen.len() {
            let without = self.without(bench, index);
            let measure = ComparisonMeasure::of(bench, &self.fit);
            let needless = without.filter(|fit| {
                let costs = measure.criterion(fit) - measure.criterion(&self.fit);
                costs <= DECISIVE || fit.squares() <= (1.0 + LEARNT_FALL) * self.fit.squares()
            });
            match needless {
                Some(fit) => {
                    self.fit = fit;
                    self.held_out = held_out_squares(bench, &self.fit.u);
                    let gone = self.chosen.remove(index);
                    self.ladder.push(self.rung(bench, format!("- {}@{}", gone.effect, gone.site)));
                }
                None => index += 1,
            }
        }
    }

    /// The best fit without one of the chosen.
    fn without(&self, bench: &Objective, index: usize) -> Option<FitPoint> {
        let removed = self.less(bench, &[index]).map(|mut fit| {
            fit.solve(bench, SearchBudget { jacobians: 2, steps: 12 });
            fit
        });
        // The latest one may have got used to this one: once more as if it had never been found.
        let without = removed.into_iter().chain(self.instead(bench, index)).min_by(|a, b| a.cost.total_cmp(&b.cost));
        without.map(|mut fit| {
            let near = (1.0 + LEARNT_FALL) * self.fit.squares()..CLOSE * self.fit.squares();
            if near.contains(&fit.squares()) {
                fit.polish(bench);
            }
            fit
        })
    }

    /// The point without some of the chosen; all else stays.
    fn less(&self, bench: &Objective, indices: &[usize]) -> Option<FitPoint> {
        let knobs =
            |&index: &usize| bench.family.candidates()[self.chosen[index].candidate].knobs().collect::<Vec<_>>();
        let gone: Vec<usize> = indices.iter().flat_map(knobs).collect();
        let mut u = self.fit.u.clone();
        gone.iter().for_each(|&knob| u[knob] = 0.0);
        let active = self.fit.active.iter().copied().filter(|knob| !gone.contains(knob)).collect();
        FitPoint::at(bench, active, u, &self.fit.step_error)
    }

    /// The latest of the chosen fitted in the place of an earlier one.
    fn instead(&self, bench: &Objective, index: usize) -> Option<FitPoint> {
        let latest = self.chosen.len() - 1;
        self.replaced(bench, &[index, latest], &[self.chosen[latest].candidate]).map(|rival| rival.fit)
    }

    /// The best of some candidates in the place of some of the chosen.
    fn replaced(&self, bench: &Objective, indices: &[usize], candidates: &[usize]) -> Option<Rival> {
        let mut bases = vec![self.less(bench, indices)?];
        let starts = screen(bench, &mut bases, candidates);
        race(bench, &bases, &starts, None).into_iter().next()
    }

    /// Names what was found first anew where one of its kin that makes do with fewer numbers explains as much, now that
    /// others are known, and the logs to judge on do not object: it may have needed more of them to make up for those.
    pub(super) fn simplify(&mut self, bench: &Objective) {
        let candidates = bench.family.candidates();
        for index in 0..self.chosen.len().saturating_sub(1) {
            let own = &candidates[self.chosen[index].candidate];
            let simpler = |kin: &usize| {
                candidates[*kin].knobs().count() < own.knobs().count()
                    && self.chosen.iter().all(|found| found.candidate != *kin)
            };
            let kin: Vec<usize> = own.kin.iter().copied().filter(simpler).collect();
            if kin.is_empty() {
                continue;
            }
            let Some(rival) = self.replaced(bench, &[index], &kin) else { continue };
            let measure = ComparisonMeasure::of(bench, &self.fit);
            let costs = measure.criterion(&rival.fit) - measure.criterion(&self.fit);
            let bears_out = |now: f64| {
                held_out_squares(bench, &rival.fit.u).is_some_and(|squares| squares <= (1.0 + HELD_OUT_FALL) * now)
            };
            let inside = own.contains.contains(&rival.candidate);
            let will_do = costs <= TIE || inside && !earns_its_numbers(bench, &self.fit, &rival.fit);
            if will_do && self.held_out.is_none_or(bears_out) {
                self.rename(bench, index, rival, costs);
            }
        }
    }

    fn rename(&mut self, bench: &Objective, index: usize, rival: Rival, costs: f64) {
        let (own, found) = (&bench.family.candidates()[rival.candidate], &mut self.chosen[index]);
        let before = format!("{}@{}", found.effect, found.site);
        found.alike.retain(|alike| *alike != own.name());
        found.alike.push(before.clone());
        found.delta_bic -= costs;
        (found.effect, found.site, found.candidate) = (own.effect.clone(), own.site.clone(), rival.candidate);
        self.fit = rival.fit;
        self.fit.jacobian = None;
        self.fit.solve(bench, SearchBudget::FULL);
        self.held_out = held_out_squares(bench, &self.fit.u).filter(|_| self.held_out.is_some());
        self.ladder.push(self.rung(bench, format!("{} for {before}", own.name())));
    }

    /// Takes another point without any further effect as the base, if it leads lower: what the base reaches by itself is no
    /// merit of an effect.
    pub(super) fn follow(&mut self, bench: &Objective, mut base: FitPoint) {
        base.solve(bench, FOLLOWER);
        if base.cost < self.fit.cost {
            self.fit = base;
            self.renew_rung(bench);
            if self.chosen.is_empty() {
                self.bare = self.fit.clone();
            }
        }
    }

    /// The fit without any effect, with the time step as it is now.
    pub(super) fn bare_now(&self, bench: &Objective) -> Option<FitPoint> {
        let mut bare = FitPoint::at(bench, self.bare.active.clone(), self.bare.u.clone(), &[])?;
        bare.renew_step_error(bench);
        Some(bare)
    }

    /// Whether the error on the logs to judge on is more than noise.
    pub(super) fn is_judged_badly(&self, bench: &Objective) -> bool {
        self.held_out.is_some_and(|squares| chi(squares, bench.samples(LogSet::HeldOut)) > NOISE)
    }

    /// Whether nothing is left to explain where a family is seen from here.
    pub(super) fn is_explained_by(&self, bench: &Objective) -> bool {
        let again = FitPoint::at(bench, self.fit.active.clone(), self.fit.u.clone(), &self.fit.step_error);
        let Some(mut fit) = again else { return false };
        fit.solve(bench, FOLLOWER);
        let samples = bench.samples(LogSet::HeldOut).max(1);
        let judged = held_out_squares(bench, &fit.u).map_or(0.0, |squares| chi(squares, samples));
        !leaves_something(bench, self, &fit) && judged <= NOISE
    }

    /// Goes on beside a family that is seen from here.
    pub(super) fn look_again(&mut self, bench: &Objective, tell: &dyn Fn(&Rung)) {
        for fit in [&mut self.bare, &mut self.fit] {
            if let Some(again) = FitPoint::at(bench, fit.active.clone(), fit.u.clone(), &[]) {
                *fit = again;
            }
        }
        self.integrator = self.fit.renew_step_error(bench);
        self.fit.solve(bench, SearchBudget::FULL);
        self.climb(bench, "starts as it sees them".to_owned(), tell);
    }

    /// Notes where the error is now.
    pub(super) fn climb(&mut self, bench: &Objective, step: String, tell: &dyn Fn(&Rung)) {
        let judged = !bench.logs(LogSet::HeldOut).is_empty();
        self.held_out = if judged { held_out_squares(bench, &self.fit.u) } else { None };
        let rung = self.rung(bench, step);
        tell(&rung);
        self.ladder.push(rung);
    }

    /// Moves the estimates to the middle of what the logs leave open.
    pub(super) fn settle(&mut self, bench: &Objective) {
        self.fit.settle(bench);
        self.renew_rung(bench);
    }

    /// The last rung says what the error is where the fit is now.
    fn renew_rung(&mut self, bench: &Objective) {
        self.held_out = self.held_out.and_then(|_| held_out_squares(bench, &self.fit.u));
        if let Some(step) = self.ladder.pop().map(|rung| rung.step) {
            self.ladder.push(self.rung(bench, step));
        }
    }

    fn rung(&self, bench: &Objective, step: String) -> Rung {
        Rung {
            step,
            train: chi(self.fit.squares(), bench.samples(LogSet::Learn)),
            held_out: self.held_out.map(|squares| chi(squares, bench.samples(LogSet::HeldOut))),
        }
    }
}
