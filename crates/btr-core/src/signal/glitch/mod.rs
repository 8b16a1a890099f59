//! Glitches in a position's readings: samples that no motion explains, because a sensor or its bus failed.
//!
//! A joint moves smoothly: cubics through the readings around a few samples predict these to within the noise and the
//! error with which they predict each other. A run of samples is a glitch if it departs from that prediction, at its
//! first sample and at its last, by many times either. An impact bends a motion in one sample; that changes the
//! predictions of the neighbours about as much (by a third of the departure), so it is none. Where the clock's steps
//! are irregular, a reading may have been taken earlier or later than its stamp says, by as much as the steps differ.

mod prediction;
mod rows;

pub use rows::repeated_rows;

use prediction::{deviation, is_same, lagrange, median_step_s, quantile, resolution};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Least departure of a glitch, in standard deviations of the noise, ...
const SIGMAS: f64 = 10.0;
/// ... and beyond that, in largest errors of the neighbours' predictions of each other, less what noise makes of them.
const ERRORS: f64 = 5.0;
/// The largest of four errors by noise alone, in its standard deviations.
const NOISY: f64 = 2.0;
/// At a log's ends predictions are extrapolations: both limits grow by these factors.
const AT_ENDS: (f64, f64) = (4.0, 2.0);
/// A glitch of several samples begins and ends with a jump, which is longer than this many usual steps around it, or
/// repeats the reading before.
const JUMP: f64 = 4.0;
/// Steps to each side that are the usual ones around a step.
const AROUND: usize = 10;
/// Least step after a sensor was stuck, in steps that it lacks.
const CAUGHT_UP: f64 = 0.7;
/// Relative tolerance of a full turn.
const TURN: f64 = 0.02;
/// Readings to each side of a run by which it is judged.
const SIDE: usize = 3;
/// Readings further apart than this many usual steps do not predict each other.
const APART: f64 = 3.5;

/// Most samples of a glitch on a clock of this step.
fn longest(step_s: f64) -> usize {
    /// In s, and in samples of a slow log.
    const LONGEST: (f64, usize) = (0.05, 3);
    ((LONGEST.0 / step_s).round() as usize).max(LONGEST.1)
}

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

/// A run of readings that no motion explains.
#[derive(Clone, Debug, PartialEq)]
pub struct Glitch {
    /// Which samples.
    pub samples: Range<usize>,
    /// The one that departs most from what the readings around the glitch predict.
    pub worst: usize,
    /// What it looks like.
    pub kind: GlitchKind,
    /// The reading there.
    pub value: f64,
    /// The prediction there.
    pub expected: f64,
}

/// The glitches of a position's readings, in rad or m; NaN are missing samples.
pub fn glitches(clock_s: &[f64], readings: &[f64]) -> Vec<Glitch> {
    departing(clock_s, readings, readings)
}

/// The same beside a simulation of the readings, without which a fast motion hides small glitches. The error of a model
/// that is wrong is as smooth as a motion.
pub fn glitches_beside(clock_s: &[f64], readings: &[f64], simulated: &[f64]) -> Vec<Glitch> {
    let errors: Vec<f64> = readings.iter().zip(simulated).map(|(reading, simulated)| reading - simulated).collect();
    let absolute = |glitch: Glitch| {
        let model = simulated[glitch.worst];
        Glitch { value: glitch.value + model, expected: glitch.expected + model, ..glitch }
    };
    departing(clock_s, &errors, readings).into_iter().map(absolute).collect()
}

/// The runs of `values`, of the sensor with these readings, that depart from their neighbours' predictions.
fn departing(clock_s: &[f64], values: &[f64], readings: &[f64]) -> Vec<Glitch> {
    let present: Vec<usize> = (0..values.len()).filter(|&i| values[i].is_finite()).collect();
    let sigma = resolution(readings).and_then(|resolution| deviation(clock_s, values, resolution));
    let (Some(sigma), Some(step_s)) = (sigma, median_step_s(clock_s)) else { return Vec::new() };
    let together = |a: &usize, b: &usize| clock_s[*b] - clock_s[*a] <= APART * step_s;
    let found = present.chunk_by(together).flat_map(|samples| {
        let of = |values: &[f64]| samples.iter().map(|&i| values[i]).collect();
        let series = Series { t: of(clock_s), x: of(values), sigma, step_s, longest: longest(step_s) };
        let in_log = |run: Departure| Glitch {
            samples: samples[run.samples.start]..samples[run.samples.end - 1] + 1,
            worst: samples[run.worst],
            kind: series.kind(&run),
            value: series.x[run.worst],
            expected: run.expected,
        };
        series.runs().into_iter().map(in_log).collect::<Vec<_>>()
    });
    found.collect()
}

