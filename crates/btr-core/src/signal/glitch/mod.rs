//! Glitches in readings of positions and torques: samples that no motion explains, because a sensor or its bus failed.
//!
//! A joint moves smoothly: cubics through the readings around a few samples predict these to within the noise and the
//! error with which they predict each other. A run of samples is a glitch if it departs from that prediction, at its
//! first sample and at its last, by many times either. An impact bends a motion in one sample; that changes the
//! predictions of the neighbours about as much (by a third of the departure), so it is none. Where the clock's steps
//! are irregular, a reading may have been taken earlier or later than its stamp says, by as much as the steps differ.

mod long_stuck;
mod prediction;
mod rows;
mod series;

pub use rows::repeated_rows;
pub use series::GlitchKind;

use prediction::{APART, deviation, is_fine, longest, median_step_s, quantisation, range, resolution};
use series::{Departure, Series, Torque};
use std::ops::Range;

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

/// Most samples of a glitch other than of a sensor that is stuck for long; `None` for a clock without steps.
pub fn usually_longest(clock_s: &[f64]) -> Option<usize> {
    median_step_s(clock_s).map(longest)
}

/// The glitches of a position's readings, in rad or m; NaN are missing samples.
pub fn glitches(clock_s: &[f64], readings: &[f64]) -> Vec<Glitch> {
    let whole = |(samples, expected): (Range<usize>, f64)| {
        let (worst, value) = (samples.end - 1, readings[samples.start]);
        Glitch { samples, worst, kind: GlitchKind::Stuck, value, expected }
    };
    let long: Vec<Glitch> = long_stuck::runs(clock_s, readings).into_iter().map(whole).collect();
    // Of such a run, the last samples depart from what follows.
    let is_part = |glitch: &Glitch| long.iter().any(|run| run.samples.contains(&glitch.samples.start));
    let mut all = departing(clock_s, readings, Of::Position);
    all.retain(|glitch| !is_part(glitch));
    all.extend(long);
    all.sort_by_key(|glitch| glitch.samples.start);
    all
}

/// The glitches of a torque's readings; NaN are missing samples. A torque has no turns to be off by, and may rest at
/// one value for long, as at a limit. It jumps where dry friction changes its sign: of several samples in a row, only
/// those count that are zero or repeat a reading, if the readings are too fine to do so by chance, or that are far
/// outside their range.
pub fn torque_glitches(clock_s: &[f64], readings: &[f64]) -> Vec<Glitch> {
    departing(clock_s, readings, Of::Torque)
}

/// The glitches of a position beside a simulation of its readings, without which a fast motion hides small ones. The
/// error of a model that is wrong is as smooth as a motion.
pub fn glitches_beside(clock_s: &[f64], readings: &[f64], simulated: &[f64]) -> Vec<Glitch> {
    let errors: Vec<f64> = readings.iter().zip(simulated).map(|(reading, simulated)| reading - simulated).collect();
    let absolute = |glitch: Glitch| {
        let model = simulated[glitch.worst];
        Glitch { value: glitch.value + model, expected: glitch.expected + model, ..glitch }
    };
    departing(clock_s, readings, Of::Errors(&errors)).into_iter().map(absolute).collect()
}

/// What is searched.
#[derive(Clone, Copy)]
enum Of<'a> {
    /// The readings of a position.
    Position,
    /// Those of a torque.
    Torque,
    /// A position's errors beside a simulation.
    Errors(&'a [f64]),
}

