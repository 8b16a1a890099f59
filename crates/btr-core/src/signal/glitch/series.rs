//! Runs of readings that depart from what the readings around them predict.

use super::prediction::{is_same, lagrange};
use crate::signal::stats::quantile;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Least departure of a glitch, in standard deviations of the noise, ...
pub(super) const SIGMAS: f64 = 10.0;
/// ... and beyond that, in largest errors of the neighbours' predictions of each other, less what noise makes of them.
const ERRORS: f64 = 5.0;
/// The largest of four errors by noise alone, in its standard deviations.
const NOISY: f64 = 2.0;
/// At a log's ends predictions are extrapolations: both limits grow by these factors.
const AT_ENDS: (f64, f64) = (4.0, 2.0);
/// A glitch of several samples begins and ends with a jump, which is longer than this many usual steps around it, or
/// repeats the reading before.
pub(super) const JUMP: f64 = 4.0;
/// Steps to each side that are the usual ones around a step.
pub(super) const AROUND: usize = 10;
/// Least departure beside a simulation of readings that are exactly zero, or repeated until the joint has caught up.
const PATTERN_SIGMAS: f64 = 7.0;
/// Least departure of exact zeros in a series that has none by chance.
const FOREIGN_ZERO_SIGMAS: f64 = 3.0;
/// Least step after a sensor was stuck, in steps that it lacks.
const CAUGHT_UP: f64 = 0.7;
/// Least step before a sensor was stuck, in the usual ones of what it missed: less is the onset of a motion.
const MOVED: f64 = 0.2;
/// Speeds before and after a reading that a motion goes on with, in speeds across it.
const AS_FAST: (f64, f64) = (0.6, 1.5);
/// Relative tolerance of a full turn.
const TURN: f64 = 0.02;
/// Readings to each side of a run by which it is judged.
const SIDE: usize = 3;

/// What a glitch looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GlitchKind {
    /// Readings that are off by full turns (2π rad).
    WrapAround,
    /// Readings of exactly zero.
    Zero,
    /// The reading before, repeated while the joint moves: a stuck sensor, or a message that was lost.
    Stuck,
    /// Any other value.
    Spike,
}

/// Readings without gaps between them.
pub(super) struct Series {
    pub(super) t: Vec<f64>,
    pub(super) x: Vec<f64>,
    /// What the sensor read: zeros and repeated readings show there, also beside a simulation.
    pub(super) readings: Vec<f64>,
    pub(super) sigma: f64,
    /// The clock's usual step.
    pub(super) step_s: f64,
    /// Most samples of a glitch.
    pub(super) longest: usize,
    /// Whether `x` is the difference between the readings and a simulation of them.
    pub(super) is_beside: bool,
    /// Where the readings are torques, what is known of these.
    pub(super) torque: Option<Torque>,
}

/// What is known of torques. They may jump, and back after a few samples, as where friction changes its sign twice.
#[derive(Clone, Copy)]
pub(super) struct Torque {
    /// Whether they are too fine to be exactly zero, or the same twice, by chance.
    pub(super) is_fine: bool,
    /// Range of nine in ten readings.
    pub(super) range: f64,
}

/// A run of samples that departs from what its neighbours predict.
pub(super) struct Departure {
    pub(super) samples: Range<usize>,
    pub(super) worst: usize,
    pub(super) expected: f64,
}

impl Series {
    /// All glitches from the first to the last.
    pub(super) fn runs(&self) -> Vec<Departure> {
        let n = self.x.len();
        let (jumps, mut found, mut good) = (self.jumps(), Vec::new(), Vec::with_capacity(n));
        let mut i = 0;
        while i < n {
            let departs = |run: Range<usize>| {
                let mut after = self.after(&run, &jumps).into_iter();
                after.find_map(|after| self.departure(run.clone(), &good, &after))
            };
            let run = self.candidates(i, &jumps).into_iter().find_map(departs);
            match run {
                Some(run) => {
                    i = run.samples.end;
                    found.push(run);
                }
                None => {
                    good.push(i);
                    i += 1;
                }
            }
        }
        found
    }

