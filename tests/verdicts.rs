//! Verdicts on robots that differ much from their model: what is named, and what is not.
#![allow(clippy::unwrap_used)]

use btr_identify::diagnose::{Diagnosis, Verdict};
use btr_lab::identification::IdentificationProblem;
use btr_physics::effects::{PlacedEffect, find};
use btr_tests::planted::{Planted, Waves, arm, diagnosis, names, problem};

const WAVES: Waves = Waves { seconds: 4, amplitude_rad: 0.5 };

/// An effect with values in the order of its parameters.
fn effect(name: &str, site: &str, values: &[f64]) -> PlacedEffect {
    PlacedEffect { effect: find(name).unwrap(), site: site.to_owned(), values: values.to_vec() }
}

/// The diagnosis of the arm with these effects planted.
fn diagnosed(effects: Vec<PlacedEffect>) -> (IdentificationProblem, Diagnosis) {
    let problem = problem(arm(str::to_owned), WAVES, &Planted { effects, ..Planted::default() }, &[]);
    let diagnosis = diagnosis(&problem);
    (problem, diagnosis)
}

/// The estimate of a finding's parameter.
fn estimate(diagnosis: &Diagnosis, name: &str) -> f64 {
    let all = diagnosis.effects.iter().flat_map(|found| &found.parameters);
    all.into_iter().find(|estimate| estimate.name == name).unwrap().value
}

/// The shoulder cannot hold the arm and sags by hundreds of noise floors: no probe around the model's motion shows the
/// way to that.
#[test]
fn a_motor_that_is_too_weak_is_found_from_far_away() {
    let (problem, diagnosis) = diagnosed(vec![effect("torque_limit", "shoulder", &[1.1])]);
    let error = diagnosis.ladder[1].train;
    assert!(error > 100.0, "{error}");
    assert_eq!(
        (diagnosis.verdict, names(&problem, &diagnosis)),
        (Verdict::EffectMissing, vec!["torque_limit@shoulder".to_owned()])
    );
    let torque = estimate(&diagnosis, "torque_limit.torque@shoulder");
    assert!((torque / 1.1 - 1.0).abs() < 0.01, "{torque}");
    assert!(diagnosis.rollouts < 10_000, "{}", diagnosis.rollouts);
}
