//! Estimates of a toy whose truth is known: two numbers seen through a swing, with a jump and a part that nobody can foretell.
#![allow(clippy::unwrap_used)]

use super::*;
use crate::coevolve::abduction::{Abduction, Extension};
use crate::coevolve::ledger::Ledger;
use crate::distance::Whitened;
use crate::log::{Log, Role};
use crate::space::{Dim, Space};
use crate::world::{Behaviour, Outcome, Reality, Trial, WorldError};
use rand::RngExt;

const SIGMA: f64 = 0.02;
const ROWS: usize = 300;

/// `rate` and `gain` of a swing; beyond its second half, a motion that a change of a millionth of either turns over.
struct Toy {
    space: Space,
    controllers: Space,
    chaotic: bool,
}

impl Toy {
    fn new(chaotic: bool, further: &[Dim]) -> Self {
        let dims = [Dim::new("rate", "rad/s", 1.0, 3.0).nominal(2.0), Dim::new("gain", "1", 0.5, 1.5).nominal(1.0)];
        Toy { space: Space::new([&dims, further].concat()).unwrap(), controllers: Space::default(), chaotic }
    }

    fn readings(&self, s: &[f64]) -> Vec<f64> {
        let (rate, gain, drift) = (s[0], s[1], s.get(2).copied().unwrap_or(0.0));
        let reading = |k: usize| {
            let t = 0.02 * k as f64;
            let wild =
                if self.chaotic && k > ROWS / 2 { 0.5 * (1e7 * (rate + 3.0 * gain) + 50.0 * t).sin() } else { 0.0 };
            // A foot that lands a step earlier.
            let landed = if t > 0.02 * (50.0 * gain).floor() { 0.05 } else { 0.0 };
            gain * (rate * t).sin() + landed + wild + drift * t
        };
        (0..ROWS).map(reading).collect()
    }

    fn behaviour(&self, q: Vec<f64>) -> Behaviour {
        let mut log = Log::new((0..ROWS).map(|k| 0.02 * k as f64).collect()).unwrap();
        log.insert("q_toy", "rad", Role::Measured, q).unwrap();
        Behaviour { log, fitness: 0.0 }
    }
}

impl Simulator for Toy {
    fn simulations(&self) -> &Space {
        &self.space
    }

    fn controllers(&self) -> &Space {
        &self.controllers
    }

    fn scenarios(&self) -> usize {
        1
    }

    fn run(&self, s: &[f64], _: &[f64], _: usize) -> Result<Behaviour, WorldError> {
        Ok(self.behaviour(self.readings(s)))
    }
}

/// A toy that errs.
struct Robot<'a> {
    toy: &'a Toy,
    truth: Vec<f64>,
    seed: u64,
}

impl Reality for Robot<'_> {
    fn test(&mut self, trial: &Trial) -> Outcome {
        let mut rng = random::stream(self.seed, &[trial.number as u64]);
        let noisy = |q: f64| q + SIGMA * crate::search::normal(&mut rng);
        Outcome::Done(self.toy.behaviour(self.toy.readings(&self.truth).into_iter().map(noisy).collect()))
    }
}

fn tested(robot: &mut Robot, tests: usize) -> Ledger {
    let mut ledger = Ledger::default();
    for number in 0..tests {
        let trial = Trial { number, iteration: 1, controller: Vec::new(), scenario: 0 };
        ledger.carry_out(trial, (None, None), robot).unwrap();
    }
    ledger
}

fn whitened() -> Whitened {
    Whitened { noise: [("q_*".to_owned(), SIGMA)].into_iter().collect(), ..Whitened::default() }
}

fn estimated(toy: &Toy, truth: &[f64], seed: u64) -> Estimated {
    let ledger = tested(&mut Robot { toy, truth: truth.to_vec(), seed }, 1);
    let distance = whitened();
    let prior = Posterior::of_bounds(&[0.5, 0.5]);
    let setting =
        Setting { simulator: toy, distance: &distance, tests: ledger.entries().iter().collect(), prior: prior.clone() };
    setting.settle(&prior, &PosteriorPhase::default(), seed, &mut Cost::default()).unwrap()
}

fn drawn(seed: u64) -> [f64; 2] {
    let mut rng = random::stream(seed, &[99]);
    [1.2 + 1.6 * rng.random::<f64>(), 0.6 + 0.8 * rng.random::<f64>()]
}

/// How many of the intervals of many truths hold them, and how many there are.
fn coverage(toy: &Toy, seeds: std::ops::Range<u64>) -> (usize, usize) {
    let (mut held, mut all) = (0, 0);
    for seed in seeds {
        let truth = drawn(seed);
        let beliefs = estimated(toy, &truth, seed).belief.beliefs(&toy.space, 0.05, true);
        for (belief, truth) in beliefs.values().zip(truth) {
            let [low, high] = belief.ci95.unwrap();
            (held, all) = (held + usize::from((low..=high).contains(&truth)), all + 1);
        }
    }
    (held, all)
}

#[test]
fn intervals_hold_the_truth_as_often_as_they_say() {
    // 95 % of 200 are 190; five standard deviations of that are 15.
    for chaotic in [false, true] {
        let (held, all) = coverage(&Toy::new(chaotic, &[]), 0..100);
        assert!(held >= 175, "{held} of {all}, chaotic: {chaotic}");
    }
}