/// The runs of readings, or of their errors beside a simulation, that depart from their neighbours' predictions.
fn departing(clock_s: &[f64], readings: &[f64], of: Of<'_>) -> Vec<Glitch> {
    let (values, finest, is_beside) = match of {
        Of::Errors(errors) => (errors, quantisation(readings), true),
        _ => (readings, resolution(readings), false),
    };
    let present: Vec<usize> = (0..values.len()).filter(|&i| values[i].is_finite()).collect();
    let sigma = finest.and_then(|finest| deviation(clock_s, values, finest));
    let (Some(sigma), Some(step_s)) = (sigma, median_step_s(clock_s)) else { return Vec::new() };
    let torque = matches!(of, Of::Torque)
        .then(|| Torque { is_fine: is_fine(readings, sigma), range: range(readings).unwrap_or(f64::INFINITY) });
    let together = |a: &usize, b: &usize| clock_s[*b] - clock_s[*a] <= APART * step_s;
    let found = present.chunk_by(together).flat_map(|samples| {
        let of = |values: &[f64]| samples.iter().map(|&i| values[i]).collect();
        let series = Series {
            t: of(clock_s),
            x: of(values),
            readings: of(readings),
            is_beside,
            torque,
            sigma,
            step_s,
            longest: longest(step_s),
        };
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
            // A sensor that is stuck from the onset of a motion on looks like a joint that rests.
            let begins = (before - values[at - 2]).abs() < 0.5 * moved / long as f64;
            let (kind, size) = match kind {
                0 => (Zero, values[samples.clone()].iter().fold(f64::MAX, |least, x| least.min(x.abs()))),
                1 => (WrapAround, std::f64::consts::TAU),
                2 => (Stuck, moved),
                _ => (Spike, 0.3),
            };
            prop_assume!(size > 0.25 || kind == Stuck && moved > 0.06 && !begins);
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
    fn two_glitches_with_one_or_two_readings_between_them_are_found() {
        use GlitchKind::{Spike, WrapAround, Zero};
        for (seed, between) in (0..200).flat_map(|seed| [(seed, 1), (seed, 2)]) {
            let mut values = readings(600, 3e-4, 0.0, seed);
            let far = (320..580).find(|&i| values[i - 4..i + 8].iter().all(|x| x.abs() > 0.3)).unwrap();
            let second = far + 2 + between;
            values[far..far + 2].fill(0.0);
            values[second..second + 2].fill(0.0);
            values[100] -= 2.0;
            (101 + between..104 + between).for_each(|i| values[i] -= std::f64::consts::TAU);
            let found = glitches(&clock(600), &values);
            let found: Vec<_> = found.into_iter().map(|glitch| (glitch.samples, glitch.kind)).collect();
            let turned = 101 + between..104 + between;
            let all = [(100..101, Spike), (turned, WrapAround), (far..far + 2, Zero), (second..second + 2, Zero)];
            assert_eq!(found, all, "{seed}");
        }
    }

    /// A joint's torque: its motion's, and dry friction, whose sign changes.
    fn torque(seed: u64, quantum: f64) -> Vec<f64> {
        let mut rng = stream(seed, &[2]);
        let at = |t: f64| 20.0 * (3.0 * t).sin() + 5.0 + 6.0 * (3.0 * t).cos().signum();
        let round = |x: f64| if quantum > 0.0 { (x / quantum).round() * quantum } else { x };
        let mut gaussian = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        clock(600).iter().map(|t| round(at(*t) + 0.5 * gaussian())).collect()
    }

    #[test]
    fn a_torque_has_no_glitch_where_friction_changes_its_sign_nor_where_it_rests() {
        for seed in 0..300 {
            let mut values = torque(seed, if seed % 2 == 0 { 0.0 } else { 0.5 });
            let limit = if seed % 3 == 0 { 0.0 } else { values[250] };
            values[250..350].fill(limit);
            // It was off before.
            values[0] = 0.0;
            assert_eq!(torque_glitches(&clock(600), &values), [], "{seed}");
        }
    }

    #[test]
    fn spikes_and_exact_zeros_of_a_torque_are_found() {
        for seed in 0..100 {
            let mut values = torque(seed, 0.0);
            // 12 deviations above the rest; and zeros 4 deviations away, too near to show by their size.
            (values[100], values[203]) = (values[100] + 60.0, values[203] - std::f64::consts::TAU * 10.0);
            let near = (300..590).find(|&i| values[i - 3..i + 5].iter().all(|x| (2.5..9.0).contains(x))).unwrap();
            values[near..near + 2].fill(0.0);
            let found = torque_glitches(&clock(600), &values);
            let kinds: Vec<_> = found.iter().map(|glitch| (glitch.samples.clone(), glitch.kind)).collect();
            let [spike, zero] = [GlitchKind::Spike, GlitchKind::Zero];
            assert_eq!(kinds, [(100..101, spike), (203..204, spike), (near..near + 2, zero)], "{seed}");
        }
    }

    #[test]
    fn a_reading_that_is_late_by_half_a_step_is_a_glitch_in_a_fast_motion_and_not_at_its_onset() {
        let at = |t: f64| 0.8 * (3.0 * t).sin();
        let mut moving: Vec<f64> = clock(600).iter().map(|t| at(*t)).collect();
        let mut begins: Vec<f64> = clock(600).iter().map(|t| at((t - 2.0).max(0.0))).collect();
        let between = |values: &mut [f64], i: usize| values[i] = 0.2 * values[i - 1] + 0.8 * values[i + 1] - 1e-4;
        between(&mut moving, 203);
        between(&mut begins, 201);
        let found = glitches(&clock(600), &moving);
        assert_eq!(found.iter().map(|glitch| glitch.samples.start..).collect::<Vec<_>>(), [203..]);
        assert_eq!(glitches(&clock(600), &begins), []);
    }

    /// Two samples that a stuck sensor or a zero has spoilt, in a fast motion at 25 Hz beside a model of it.
    #[test]
    fn beside_a_simulation_zeros_and_repeated_readings_show_in_the_readings() {
        use GlitchKind::{Stuck, Zero};
        let t: Vec<f64> = (0..300).map(|i| f64::from(i) / 25.0).collect();
        let model: Vec<f64> = t.iter().map(|t| 0.05 + 0.1 * (4.0 * t).sin()).collect();
        let mut rng = stream(5, &[1]);
        let mut gaussian = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        let readings: Vec<f64> = model.iter().map(|x| x + 8e-4 * gaussian()).collect();
        assert_eq!(glitches_beside(&t, &readings, &model), []);
        let spoilt = |samples: Range<usize>, to: f64| {
            let mut spoilt = readings.clone();
            spoilt[samples].fill(to);
            let found = glitches_beside(&t, &spoilt, &model);
            found.into_iter().map(|glitch| (glitch.samples, glitch.kind)).collect::<Vec<_>>()
        };
        assert_eq!(spoilt(29..31, 0.0), [(29..31, Zero)]);
        assert_eq!(spoilt(43..45, readings[42]), [(43..45, Stuck)]);
        // Seven deviations are enough for a repeated reading.
        assert_eq!(spoilt(66..67, readings[65]), [(66..67, Stuck)]);
        // A joint that rests while its model moves on is none, not even at zero.
        let (mut resting, moving) = (vec![0.0; 300], |i: usize| 0.02 * (-((i as f64 - 150.0) / 1.5).powi(2)).exp());
        resting.iter_mut().enumerate().for_each(|(i, x)| *x = if i % 40 < 20 { 0.0 } else { 0.0015 });
        let model: Vec<f64> = (0..300).map(moving).collect();
        assert_eq!(glitches_beside(&t, &resting, &model), []);
    }

    /// A step command at 100 Hz: the first reading after it is far from a cubic, and from a model that is late.
    #[test]
    fn the_onset_of_a_motion_is_no_glitch() {
        let t = clock(300);
        let step = |k: usize| if k < 120 { 0.0 } else { 0.3 * (1.0 - (-((k - 119) as f64) / 3.0).exp()) };
        let quantised = |x: f64| 0.6 + (x / 1.5e-3).round() * 1.5e-3;
        let readings: Vec<f64> = (0..300).map(|k| quantised(step(k))).collect();
        let late: Vec<f64> = (0..300).map(|k: usize| 0.6 + step(k.saturating_sub(1))).collect();
        assert_eq!(glitches(&t, &readings), []);
        assert_eq!(glitches_beside(&t, &readings, &late), []);
        // The same with a joint that rests at zero.
        let at_zero: Vec<f64> = readings.iter().map(|x| x - 0.6).collect();
        assert_eq!(glitches(&t, &at_zero), []);
    }

    #[test]
    fn readings_with_irregular_stamps_may_be_late() {
        let late = |i: usize| if i % 30 == 7 { 0.005 } else { 0.0 };
        let stamps: Vec<f64> = clock(300).iter().enumerate().map(|(i, t)| t + late(i)).collect();
        let values: Vec<f64> = (0..300).map(|i| (8.0 * (stamps[i] + 1.1 * late(i))).sin()).collect();
        assert_eq!(glitches(&stamps, &values), []);
        let unstamped: Vec<f64> = (0..300).map(|i| (8.0 * (clock(300)[i] + 2.1 * late(i))).sin()).collect();
        assert!(glitches(&clock(300), &unstamped).len() > 5, "with regular stamps the same is a glitch");
    }

    #[test]
    fn the_first_and_the_last_reading_may_be_glitches() {
        let mut values = readings(300, 1e-3, 0.0, 4);
        (values[0], values[299]) = (-3.0, 7.0);
        let found = glitches(&clock(300), &values);
        let samples: Vec<Range<usize>> = found.into_iter().map(|glitch| glitch.samples).collect();
        assert_eq!(samples, [0..1, 299..300]);
        // A joint that comes to rest, or begins to move.
        let clock = clock(300);
        let moving = |from: usize, to: usize, i: usize| 0.6 + 0.05 * (i.clamp(from, to) - from) as f64;
        assert_eq!(glitches(&clock, &(0..300).map(|i| moving(0, 295, i)).collect::<Vec<_>>()), []);
        assert_eq!(glitches(&clock, &(0..300).map(|i| moving(297, 300, i)).collect::<Vec<_>>()), []);
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
