//! Which of several explanations is named, and how certain it is.

use crate::synthetic::{NO_STEP, PERIOD_S, SyntheticModel, names, swing};
use btr_identify::diagnose::{CapReason, Diagnosis, Verdict};
use btr_identify::residual_model::{FitParameter, Needs};

/// Beside a large error of another cause, two laws are alike; without it, one of them is right.
#[test]
fn what_was_alike_is_compared_again_once_the_rest_is_known() {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        let part = |rate: f64| swing(rate, log, t);
        u[0] * part(3.0) + u[1] * part(5.0) + u[2] * (part(5.0) + 0.05 * part(7.0)) + u[3] * part(11.0)
    };
    let model = SyntheticModel::new(&["simple", "right", "other"], &[0.4, 0.0, 20.0, 15.0], motion);
    let diagnosis = model.diagnosis();
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["right", "other"]));
    let steps: Vec<&str> = diagnosis.ladder.iter().map(|step| step.step.as_str()).collect();
    assert!(steps.contains(&"right@here for simple@here"), "{steps:?}");
}

/// The same, with the right law named at once: the other one is not alike any more.
#[test]
fn what_was_alike_and_explains_less_beside_the_rest_is_told_apart() {
    let ask = |differs: f64| {
        let motion = move |u: &[f64], log: usize, t: f64, _: f64| {
            let part = |rate: f64| swing(rate, log, t);
            u[0] * part(3.0) + u[1] * part(5.0) + u[2] * (part(5.0) + differs * part(7.0)) + u[3] * part(11.0)
        };
        let mut model = SyntheticModel::new(&["right", "similar", "other"], &[0.4, 20.0, 0.0, 15.0], motion);
        model.candidates[2].site = "there".to_owned();
        model.diagnosis()
    };
    let told = ask(0.05);
    assert_eq!((told.verdict, names(&told)), (Verdict::EffectMissing, vec!["right", "other"]));
    assert!(told.effects[0].alike.is_empty() && told.effects[0].probability > 0.99, "{:?}", told.effects[0]);
    let alike = ask(0.001);
    assert_eq!((names(&alike), &*alike.effects[0].alike), (vec!["right", "other"], &["similar@here".to_owned()][..]));
    assert!(alike.effects[0].probability < 0.9, "{}", alike.effects[0].probability);
}

/// Friction, its creep, which does nothing without it, and an effect that comes closer than friction alone.
fn friction_that_creeps(truth: &[f64]) -> SyntheticModel {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        let (friction, creep, look_alike) = (u[1], u[2], u[3]);
        let part = |rate: f64| swing(rate, log, t);
        u[0] * part(3.0)
            + friction * (part(5.0) + 0.3 * creep * (part(7.0) + 0.5 * part(11.0)))
            + look_alike * (part(5.0) + 0.3 * part(7.0))
    };
    let mut model = SyntheticModel::new(&["friction", "creep", "look_alike"], truth, motion);
    model.candidates[1].needs = Needs::OneOf(vec![0]);
    model.candidates[2].similar = vec![0];
    model
}

#[test]
fn an_effect_with_its_companion_takes_the_place_of_a_look_alike() {
    let diagnosis = friction_that_creeps(&[0.4, 9.0, 1.0, 0.0]).diagnosis();
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["friction", "creep"]));
    let steps: Vec<&str> = diagnosis.ladder.iter().map(|step| step.step.as_str()).collect();
    assert!(steps.contains(&"friction@here + creep@here for look_alike@here"), "{steps:?}");
}

/// The same with a look-alike that contains friction, explains everything by itself, and misses by that much of
/// another part; of what the noise floor allows, the noise takes this share.
fn friction_inside(misses: f64, noise: f64) -> SyntheticModel {
    let motion = move |u: &[f64], log: usize, t: f64, _: f64| {
        let (friction, creep, look_alike) = (u[1], u[2], u[3]);
        let part = |rate: f64| swing(rate, log, t);
        let creeping = part(5.0) + 0.3 * part(7.0);
        u[0] * part(3.0)
            + friction * (part(5.0) + 0.3 * creep * part(7.0))
            + look_alike * (creeping + misses * part(11.0))
    };
    let truth = [0.4, 9.0, 1.0, 0.0];
    let mut model = SyntheticModel::new(&["friction", "creep", "look_alike"], &truth, motion);
    for (log, measured) in model.measured.iter_mut().enumerate() {
        for (i, measured) in measured.iter_mut().enumerate() {
            let exact = motion(&truth, log, i as f64 * PERIOD_S, NO_STEP);
            *measured = exact + noise * (*measured - exact);
        }
    }
    model.candidates[1].needs = Needs::OneOf(vec![0]);
    (model.candidates[2].similar, model.candidates[2].nested) = (vec![0], vec![0]);
    model
}

