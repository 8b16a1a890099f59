//! Estimates of a toy whose truth is known.
#![allow(clippy::unwrap_used)]

use super::abduction::{Abduction, Extension};
use super::posterior::{Estimated, Posterior};
use super::problem::{EstimationContext, EstimationProblem};
use crate::coevolve::evaluate::Cost;
use crate::coevolve::fixture::{DerivedSpace, Toy, ToyRobot, tested, whitened};
use crate::coevolve::plan::PosteriorPhase;
use crate::random;
use crate::space::Dim;
use rand::RngExt;

fn estimated(toy: &Toy, truth: &[f64], seed: u64) -> Estimated {
    let ledger = tested(&mut ToyRobot::new(toy, truth, seed), 1);
    let distance = whitened();
    let prior = Posterior::of_bounds(&[0.5, 0.5]);
    let setting = EstimationProblem {
        simulator: toy,
        distance: &distance,
        tests: ledger.entries().iter().collect(),
        prior: prior.clone(),
    };
    setting
        .settle(&prior, &EstimationContext { phase: &PosteriorPhase::default(), seed }, &mut Cost::default())
        .unwrap()
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
fn unpredictable_motion_is_neither_informative_nor_a_misfit() {
    let truth = [1.7, 1.13];
    let (orderly, chaotic) = (estimated(&Toy::new(false, &[]), &truth, 3), estimated(&Toy::new(true, &[]), &truth, 3));
    assert!(orderly.explains && chaotic.explains, "{} {}", orderly.chi, chaotic.chi);
    assert!(chaotic.unpredictable[0] > 5.0 && orderly.unpredictable[0] < 1.0, "{:?}", chaotic.unpredictable);
    // Half of the readings carry no information.
    assert!(chaotic.samples < 0.6 * orderly.samples, "{} {}", chaotic.samples, orderly.samples);
    assert!(chaotic.belief.sd(0) > orderly.belief.sd(0));
}

/// For how many of some truths the first turn finds the test as simulations predict it.
fn predicted(toy: &Toy, robot: &Toy, hidden: &[f64], seeds: std::ops::Range<u64>) -> usize {
    let (distance, prior, phase) = (whitened(), Posterior::of_bounds(&[0.5, 0.5]), PosteriorPhase::default());
    let first_turn = |seed: &u64| {
        let ledger = tested(&mut ToyRobot::new(robot, &[&drawn(*seed)[..], hidden].concat(), *seed), 1);
        let tests = ledger.entries().iter().collect();
        let setting = EstimationProblem { simulator: toy, distance: &distance, tests, prior: prior.clone() };
        let by = EstimationContext { phase: &phase, seed: *seed };
        setting.next(&prior, 1, &by, &mut Cost::default()).unwrap().as_predicted
    };
    seeds.filter(first_turn).count()
}

#[test]
fn a_robot_is_predicted_as_often_as_simulations_are() {
    // 90 % of 100, and all that noise leaves besides; three standard deviations of that are 9.
    let chaotic = Toy::new(true, &[]);
    let held = predicted(&chaotic, &chaotic, &[], 0..100);
    assert!(held >= 81, "{held} of 100");
    let drifting = Toy::new(true, &[Dim::new("drift.rate@toy", "1/s", -2.0, 2.0).nominal(0.0)]);
    let fooled = predicted(&chaotic, &drifting, &[0.5], 0..100);
    assert!(fooled <= 5, "{fooled} of 100");
}

#[test]
fn a_chaotic_remainder_keeps_the_belief_from_the_beginning() {
    let toy = Toy::new(true, &[]);
    let ledger = tested(&mut ToyRobot::new(&toy, &[1.7, 1.13], 3), 1);
    let (distance, prior, phase) = (whitened(), Posterior::of_bounds(&[0.5, 0.5]), PosteriorPhase::default());
    let whole = &ledger.entries()[0];
    let begun = whole.beginning(0.4);
    let of = |test| EstimationProblem { simulator: &toy, distance: &distance, tests: vec![test], prior: prior.clone() };
    let (by, cost) = (EstimationContext { phase: &phase, seed: 3 }, &mut Cost::default());
    let first = of(&begun).settle(&prior, &by, cost).unwrap();
    let then = of(whole).narrow(&first.belief, &by, cost).unwrap();
    assert!(first.explains && then.explains, "{} {}", first.chi, then.chi);
    assert!(then.belief.volume() <= first.belief.volume());
}

#[test]
fn a_parameter_without_effect_is_not_identified() {
    let idle = Toy::new(false, &[Dim::new("idle", "1", 0.0, 1.0).nominal(0.3)]).space;
    let deaf = DerivedSpace { space: idle, of: Toy::new(false, &[]), by: |s: &[f64]| s[..2].to_vec() };
    let ledger = tested(&mut ToyRobot::new(&deaf.of, &[1.7, 1.1], 5), 1);
    let (distance, prior) = (whitened(), Posterior::of_bounds(&[0.5, 0.5, 0.3]));
    let setting = EstimationProblem {
        simulator: &deaf,
        distance: &distance,
        tests: ledger.entries().iter().collect(),
        prior: prior.clone(),
    };
    let estimated = setting
        .settle(&prior, &EstimationContext { phase: &PosteriorPhase::default(), seed: 5 }, &mut Cost::default())
        .unwrap();
    let beliefs = estimated.belief.beliefs(&deaf.space, 0.05, true);
    assert!(beliefs["rate"].identified && beliefs["gain"].identified && !beliefs["idle"].identified, "{beliefs:?}");
    let open = estimated.belief.open_directions(&deaf.space);
    assert_eq!(open.len(), 1, "{open:?}");
    assert_eq!(open[0].parameters.keys().collect::<Vec<_>>(), ["idle"]);
}

#[test]
fn an_effect_that_s_lacks_is_found() {
    let drift = || Dim::new("drift.rate@toy", "1/s", -2.0, 2.0).nominal(0.0);
    let bend = || Dim::new("gain_again", "1", 0.0, 1.0).nominal(0.0);
    let (small, robot) = (Toy::new(false, &[]), Toy::new(false, &[drift()]));
    let ledger = tested(&mut ToyRobot::new(&robot, &[1.7, 1.13, 0.05], 8), 2);
    let distance = whitened();
    let (learn, held_out) = ledger.entries().split_at(1);
    let abduction = Abduction {
        distance: &distance,
        learn: vec![learn.iter().collect()],
        held_out: held_out.iter().collect(),
        phase: PosteriorPhase::default(),
        seed: 8,
    };
    let (cost, prior) = (&mut Cost::default(), Posterior::of_bounds(&[0.5, 0.5]));
    let without = abduction.fit(&small, &prior, &prior, cost).unwrap();
    assert!(!without.estimated.explains && !without.confirmed, "{}", without.estimated.chi);
    // Another extension that changes nothing that a gain would not.
    let again = DerivedSpace {
        space: Toy::new(false, &[bend()]).space,
        of: Toy::new(false, &[]),
        by: |s: &[f64]| vec![s[0], s[1] + s[2]],
    };
    let extensions = [
        Extension { simulator: &again, probes: vec![vec![0.1]] },
        Extension { simulator: &robot, probes: vec![vec![0.5], vec![-0.5]] },
    ];
    let suspects = abduction.screen(&small, &prior, &without.estimated.belief, &extensions, cost).unwrap();
    assert_eq!(suspects[0].extension, 1, "{suspects:?}");
    let larger = Posterior::of_bounds(&[0.5, 0.5, 0.5]);
    let from = abduction.beginning(&without.estimated.belief, &suspects[0], &larger);
    let fitted = abduction.fit(&robot, &larger, &from, cost).unwrap();
    assert!(fitted.estimated.explains && fitted.confirmed, "{}", fitted.estimated.chi);
    let drift = robot.space.from_unit(fitted.estimated.belief.mean().as_slice())[2];
    assert!((drift - 0.05).abs() < 0.005, "{drift}");
}
