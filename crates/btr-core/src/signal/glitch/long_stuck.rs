//! Sensors that are stuck for longer than a glitch lasts: one reading while the joint moves on, then a jump to where it
//! is.

use super::prediction::{APART, deviation, is_same, longest, median_step_s, resolution};
use super::series::{AROUND, JUMP, SIGMAS};
use crate::signal::stats::quantile;
use std::ops::Range;

/// Least and greatest jump at the end of a run, in jumps that the speed around the run would have made.
const MADE_UP: (f64, f64) = (0.3, 3.0);

/// Runs of one reading, longer than other glitches, that end in a jump: far above every step around the run, and as
/// large as the joint's speed before and after it asks for. A joint that friction holds moves on from where it is, and
/// one that slips in jerks rests before and after. With each, what its last sample should have read.
pub(super) fn runs(clock_s: &[f64], readings: &[f64]) -> Vec<(Range<usize>, f64)> {
    let sigma = resolution(readings).and_then(|resolution| deviation(clock_s, readings, resolution));
    let (Some(sigma), Some(step_s)) = (sigma, median_step_s(clock_s)) else { return Vec::new() };
    let shortest = longest(step_s) + 1;
    // The first reading of a run is the sensor's last right one.
    let repeats = |samples: &&[usize]| samples.len() > shortest;
    let all: Vec<usize> = (0..readings.len()).collect();
    let same = |a: &usize, b: &usize| is_same(readings[*a], readings[*b]);
    let found = all.chunk_by(same).filter(repeats).filter_map(|samples| {
        let run = samples[0] + 1..samples[samples.len() - 1] + 1;
        let around = Around { clock_s, readings, step_s };
        around.expected_after(&run, sigma).map(|expected| (run, expected))
    });
    found.collect()
}

/// What is around a run of readings.
struct Around<'a> {
    clock_s: &'a [f64],
    readings: &'a [f64],
    step_s: f64,
}

impl Around<'_> {
    /// What the last sample of a run should have read, if the sensor was stuck.
    fn expected_after(&self, run: &Range<usize>, sigma: f64) -> Option<f64> {
        let end = run.end;
        let before = self.steps(run.start.checked_sub(AROUND + 1)?..run.start - 1)?;
        let after = self.steps(end..end + AROUND)?;
        let jump = self.readings.get(end)? - self.readings[end - 1];
        let is_near = self.clock_s[end] - self.clock_s[run.start] <= APART * self.step_s * run.len() as f64;
        let largest = before.iter().chain(&after).map(|step| step.abs()).fold(0.0, f64::max);
        let usual = 0.5 * (quantile(before, 0.5)? + quantile(after, 0.5)?);
        let made_up = jump / (usual * (run.len() + 1) as f64);
        let is_stuck =
            is_near && jump.abs() > (SIGMAS * sigma).max(JUMP * largest) && (MADE_UP.0..MADE_UP.1).contains(&made_up);
        is_stuck.then(|| self.readings[end] - usual)
    }

    /// The steps from these samples to the next ones; `None` where one is missing.
    fn steps(&self, samples: Range<usize>) -> Option<Vec<f64>> {
        let step = |i: usize| Some(self.readings.get(i + 1)? - self.readings[i]).filter(|step| step.is_finite());
        samples.map(step).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLES: Range<usize> = 200..240;

    fn clock() -> Vec<f64> {
        (0..600).map(|i| 0.01 * f64::from(i)).collect()
    }

    /// A motion with an encoder of 12 bits; stuck for 40 samples.
    fn stuck(speed: f64) -> Vec<f64> {
        let at = |t: &f64| ((0.7 * (speed * t).sin()) / 1.5e-3).round() * 1.5e-3;
        let mut readings: Vec<f64> = clock().iter().map(at).collect();
        let last = readings[SAMPLES.start - 1];
        readings[SAMPLES].fill(last);
        readings
    }

    #[test]
    fn a_sensor_that_is_stuck_for_long_is_found_as_a_whole() {
        let found = runs(&clock(), &stuck(1.0));
        assert_eq!(found.iter().map(|(samples, _)| samples.clone()).collect::<Vec<_>>(), [SAMPLES]);
        assert!((found[0].1 - 0.7 * 2.39_f64.sin()).abs() < 0.01, "{found:?}");
    }

    #[test]
    fn a_joint_that_friction_holds_is_not_stuck() {
        // It goes on from where it is.
        let mut held = stuck(1.0);
        let jump = held[SAMPLES.end] - held[SAMPLES.end - 1];
        held[SAMPLES.end..].iter_mut().for_each(|x| *x -= jump);
        assert_eq!(runs(&clock(), &held), []);
        // It slips in jerks.
        let jerks: Vec<f64> = (0..600).map(|i| f64::from(i / 40) * 0.05).collect();
        assert_eq!(runs(&clock(), &jerks), []);
        // It rests, and is hit.
        let hit: Vec<f64> = (0..600).map(|i| if i < 240 { 0.0 } else { 0.04 * f64::from(i - 239) }).collect();
        assert_eq!(runs(&clock(), &hit), []);
    }
}