#[test]
fn a_law_and_its_companion_are_weighed_against_what_contains_the_law() {
    let alike = friction_inside(0.0, 1.0).diagnosis();
    assert_eq!((alike.verdict, names(&alike)), (Verdict::EffectMissing, vec!["look_alike"]));
    assert_eq!(alike.effects[0].alike, ["friction@here + creep@here"]);
    assert!((0.5..0.95).contains(&alike.effects[0].probability), "{}", alike.effects[0].probability);
    assert_eq!(alike.rivals.len(), 2);
    // Without an error above the noise floor, the held-out logs still tell which of them is right.
    let told = friction_inside(0.05, 0.7).diagnosis();
    assert_eq!((told.verdict, names(&told)), (Verdict::EffectMissing, vec!["friction", "creep"]));
}

#[test]
fn a_companion_is_no_cause_of_its_own() {
    let rigid = friction_that_creeps(&[0.4, 9.0, 0.0, 0.0]).diagnosis();
    assert_eq!((rigid.verdict, names(&rigid)), (Verdict::EffectMissing, vec!["friction"]));
    let other = friction_that_creeps(&[0.4, 0.0, 1.0, 9.0]).diagnosis();
    assert_eq!((other.verdict, names(&other)), (Verdict::EffectMissing, vec!["look_alike"]));
    let ranked = other.rounds.iter().flatten();
    assert!(ranked.into_iter().all(|candidate| candidate.name != "creep@here"));
}

#[test]
fn of_equivalent_effects_the_first_of_the_library_is_named() {
    // The first effect has a phase error too small to detect, so that the second fits slightly better.
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        u[0] * swing(3.0, log, t) + 4.0 * u[1] * swing(5.0, log, t + 0.0015) + 4.0 * u[2] * swing(5.0, log, t)
    };
    for truth in [[0.4, 1.5, 0.0], [0.4, 0.0, 1.5]] {
        let diagnosis = SyntheticModel::new(&["lift", "tilt"], &truth, motion).diagnosis();
        assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["lift"]));
        assert_eq!(diagnosis.effects[0].alike, ["tilt@here"]);
    }
}

/// A law, and a larger one that has another term of this size.
fn with_a_larger_law(term: f64) -> Diagnosis {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        u[0] * swing(3.0, log, t) + 4.0 * (u[1] + u[2]) * swing(5.0, log, t) + u[3] * swing(11.0, log, t)
    };
    let mut model = SyntheticModel::new(&["plain", "larger", "term"], &[0.4, 0.0, 1.5, term], motion);
    model.candidates.truncate(2);
    model.candidates[1].amplitudes.push(3);
    (model.candidates[0].similar, model.candidates[1].similar) = (vec![1], vec![0]);
    model.candidates[1].nested = vec![0];
    model.diagnosis()
}

#[test]
fn a_larger_law_must_earn_its_parameters() {
    let diagnosis = with_a_larger_law(0.25);
    let found = &diagnosis.effects[0];
    let first = &diagnosis.rounds[0];
    assert!(first[0].name == "larger@here" && first[0].delta_bic - first[1].delta_bic > 10.0, "{first:?}");
    assert_eq!((names(&diagnosis), &*found.alike), (vec!["plain"], &["larger@here".to_owned()][..]));
    assert!(found.probability > 0.99, "{}", found.probability);
    assert_eq!(names(&with_a_larger_law(0.7)), ["larger"]);
}

/// Two simulators of one model differ by more than this: many samples do not make it evidence.
#[test]
fn names_that_explain_logs_equally_are_alike_however_many_samples_there_are() {
    let ask = |unlike: f64| {
        let motion = move |u: &[f64], _: usize, t: f64, _: f64| {
            u[0] * t.sin() + u[1] * (3.0 * t).sin() + u[2] * ((3.0 * t).sin() + unlike * (7.0 * t).sin())
        };
        SyntheticModel::with_logs_of(20_000, &["a", "b"], &[0.5, 1.0, 0.0], motion).diagnosis()
    };
    // The wrong one leaves 0.15 % of the squared error more: 60 in B.
    let equal = ask(0.055);
    assert_eq!(
        (equal.effects[0].effect.as_str(), equal.effects[0].alike.as_slice()),
        ("a", ["b@here".to_owned()].as_slice())
    );
    assert!((0.5..0.9).contains(&equal.effects[0].probability), "{}", equal.effects[0].probability);
    let told_apart = ask(0.2);
    assert!(told_apart.effects[0].alike.is_empty() && told_apart.effects[0].probability > 0.99);
}

