//! What is compared again once everything is explained.

use crate::synthetic::{SyntheticModel, names, swing};
use btr_identify::diagnose::Verdict;

/// A mixture that comes closer than the first of two effects as long as the second is missing; it may have another
/// part, which the logs do not show.
fn with_a_mixture(has_part: bool) -> SyntheticModel {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        let part = |rate: f64| swing(rate, log, t);
        let mixture = u[2] * (part(5.0) + 0.3 * part(11.0)) + u[4] * part(7.0);
        u[0] * part(3.0) + u[1] * part(11.0) + mixture + u[3] * part(5.0)
    };
    let mut model = SyntheticModel::new(&["second", "mixture", "first", "part"], &[0.4, 1.4, 0.0, 9.0, 0.0], motion);
    model.candidates.truncate(3);
    model.candidates[1].amplitudes.extend(has_part.then_some(4));
    model
}

#[test]
fn what_came_close_takes_over_if_it_explains_as_much_with_fewer_parameters() {
    let diagnosis = with_a_mixture(true).diagnosis();
    assert!(diagnosis.rounds[0][0].name == "mixture@here", "{:?}", diagnosis.rounds[0]);
    let steps: Vec<&str> = diagnosis.ladder.iter().map(|step| step.step.as_str()).collect();
    assert!(steps.contains(&"first@here for mixture@here"), "{steps:?}");
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["first", "second"]));
}

#[test]
fn what_came_close_is_declared_alike_if_it_explains_as_much_beside_what_was_found_later() {
    let diagnosis = with_a_mixture(false).diagnosis();
    let found = &diagnosis.effects[0];
    assert_eq!((names(&diagnosis), &*found.alike), (vec!["mixture", "second"], &["first@here".to_owned()][..]));
    assert!((found.probability - 0.5).abs() < 0.05, "{}", found.probability);
}

/// How many effects that show nothing are offered beside the others.
const IDLE: usize = 60;

/// A load whose small sizes show little moves as two other effects do together.
#[test]
fn one_effect_takes_the_place_of_two_that_explain_no_more() {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        let part = |rate: f64| swing(rate, log, t);
        let idle: f64 = (4..4 + IDLE)
            .map(|i| u[i] * (swing(20.0 + i as f64, log, t) + if log == 2 { 0.0 } else { 0.8 * part(5.0) }))
            .sum();
        let load = u[3] * u[3].abs() / 6.0;
        u[0] * part(3.0) + u[1] * part(5.0) + u[2] * part(7.0) + load * (part(5.0) + 0.06 * part(7.0)) + idle
    };
    let idle: Vec<String> = (0..IDLE).map(|i| format!("idle{i}")).collect();
    let effects: Vec<&str> = ["length", "centre", "load"].into_iter().chain(idle.iter().map(String::as_str)).collect();
    let mut truth = vec![0.0; IDLE + 4];
    (truth[0], truth[3]) = (0.4, 7.3);
    let mut model = SyntheticModel::new(&effects, &truth, motion);
    (model.candidates[1].similar, model.candidates[2].similar) = (vec![2], vec![1]);
    let diagnosis = model.diagnosis();
    let steps: Vec<&str> = diagnosis.ladder.iter().map(|step| step.step.as_str()).collect();
    assert!(steps.contains(&"load@here for length@here + centre@here"), "{steps:?}");
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["load"]));
}