    /// For each sample, whether the step to it is far longer than usual around it.
    fn jumps(&self) -> Vec<bool> {
        let steps: Vec<f64> = self.x.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
        let is_jump = |k: usize| {
            let around = &steps[k.saturating_sub(AROUND)..(k + AROUND + 1).min(steps.len())];
            // Most steps end at the noise.
            let is_long = steps[k] > SIGMAS * self.sigma;
            is_long && quantile(around.to_vec(), 0.5).is_some_and(|usual| steps[k] > JUMP * usual)
        };
        let mut jumps = vec![false];
        jumps.extend((0..steps.len()).map(is_jump));
        jumps
    }

    /// Runs that may be a glitch and begin at sample `i`, the shortest first.
    fn candidates(&self, i: usize, jumps: &[bool]) -> Vec<Range<usize>> {
        let end = (i + self.longest + 1).min(self.x.len());
        let equal = |to: f64| self.readings[i..end].iter().take_while(|x| is_same(**x, to)).count();
        let repeated = i.checked_sub(1).map(|last| equal(self.readings[last]));
        let repeats = repeated.into_iter().chain([equal(0.0)]).filter(|count| *count > 1).map(|count| i..i + count);
        let returns = (i + 2..end).filter(|&k| jumps[i] && jumps[k]).map(|k| i..k);
        std::iter::once(i..i + 1).chain(repeats).chain(returns).chain(self.last(i, jumps)).collect()
    }

    /// Readings after a run by which it may be judged: the next ones; and where another run may follow within them,
    /// from a jump to the jump back, those around it.
    fn after(&self, run: &Range<usize>, jumps: &[bool]) -> Vec<Vec<usize>> {
        let n = self.x.len();
        let jump = |k: &usize| *k < n && jumps[*k];
        let begins = (run.end + 1..run.end + SIDE).filter(jump).filter(|_| jump(&run.start));
        let others = begins.flat_map(|k| (k + 1..=k + self.longest).filter(jump).map(move |end| k..end));
        let without = |other: Range<usize>| (run.end..n).filter(|i| !other.contains(i)).take(SIDE).collect();
        std::iter::once(0..0).chain(others).map(without).collect()
    }

    /// A run up to the last sample that begins with a jump.
    fn last(&self, i: usize, jumps: &[bool]) -> Option<Range<usize>> {
        let n = self.x.len();
        (jumps[i] && n - i > 1 && n - i <= self.longest).then_some(i..n)
    }

    /// The run as a departure, if it is a glitch. `good` are the samples before it that are none, `after` those after
    /// it that judge it.
    fn departure(&self, run: Range<usize>, good: &[usize], after: &[usize]) -> Option<Departure> {
        let before = good[good.len().saturating_sub(SIDE)..].to_vec();
        if before.len() < SIDE || after.len() < SIDE {
            // A torque jumps where a motor is switched on.
            return if self.torque.is_some() { None } else { self.at_an_end(run, &before) };
        }
        let inner = [before[1], before[2], after[0], after[1]];
        let sigmas = self.sigmas(&run);
        // Most runs end here.
        let least = self.least(&run, &inner);
        if least <= sigmas * self.sigma || self.may_be_motion(&run, &before, after) || self.may_jump(&run, least) {
            return None;
        }
        let all: Vec<usize> = before.iter().chain(after).copied().collect();
        let errors = (1..=4).map(|k| {
            // By the four nearest of the other five.
            let far = if k < SIDE { 5 } else { 0 };
            let others: Vec<usize> = (0..6).filter(|&other| other != k && other != far).map(|o| all[o]).collect();
            (self.x[all[k]] - self.predicted(all[k], &others)).abs()
        });
        let error = errors.fold(0.0, f64::max);
        // Friction may hold a joint for a few samples, and a motion may come and go between two.
        let sure = run.len() == 1 || self.is_zero(&run) || self.catches_up(&run);
        let noisy = if sure { NOISY } else { -SIGMAS / ERRORS };
        let rough = (error - noisy * self.sigma).max(0.0);
        let most = sigmas * self.sigma + ERRORS * rough + self.mistimed(&before, after);
        (least > most).then(|| self.depart(run, &inner))
    }