/// The training logs hardly tell two effects apart; in the held-out log, the first one does something else.
#[test]
fn held_out_logs_decide_where_the_training_logs_do_not() {
    let ask = |differs: f64| {
        let motion = move |u: &[f64], log: usize, t: f64, _: f64| {
            let other = if log == 2 { differs * swing(11.0, log, t) } else { 0.0 };
            u[0] * swing(3.0, log, t) + u[1] * (swing(5.0, log, t) + other) + u[2] * swing(5.0, log, t)
        };
        SyntheticModel::new(&["first", "second"], &[0.4, 0.0, 9.0], motion).diagnosis()
    };
    let told = ask(0.5);
    assert_eq!((told.verdict, names(&told)), (Verdict::EffectMissing, vec!["second"]));
    assert!(told.effects[0].alike.is_empty() && told.effects[0].probability > 0.99, "{:?}", told.effects);
    let alike = ask(0.0);
    assert_eq!((names(&alike), alike.effects[0].alike.as_slice()), (vec!["first"], &["second@here".to_owned()][..]));
}

/// In the training logs, the first effect moves as two others do together; in the held-out log it hardly does.
#[test]
fn what_explains_far_more_of_the_held_out_logs_comes_first() {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        let part = |rate: f64| swing(rate, log, t);
        let mixture = if log == 2 { 0.2 * part(5.0) } else { part(5.0) + 0.3 * part(11.0) };
        u[0] * part(3.0) + u[1] * mixture + u[2] * part(5.0) + u[3] * part(11.0)
    };
    let diagnosis = SyntheticModel::new(&["mixture", "first", "second"], &[0.4, 0.0, 9.0, 2.7], motion).diagnosis();
    let best = &diagnosis.rounds[0][0];
    assert!(best.name == "mixture@here", "{:?}", diagnosis.rounds[0]);
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["first", "second"]));
}

/// The first effect explains most of two others together, one of which shows in the training logs alone.
#[test]
fn what_only_training_logs_show_replaces_a_similar_effect() {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        let part = |rate: f64| swing(rate, log, t);
        let unseen = |amplitude: f64| if log == 2 { 0.0 } else { amplitude };
        let mixture = unseen(1.0) * part(5.0) + 0.4 * part(7.0) + unseen(0.3) * part(11.0);
        u[0] * part(3.0) + u[1] * mixture + u[2] * unseen(1.0) * part(5.0) + u[3] * part(7.0)
    };
    let mut model = SyntheticModel::new(&["mixture", "part", "other"], &[0.4, 0.0, 10.0, 6.0], motion);
    (model.candidates[0].similar, model.candidates[1].similar) = (vec![1], vec![0]);
    let diagnosis = model.diagnosis();
    let steps: Vec<&str> = diagnosis.ladder.iter().map(|step| step.step.as_str()).collect();
    assert!(steps.contains(&"part@here for mixture@here"), "{steps:?}");
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["part", "other"]));
    // Where the two are not similar, nothing is replaced by what the held-out log does not confirm.
    model.candidates.iter_mut().for_each(|candidate| candidate.similar.clear());
    assert_ne!(names(&model.diagnosis()), ["part", "other"]);
}

/// What else a law can do may pass for another effect in the training logs, and not in the held-out log.
#[test]
fn a_part_of_a_law_beside_another_effect_takes_its_place_where_held_out_logs_show_that() {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        let part = |rate: f64| swing(rate, log, t);
        let offset = part(if log == 2 { 17.0 } else { 9.0 });
        let whole = u[1] * part(5.0) + u[2] * part(9.0) + u[3] * part(13.0) + u[4] * part(19.0);
        u[0] * part(3.0) + whole + u[5] * part(5.0) + u[6] * offset
    };
    let truth = [0.4, 0.0, 0.0, 0.0, 0.0, 20.0, 5.0];
    let mut model = SyntheticModel::new(&["whole", "back", "fast", "faster", "part", "offset"], &truth, motion);
    model.candidates.drain(1..4);
    let whole = &mut model.candidates[0];
    (whole.amplitudes, whole.similar, whole.nested) = (vec![1, 2, 3, 4], vec![1], vec![1]);
    model.candidates[1].similar = vec![0];
    let diagnosis = model.diagnosis();
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["part", "offset"]));
    let last = diagnosis.ladder.last().map(|step| step.step.as_str());
    assert_eq!(last, Some("part@here + offset@here for whole@here"));
    assert!(diagnosis.effects.iter().all(|found| found.evidence.established), "{:?}", diagnosis.effects);
    assert_eq!(diagnosis.effects[0].alike, ["whole@here"]);
}