/// Readings without gaps between them.
struct Series {
    t: Vec<f64>,
    x: Vec<f64>,
    sigma: f64,
    /// The clock's usual step.
    step_s: f64,
    /// Most samples of a glitch.
    longest: usize,
}

/// A run of samples that departs from what its neighbours predict.
struct Departure {
    samples: Range<usize>,
    worst: usize,
    expected: f64,
}

impl Series {
    /// All glitches from the first to the last.
    fn runs(&self) -> Vec<Departure> {
        let n = self.x.len();
        let (jumps, mut found, mut good) = (self.jumps(), Vec::new(), Vec::with_capacity(n));
        let mut i = 0;
        while i < n {
            let run = self.candidates(i, &jumps).into_iter().find_map(|run| self.departure(run, &good));
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
        let equal = |to: f64| self.x[i..end].iter().take_while(|x| is_same(**x, to)).count();
        let repeated = i.checked_sub(1).map(|last| equal(self.x[last]));
        let repeats = repeated.into_iter().chain([equal(0.0)]).filter(|count| *count > 1).map(|count| i..i + count);
        let returns = (i + 2..end).filter(|&k| jumps[i] && jumps[k]).map(|k| i..k);
        std::iter::once(i..i + 1).chain(repeats).chain(returns).chain(self.last(i, jumps)).collect()
    }

    /// A run up to the last sample that begins with a jump.
    fn last(&self, i: usize, jumps: &[bool]) -> Option<Range<usize>> {
        let n = self.x.len();
        (jumps[i] && n - i > 1 && n - i <= self.longest).then_some(i..n)
    }

    /// The run as a departure, if it is a glitch. `good` are the samples before it that are none.
    fn departure(&self, run: Range<usize>, good: &[usize]) -> Option<Departure> {
        let before = good[good.len().saturating_sub(SIDE)..].to_vec();
        let after: Vec<usize> = (run.end..self.x.len()).take(SIDE).collect();
        if before.len() < SIDE || after.len() < SIDE {
            return self.at_an_end(run, &before);
        }
        let inner = [before[1], before[2], after[0], after[1]];
        // Most runs end here.
        if self.least(&run, &inner) <= SIGMAS * self.sigma {
            return None;
        }
        let all: Vec<usize> = before.iter().chain(&after).copied().collect();
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
        let most = SIGMAS * self.sigma + ERRORS * rough + self.mistimed(&before, &after);
        (self.least(&run, &inner) > most).then(|| self.depart(run, &inner))
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
        (self.least(&run, nodes) > most).then(|| self.depart(run, nodes))
    }

    /// The departure of a run's first or last sample from the prediction by these nodes, whichever is smaller. A sensor
    /// that gets stuck is right at first.
    fn least(&self, run: &Range<usize>, nodes: &[usize]) -> f64 {
        let (first, last) = (self.apart(run.start, nodes), self.apart(run.end - 1, nodes));
        if self.repeats(run) { last } else { first.min(last) }
    }

    /// Whether a run holds nothing but the reading before it.
    fn repeats(&self, run: &Range<usize>) -> bool {
        run.start > 0 && self.x[run.clone()].iter().all(|x| is_same(*x, self.x[run.start - 1]))
    }

    fn is_zero(&self, run: &Range<usize>) -> bool {
        self.x[run.clone()].iter().all(|x| is_same(*x, 0.0))
    }

    /// Whether a run repeats the reading before it, and the step after it makes up for all steps that it lacks. A joint
    /// that friction has held goes on from where it is.
    fn catches_up(&self, run: &Range<usize>) -> bool {
        let (before, last, after) = (run.start - 1, run.end - 1, run.end);
        let step = |i: usize| self.x[i + 1] - self.x[i];
        let usual = 0.5 * (step(before - 1) + step(after));
        self.repeats(run) && step(last) / usual > CAUGHT_UP * (run.len() + 1) as f64
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

    fn kind(&self, run: &Departure) -> GlitchKind {
        let turns = (self.x[run.worst] - run.expected) / std::f64::consts::TAU;
        match () {
            () if turns.abs() > 0.5 && (turns - turns.round()).abs() < TURN => GlitchKind::WrapAround,
            () if self.is_zero(&run.samples) => GlitchKind::Zero,
            () if self.repeats(&run.samples) => GlitchKind::Stuck,
            () => GlitchKind::Spike,
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::random::stream;
    use proptest::prelude::*;
    use rand::RngExt;

    const RATE_HZ: f64 = 100.0;
    /// The sample at which 600 readings have an impact.
    const IMPACT: Range<usize> = 300..301;

    fn clock(n: usize) -> Vec<f64> {
        (0..n).map(|i| i as f64 / RATE_HZ).collect()
    }

    /// A motion with an impact in its middle, where the velocity changes its sign.
    fn readings(n: usize, sigma: f64, quantum: f64, seed: u64) -> Vec<f64> {
        let mut rng = stream(seed, &[1]);
        let middle = n as f64 / RATE_HZ / 2.0;
        let at = |t: f64| 0.8 * (3.0 * t).sin() + 0.3 * (11.0 * t + 1.0).sin() + 0.4 * (t - middle).abs();
        let round = |x: f64| if quantum > 0.0 { (x / quantum).round() * quantum } else { x };
        let mut gaussian = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        clock(n).iter().map(|t| round(at(*t) + sigma * gaussian())).collect()
    }

    #[test]
    fn noise_makes_a_glitch_of_an_impact_in_fewer_than_one_of_a_thousand() {
        let flagged = |seed: &u64| !glitches(&clock(600), &readings(600, 3e-4, 1.5e-3, *seed)).is_empty();
        let count = (0..4000).filter(flagged).count();
        assert!(count < 4, "{count} of 4000");
    }

    proptest! {
        #[test]
        fn a_motion_without_glitches_has_none(seed in 0u64..1_000_000, noise in 0usize..4) {
            let (sigma, quantum) = [(0.0, 0.0), (1e-3, 0.0), (3e-4, 1.5e-3), (0.0, 6e-3)][noise];
            let mut found = glitches(&clock(600), &readings(600, sigma, quantum, seed));
            found.retain(|glitch| glitch.samples != IMPACT);
            prop_assert!(found.is_empty(), "{:?}", found);
        }

        #[test]
        fn a_glitch_is_found_where_it_is(
            seed in 0u64..10_000, at in 10usize..580, long in 1usize..6, kind in 0usize..4,
        ) {
            use GlitchKind::{Spike, Stuck, WrapAround, Zero};
            let mut values = readings(600, 3e-4, 0.0, seed);
            let (samples, before) = (at..at + long, values[at - 1]);
            let moved = (values[at + long - 1] - before).abs();
            let (kind, size) = match kind {
                0 => (Zero, values[samples.clone()].iter().fold(f64::MAX, |least, x| least.min(x.abs()))),
                1 => (WrapAround, std::f64::consts::TAU),
                2 => (Stuck, moved),
                _ => (Spike, 0.3),
            };
            prop_assume!(size > 0.25 || kind == Stuck && moved > 0.06);
            for i in samples.clone() {
                values[i] = match kind {
                    Zero => 0.0,
                    WrapAround => values[i] - std::f64::consts::TAU,
                    Stuck => before,
                    Spike => values[i] + 0.3,
                };
            }
            let found = glitches(&clock(600), &values);
            prop_assert!(found.len() == 1 && found[0].kind == kind, "{:?} {:?} {}", samples, found, size);
            // Of a stuck sensor the first readings may still be right.
            prop_assert!(found[0].samples.end == samples.end, "{:?} {:?}", samples, found);
            prop_assert!(found[0].samples.start == samples.start || kind == Stuck, "{:?} {:?}", samples, found);
        }
    }

    #[test]
    fn readings_with_irregular_stamps_may_be_late() {
        let late = |i: usize| if i % 30 == 7 { 0.005 } else { 0.0 };
        let stamps: Vec<f64> = clock(300).iter().enumerate().map(|(i, t)| t + late(i)).collect();
        let values: Vec<f64> = (0..300).map(|i| (8.0 * (stamps[i] + 0.8 * late(i))).sin()).collect();
        assert_eq!(glitches(&stamps, &values), []);
        let unstamped: Vec<f64> = (0..300).map(|i| (8.0 * (clock(300)[i] + 1.8 * late(i))).sin()).collect();
        assert!(glitches(&clock(300), &unstamped).len() > 5, "with regular stamps the same is a glitch");
    }

    #[test]
    fn the_first_and_the_last_reading_may_be_glitches() {
        let mut values = readings(300, 1e-3, 0.0, 4);
        (values[0], values[299]) = (-3.0, 7.0);
        let found = glitches(&clock(300), &values);
        let samples: Vec<Range<usize>> = found.into_iter().map(|glitch| glitch.samples).collect();
        assert_eq!(samples, [0..1, 299..300]);
    }

    #[test]
    fn steps_that_stay_and_missing_samples_are_no_glitches() {
        let mut values = readings(300, 1e-3, 0.0, 5);
        values[100..].iter_mut().for_each(|x| *x += 0.7);
        values[200..230].fill(f64::NAN);
        assert_eq!(glitches(&clock(300), &values), []);
        let mut idle = vec![0.6; 300];
        (idle[50], idle[200]) = (0.6015, 0.0);
        assert_eq!(glitches(&clock(300), &idle).len(), 1, "a reading that flickers by a step is none");
        assert_eq!(glitches(&[], &[]), []);
    }
}