    /// Least departure of a run that is a glitch, in standard deviations of the noise.
    fn sigmas(&self, run: &Range<usize>) -> f64 {
        match () {
            () if self.torque.is_some_and(|torque| torque.is_fine) && self.is_zero(run) => FOREIGN_ZERO_SIGMAS,
            () if self.is_beside && (self.is_zero(run) || self.catches_up(run)) => PATTERN_SIGMAS,
            () => SIGMAS,
        }
    }

    /// How far the joint moves in the time by which the clock's steps around a run differ from the usual one.
    fn mistimed(&self, before: &[usize], after: &[usize]) -> f64 {
        let (first, last, end) = (before[0], before[SIDE - 1], after[SIDE - 1]);
        let irregular = (first..end).map(|i| (self.t[i + 1] - self.t[i] - self.step_s).abs()).fold(0.0, f64::max);
        irregular * ((self.x[after[0]] - self.x[last]) / (self.t[after[0]] - self.t[last])).abs()
    }

    /// The same for a run at the very beginning or the very end, from the readings on one side.
    fn at_an_end(&self, run: Range<usize>, before: &[usize]) -> Option<Departure> {
        let n = self.x.len();
        let side: Vec<usize> = match () {
            () if run.start == 0 => (run.end..n).take(SIDE + 1).collect(),
            () if run.end == n && before.len() == SIDE => {
                let first = before[0].checked_sub(1)?;
                before.iter().rev().copied().chain([first]).collect()
            }
            () => return None,
        };
        if side.len() <= SIDE {
            return None;
        }
        let nodes = &side[..SIDE];
        let error = (self.x[side[0]] - self.predicted(side[0], &side[1..])).abs();
        let most = AT_ENDS.0 * SIGMAS * self.sigma + AT_ENDS.1 * ERRORS * error;
        let far =
            (self.apart(run.start, nodes).min(self.apart(run.end - 1, nodes)) > most).then(|| self.depart(run, nodes));
        far.filter(|run| self.is_no_motion(run))
    }

    /// Whether a run at an end cannot be a joint that begins to move or has come to rest.
    fn is_no_motion(&self, run: &Departure) -> bool {
        match self.kind(run) {
            GlitchKind::WrapAround | GlitchKind::Zero => true,
            GlitchKind::Spike => run.samples.len() == 1,
            GlitchKind::Stuck => false,
        }
    }

    /// The departure of a run's first or last sample from the prediction by these nodes, whichever is smaller. A sensor
    /// that gets stuck is right at first.
    fn least(&self, run: &Range<usize>, nodes: &[usize]) -> f64 {
        let (first, last) = (self.apart(run.start, nodes), self.apart(run.end - 1, nodes));
        if self.is_stuck(run) { last } else { first.min(last) }
    }

    /// Whether a run repeats the reading before it while the joint moves. Beside a simulation, a joint that rests is no
    /// glitch if the model moves.
    fn is_stuck(&self, run: &Range<usize>) -> bool {
        if self.is_beside { self.catches_up(run) } else { self.repeats(run) }
    }

    /// Whether a run holds nothing but the reading before it.
    fn repeats(&self, run: &Range<usize>) -> bool {
        run.start > 0 && self.readings[run.clone()].iter().all(|x| is_same(*x, self.readings[run.start - 1]))
    }

    /// Whether a run, and nothing next to it, reads exactly zero.
    fn is_zero(&self, run: &Range<usize>) -> bool {
        let is_zero = |i: usize| self.readings.get(i).is_some_and(|x| is_same(*x, 0.0));
        run.clone().all(is_zero) && !is_zero(run.end) && !run.start.checked_sub(1).is_some_and(is_zero)
    }

    /// Whether a run may be the onset of a motion, or a fast one: all its readings are between those around it. Zeros
    /// are not, nor are readings of a sensor that gets stuck in a motion, nor a single one in a motion that goes on.
    fn may_be_motion(&self, run: &Range<usize>, before: &[usize], after: &[usize]) -> bool {
        let (a, b) = (self.readings[before[SIDE - 1]], self.readings[after[0]]);
        let is_between = self.readings[run.clone()].iter().all(|x| (a.min(b)..=a.max(b)).contains(x));
        let is_on_the_way = run.len() == 1 && self.goes_on(before, after);
        is_between && !self.is_zero(run) && !self.gets_stuck(run) && !is_on_the_way
    }