/// One cause that is not among the candidates may be behind two findings at one place.
#[test]
fn no_name_is_certain_beside_another_one_at_its_place() {
    let ask = |sites: [&str; 2]| {
        let motion = |u: &[f64], log: usize, t: f64, _: f64| {
            u[0] * swing(3.0, log, t) + u[1] * swing(5.0, log, t) + u[2] * swing(11.0, log, t)
        };
        let mut model = SyntheticModel::new(&["one", "other"], &[0.4, 9.0, 8.0], motion);
        model.candidates.iter_mut().zip(sites).for_each(|(candidate, site)| candidate.site = site.to_owned());
        model.diagnosis()
    };
    let [together, apart, of_the_robot] = [["here"; 2], ["here", "there"], ["*"; 2]].map(ask);
    assert!(of_the_robot.effects.iter().all(|found| found.probability > 0.99));
    assert_eq!((together.verdict, names(&together)), (Verdict::EffectMissing, names(&apart)));
    for (found, beside) in apart.effects.iter().zip(&together.effects) {
        let cap = beside.probability_cap.as_ref().unwrap();
        assert!(found.probability > 0.99 && beside.probability <= 0.9, "{found:?}, {beside:?}");
        assert_eq!(cap.reasons, [CapReason::SamePlace]);
    }
}

/// A law that depends on the direction is the same as its symmetric part beside an offset, unless it does more.
#[test]
fn a_law_is_alike_a_part_of_it_beside_another_effect() {
    let ask = |beyond: f64| {
        let motion = |u: &[f64], log: usize, t: f64, _: f64| {
            let part = |rate: f64| swing(rate, log, t);
            let (both, differs) = (u[1] + u[2] + u[5], u[1] - u[2] + u[6]);
            u[0] * part(3.0) + both * part(5.0) + differs * part(9.0) + u[3] * part(13.0) + u[4] * part(17.0)
        };
        let truth = [0.4, 0.0, 0.0, beyond, 0.0, 20.0, 5.0];
        let mut model = SyntheticModel::new(&["whole", "back", "fast", "faster", "part", "offset"], &truth, motion);
        model.candidates.drain(1..4);
        let whole = &mut model.candidates[0];
        (whole.amplitudes, whole.similar, whole.nested) = (vec![1, 2, 3, 4], vec![1], vec![1]);
        model.candidates[1].similar = vec![0];
        model.diagnosis()
    };
    let symmetric = ask(0.0);
    assert_eq!((symmetric.verdict, names(&symmetric)), (Verdict::EffectMissing, vec!["whole"]));
    let found = &symmetric.effects[0];
    assert!(found.probability < 0.8 && found.alike == ["part@here + offset@here"], "{found:?}");
    let whole = ask(5.0);
    let found = &whole.effects[0];
    assert!(whole.effects.len() == 1 && found.probability > 0.99 && found.alike.is_empty(), "{found:?}");
}

/// A spring with ripples beside it can follow any torque that depends on the position.
#[test]
fn no_name_is_certain_beside_several_instances_of_a_similar_effect() {
    let ask = |similar: bool| {
        let motion = |u: &[f64], log: usize, t: f64, _: f64| {
            let part = |rate: f64| swing(rate, log, t);
            u[0] * part(3.0) + u[1] * part(5.0) + u[2] * part(7.0) + u[3] * part(11.0)
        };
        let mut model = SyntheticModel::new(&["spring", "ripple", "ripple"], &[0.4, 9.0, 8.0, 7.0], motion);
        (model.candidates[1].site, model.candidates[2].site) = ("there".to_owned(), "there#2".to_owned());
        model.candidates[2].needs = Needs::Instance(1);
        if similar {
            (model.candidates[0].similar, model.candidates[1].similar) = (vec![1], vec![0]);
        }
        model.diagnosis()
    };
    let together = ask(true);
    assert_eq!((together.verdict, together.effects.len()), (Verdict::EffectMissing, 3));
    for found in &together.effects {
        let cap = found.probability_cap.as_ref().unwrap();
        assert!(found.probability <= 0.9 && cap.reasons.contains(&CapReason::Series), "{found:?}");
    }
    let apart = ask(false);
    assert!(
        apart.effects.len() == 3 && apart.effects.iter().all(|found| found.probability > 0.99),
        "{:?}",
        apart.effects
    );
}