#[test]
fn what_nobody_can_foretell_teaches_nothing_and_is_no_misfit() {
    let truth = [1.7, 1.13];
    let (orderly, chaotic) = (estimated(&Toy::new(false, &[]), &truth, 3), estimated(&Toy::new(true, &[]), &truth, 3));
    assert!(orderly.explains && chaotic.explains, "{} {}", orderly.chi, chaotic.chi);
    assert!(chaotic.unpredictable[0] > 5.0 && orderly.unpredictable[0] < 1.0, "{:?}", chaotic.unpredictable);
    // Half of the readings say nothing.
    assert!(chaotic.samples < 0.6 * orderly.samples, "{} {}", chaotic.samples, orderly.samples);
    assert!(chaotic.belief.sd(0) > orderly.belief.sd(0));
}

#[test]
fn a_number_that_does_nothing_is_not_told() {
    let toy = Toy::new(false, &[Dim::new("idle", "1", 0.0, 1.0).nominal(0.3)]);
    let mute = Toy::new(false, &[]);
    struct Deaf<'a>(&'a Toy, &'a Toy);
    impl Simulator for Deaf<'_> {
        fn simulations(&self) -> &Space {
            &self.0.space
        }
        fn controllers(&self) -> &Space {
            &self.0.controllers
        }
        fn scenarios(&self) -> usize {
            1
        }
        fn run(&self, s: &[f64], c: &[f64], scenario: usize) -> Result<Behaviour, WorldError> {
            self.1.run(&s[..2], c, scenario)
        }
    }
    let ledger = tested(&mut Robot { toy: &mute, truth: vec![1.7, 1.1], seed: 5 }, 1);
    let (distance, prior) = (whitened(), Posterior::of_bounds(&[0.5, 0.5, 0.3]));
    let deaf = Deaf(&toy, &mute);
    let setting = Setting {
        simulator: &deaf,
        distance: &distance,
        tests: ledger.entries().iter().collect(),
        prior: prior.clone(),
    };
    let estimated = setting.settle(&prior, &PosteriorPhase::default(), 5, &mut Cost::default()).unwrap();
    let beliefs = estimated.belief.beliefs(&toy.space, 0.05, true);
    assert!(beliefs["rate"].told && beliefs["gain"].told && !beliefs["idle"].told, "{beliefs:?}");
    let open = estimated.belief.open_directions(&toy.space);
    assert_eq!(open.len(), 1, "{open:?}");
    assert_eq!(open[0].parameters.keys().collect::<Vec<_>>(), ["idle"]);
}

#[test]
fn what_s_lacks_is_not_explained_and_is_named() {
    let drift = || Dim::new("drift.rate@toy", "1/s", -2.0, 2.0).nominal(0.0);
    let bend = || Dim::new("gain_again", "1", 0.0, 1.0).nominal(0.0);
    let (small, robot) = (Toy::new(false, &[]), Toy::new(false, &[drift()]));
    let ledger = tested(&mut Robot { toy: &robot, truth: vec![1.7, 1.13, 0.05], seed: 8 }, 2);
    let distance = whitened();
    let (learn, held_out) = ledger.entries().split_at(1);
    let abduction = Abduction {
        distance: &distance,
        learn: learn.iter().collect(),
        held_out: held_out.iter().collect(),
        phase: PosteriorPhase::default(),
        seed: 8,
    };
    let (cost, prior) = (&mut Cost::default(), Posterior::of_bounds(&[0.5, 0.5]));
    let without = abduction.fit(&small, &prior, &prior, cost).unwrap();
    assert!(!without.estimated.explains && !without.confirmed, "{}", without.estimated.chi);
    // Another extension that changes nothing that a gain would not.
    struct Again(Toy);
    impl Simulator for Again {
        fn simulations(&self) -> &Space {
            &self.0.space
        }
        fn controllers(&self) -> &Space {
            &self.0.controllers
        }
        fn scenarios(&self) -> usize {
            1
        }
        fn run(&self, s: &[f64], _: &[f64], _: usize) -> Result<Behaviour, WorldError> {
            Ok(self.0.behaviour(self.0.readings(&[s[0], s[1] + s[2], 0.0])))
        }
    }
    let again = Again(Toy::new(false, &[bend()]));
    let extensions = [
        Extension { simulator: &again, probes: vec![vec![0.1]] },
        Extension { simulator: &robot, probes: vec![vec![0.5], vec![-0.5]] },
    ];
    let suspects = abduction.screen(&small, &prior, &without.estimated.belief, &extensions, cost);
    assert_eq!(suspects[0].extension, 1, "{suspects:?}");
    let larger = Posterior::of_bounds(&[0.5, 0.5, 0.5]);
    let from = abduction.beginning(&without.estimated.belief, &suspects[0], &larger);
    let fitted = abduction.fit(&robot, &larger, &from, cost).unwrap();
    assert!(fitted.estimated.explains && fitted.confirmed, "{}", fitted.estimated.chi);
    let drift = robot.space.from_unit(fitted.estimated.belief.mean().as_slice())[2];
    assert!((drift - 0.05).abs() < 0.005, "{drift}");
}