    /// Whether the readings move as fast before a run and after it as across it.
    fn goes_on(&self, before: &[usize], after: &[usize]) -> bool {
        let speed = |a: usize, b: usize| (self.readings[b] - self.readings[a]) / (self.t[b] - self.t[a]);
        let across = speed(before[SIDE - 1], after[0]);
        let around = [speed(before[SIDE - 2], before[SIDE - 1]), speed(after[0], after[1])];
        around.iter().all(|speed| (AS_FAST.0..AS_FAST.1).contains(&(speed / across)))
    }

    /// Whether a run that departs by this much may be a torque that jumps.
    fn may_jump(&self, run: &Range<usize>, departure: f64) -> bool {
        self.torque.is_some_and(|torque| {
            let is_pattern = torque.is_fine && (self.is_zero(run) || self.repeats(run));
            run.len() > 1 && !is_pattern && departure <= torque.range
        })
    }

    /// Whether a run repeats the reading before it, and the joint moves.
    fn gets_stuck(&self, run: &Range<usize>) -> bool {
        if self.is_beside {
            return self.catches_up(run);
        }
        let step = |end: usize| Some((self.readings.get(end)? - self.readings[end.checked_sub(1)?]).abs());
        let moved = |before: f64, missed: f64| before > MOVED * missed / (run.len() + 1) as f64;
        self.repeats(run)
            && step(run.start - 1).zip(step(run.end)).is_some_and(|(before, missed)| moved(before, missed))
    }

    /// Whether a run repeats the reading before it, and the step after it makes up for all steps that it lacks. A joint
    /// that friction has held goes on from where it is. Beside a simulation, its motion tells what the run lacks.
    fn catches_up(&self, run: &Range<usize>) -> bool {
        if run.start < 2 || run.end + 1 >= self.readings.len() || !self.repeats(run) {
            return false;
        }
        let (before, last, after) = (run.start - 1, run.end - 1, run.end);
        let step = |i: usize| self.readings[i + 1] - self.readings[i];
        if self.is_beside {
            let left = self.x[after] - self.x[before];
            let departs = (self.x[last] - self.x[before]).abs() > PATTERN_SIGMAS * self.sigma;
            return departs && left.abs() < (1.0 - CAUGHT_UP) * (step(last) - left).abs();
        }
        let usual = 0.5 * (step(before - 1) + step(after));
        step(last) / usual > CAUGHT_UP * (run.len() + 1) as f64
    }

    fn apart(&self, i: usize, nodes: &[usize]) -> f64 {
        (self.x[i] - self.predicted(i, nodes)).abs()
    }

    fn depart(&self, samples: Range<usize>, nodes: &[usize]) -> Departure {
        let apart = |i: &usize| self.apart(*i, nodes);
        let farthest = samples.clone().max_by(|a, b| apart(a).total_cmp(&apart(b)));
        let worst = farthest.unwrap_or(samples.start);
        Departure { samples, worst, expected: self.predicted(worst, nodes) }
    }

    /// What the readings of `nodes` predict for sample `i`.
    fn predicted(&self, i: usize, nodes: &[usize]) -> f64 {
        let points: Vec<(f64, f64)> = nodes.iter().map(|&node| (self.t[node], self.x[node])).collect();
        lagrange(self.t[i], &points)
    }

    pub(super) fn kind(&self, run: &Departure) -> GlitchKind {
        let turns = (self.x[run.worst] - run.expected) / std::f64::consts::TAU;
        match () {
            () if self.torque.is_none() && turns.abs() > 0.5 && (turns - turns.round()).abs() < TURN => {
                GlitchKind::WrapAround
            }
            () if self.is_zero(&run.samples) => GlitchKind::Zero,
            () if self.repeats(&run.samples) => GlitchKind::Stuck,
            () => GlitchKind::Spike,
        }
    }
}