/// What is left is certain, and too small to be named: what is named may stand in for something else.
#[test]
fn no_name_is_certain_that_leaves_something_for_certain() {
    let ask = |left: f64| {
        let motion = move |u: &[f64], log: usize, t: f64, _: f64| {
            u[0] * swing(3.0, log, t) + u[1] * swing(5.0, log, t) + u[2] * swing(11.0, log, t)
        };
        SyntheticModel::with_logs_of(4_000, &["large", "small"], &[0.4, 9.0, left], motion).diagnosis()
    };
    let stands_in = ask(0.27);
    assert_eq!((stands_in.verdict, names(&stands_in)), (Verdict::EffectMissing, vec!["large"]));
    let left_over = stands_in.left_over.as_ref().unwrap();
    assert!(left_over.name == "small@here" && left_over.delta_bic > 100.0, "{left_over:?}");
    assert!(stands_in.effects[0].probability <= 0.9);
    let alone = ask(0.0);
    assert!(alone.left_over.is_none() && alone.effects[0].probability > 0.99, "{:?}", alone.left_over);
}

/// The gain would have to go a little further than it may.
#[test]
fn no_name_is_certain_beside_a_parameter_at_its_bound() {
    let ask = |gain: f64| {
        let motion = |u: &[f64], log: usize, t: f64, _: f64| u[0] * swing(3.0, log, t) + u[1] * swing(5.0, log, t);
        SyntheticModel::new(&["friction"], &[gain, 9.0], motion).diagnosis()
    };
    let bounded = ask(3.2);
    assert_eq!((bounded.verdict, names(&bounded)), (Verdict::EffectMissing, vec!["friction"]));
    assert_eq!(bounded.at_bound, ["gain"]);
    let cap = bounded.effects[0].probability_cap.as_ref().unwrap();
    assert!(cap.reasons.contains(&CapReason::ParameterAtBound) && cap.at_most <= 0.9, "{cap:?}");
    assert!(ask(0.4).effects[0].probability > 0.99);
}

/// Where nothing creeps, the larger law is the smaller one, and what creeps is its further term.
#[test]
fn a_larger_law_is_found_together_with_its_companion() {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        let part = |rate: f64| swing(rate, log, t);
        let creep = 1.0 - (-u[4]).exp();
        u[0] * part(3.0)
            + (u[1] + u[2]) * part(5.0)
            + u[3] * creep * part(7.0)
            + 0.2 * creep * (u[1] + u[2] - u[3]) * part(11.0)
    };
    let mut model = SyntheticModel::new(&["plain", "larger", "term", "creep"], &[0.4, 0.0, 9.0, 9.0, 2.0], motion);
    model.candidates.remove(2);
    model.candidates[1].amplitudes.push(3);
    (model.candidates[0].similar, model.candidates[1].similar) = (vec![1], vec![0]);
    model.candidates[1].nested = vec![0];
    model.candidates[2].needs = Needs::OneOf(vec![0, 1]);
    let diagnosis = model.diagnosis();
    let steps: Vec<&str> = diagnosis.ladder.iter().map(|step| step.step.as_str()).collect();
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["larger", "creep"]), "{steps:?}");
}

/// What the logs cannot tell apart, the user may know: the parameter that moved is told with the effect that would do
/// the same, unless nothing does, or the logs tell them apart.
#[test]
fn a_parameter_that_moved_far_is_told_with_the_effect_that_it_may_stand_in_for() {
    let ask = |rate: f64, gain: f64| {
        let motion = move |u: &[f64], log: usize, t: f64, _: f64| {
            9.0 * (1.0 + u[0]) * swing(3.0, log, t) + u[1] * swing(rate, log, t)
        };
        let mut model = SyntheticModel::new(&["friction"], &[gain, 0.0], motion);
        model.parameters[0] = FitParameter { name: "gain@here".to_owned(), origin: 1.0, ..model.parameters[0].clone() };
        let diagnosis = model.diagnosis();
        assert_eq!(diagnosis.verdict, Verdict::NothingMissing, "{:?}", diagnosis.ladder);
        diagnosis.stand_ins
    };
    let told = &ask(3.0, 0.6)[0];
    assert_eq!(
        (told.parameter.as_str(), told.in_model, &told.effects[..]),
        ("gain@here", 1.0, &["friction@here".into()][..])
    );
    assert!((told.value - 1.6).abs() < 0.05, "{told:?}");
    // Another motion, and a gain that hardly moved.
    assert_eq!((ask(5.0, 0.6), ask(3.0, 0.05)), (vec![], vec![]));
}
