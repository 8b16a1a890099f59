//! What is tried where a search ends and leaves an error.

use crate::synthetic::{SyntheticModel, names, swing};
use btr_identify::diagnose::{DiagnoseOptions, Verdict, diagnose};
use btr_identify::fit::Objective;

/// A mixture that comes closer than either of two effects alone, and beside which neither of them does anything; the
/// second one only acts beside the first.
fn with_an_obstacle() -> SyntheticModel {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        let part = |rate: f64| swing(rate, log, t);
        let left = (1.0 - (u[3] / 3.0).powi(2)).max(0.0);
        let both = u[1] * part(5.0) + u[1] * u[2] / 9.0 * part(7.0);
        u[0] * part(3.0) + left * both + u[3] * (part(5.0) + 0.5 * part(7.0) + 0.65 * part(11.0))
    };
    SyntheticModel::new(&["first", "second", "obstacle"], &[0.4, 9.0, 6.75, 0.0], motion)
}

#[test]
fn two_effects_are_found_although_another_one_explains_more_than_either_of_them() {
    let diagnosis = with_an_obstacle().diagnosis();
    assert_eq!(diagnosis.rounds[0][0].name, "obstacle@here");
    let steps: Vec<&str> = diagnosis.ladder.iter().map(|step| step.step.as_str()).collect();
    assert_eq!(steps[2..], ["+ obstacle@here", "- obstacle@here", "+ first@here", "+ second@here"]);
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["first", "second"]));
}

#[test]
fn another_first_finding_is_not_tried_beyond_the_rollouts_that_are_allowed() {
    let model = with_an_obstacle();
    let with = |most: usize| {
        let question = DiagnoseOptions { max_rollouts: most, max_rollouts_while_falling: most, max_effects: 3 };
        let diagnosis = diagnose(&mut Objective::new(&model), question, &|_| ()).unwrap();
        names(&diagnosis).iter().map(|name| (*name).to_owned()).collect::<Vec<_>>()
    };
    let ends: Vec<Vec<String>> = (1..60).map(|k| with(20 * k)).collect();
    let is_found = |names: &Vec<String>| names[..] == ["first", "second"];
    let from = ends.iter().position(is_found).unwrap();
    assert_eq!(ends[from - 1], ["obstacle"]);
    assert!(ends[from..].iter().all(is_found), "{ends:?}");
}
