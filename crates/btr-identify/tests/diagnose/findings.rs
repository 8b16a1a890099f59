//! What is found where logs, steps, signs or contact make it difficult.

use crate::synthetic::{GLITCH, NO_STEP, PERIOD_S, SAMPLES, SyntheticModel, names, swing};
use btr_identify::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use btr_identify::fit::Objective;
use btr_identify::residual_model::{MeasuredChannel, Parametrisation};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

#[test]
fn an_effect_that_shows_on_one_side_only_is_found_there() {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        u[0] * swing(3.0, log, t) + 4.0 * (-u[1]).max(0.0) * swing(5.0, log, t) + u[2] * swing(7.0, log, t)
    };
    let model = SyntheticModel { contact: true, ..SyntheticModel::new(&["lift", "tilt"], &[0.4, -1.5, 0.0], motion) };
    let diagnosis = model.diagnosis();
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["lift"]));
    assert!((diagnosis.fit.u[1] + 1.5).abs() < 0.1, "{:?}", diagnosis.fit.u);
}

/// Starts that are wrong by much are read from the model before a small effect is looked for beside their error.
#[test]
fn starts_that_explain_most_of_what_is_left_come_before_the_next_effect() {
    let ask = |wrong: f64| {
        let motion = |u: &[f64], log: usize, t: f64, _: f64| {
            u[0] * swing(3.0, log, t) + u[1] * swing(5.0, log, t) + u[2] * swing(7.0, log, t)
        };
        let mut model = SyntheticModel::new(&["large", "small"], &[0.4, 12.0, 1.5], motion);
        model.from_starts = Some(Arc::new(motion));
        model.motion = Arc::new(move |u: &[f64], log, t, step| motion(u, log, t, step) + wrong * swing(11.0, log, t));
        model.diagnosis()
    };
    let found = ask(5.0);
    let steps: Vec<&str> = found.ladder.iter().skip(2).map(|step| step.step.as_str()).collect();
    assert_eq!(steps, ["+ large@here", "starts re-estimated", "+ small@here"]);
    // What is no larger than the effect that is missing may stand in for it.
    let steps: Vec<String> = ask(1.5).ladder.into_iter().skip(2).map(|step| step.step).collect();
    assert_eq!(steps, ["+ large@here", "+ small@here", "starts re-estimated"]);
}

/// A size that is off by 3 % explains nothing, and others seem to explain more: it is tried, and others about it.
#[test]
fn a_size_is_searched_about_what_the_error_shows() {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        // As commands that come too early or too late.
        let stair = if u[1] == 0.0 { 0.0 } else { 12.0 * swing(5.0, log, t + 0.8 * (u[1] - 10.0)) };
        u[0] * swing(3.0, log, t) + stair + u[2] * swing(7.0, log, t) + u[3] * swing(8.0, log, t)
    };
    let mut model = SyntheticModel::new(&["right", "loud", "louder"], &[0.4, 10.0, 0.0, 0.0], motion);
    model.parameters[1..].iter_mut().for_each(|parameter| parameter.law = Parametrisation::Stair);
    let loud = vec![(3.0, 9e9), (2.0, 8e9)];
    model.sizes = vec![Vec::new(), vec![(9.7, 1e3)], loud.clone(), loud];
    let diagnosis = model.diagnosis();
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["right"]));
    assert!((diagnosis.fit.u[1] - 10.0).abs() < 0.01, "{:?}", diagnosis.fit.u);
}

/// In each log the free gain may take the place of the effect, so that any other candidate seems as good; between the
/// logs it cannot.
#[test]
fn what_a_free_parameter_follows_in_each_log_is_found_between_them() {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        let others: f64 = (2..62).map(|k| u[k] * swing(3.0 + k as f64, log, t)).sum();
        (5.0 * u[0] + u[1] * (80.0 + [20.0, -20.0, 10.0][log])) * swing(3.0, log, t) + others
    };
    let others: Vec<String> = (2..62).map(|k| format!("other_{k}")).collect();
    let effects: Vec<&str> = ["opposed"].into_iter().chain(others.iter().map(String::as_str)).collect();
    let truth: Vec<f64> = [-0.6, 0.075].into_iter().chain(others.iter().map(|_| 0.0)).collect();
    let diagnosis = SyntheticModel::new(&effects, &truth, motion).diagnosis();
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["opposed"]));
}

#[test]
fn a_stopped_diagnosis_names_the_first_of_what_a_whole_one_names() {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        u[0] * swing(3.0, log, t) + u[1] * swing(5.0, log, t) + u[2] * swing(7.0, log, t)
    };
    let model = SyntheticModel::new(&["large", "small"], &[0.4, 9.0, 2.5], motion);
    let whole = model.diagnosis();
    assert_eq!((names(&whole), whole.cut_short), (vec!["large", "small"], false));
    let mut stopped_with = [0; 3];
    for calls in (0..400).step_by(10) {
        let asked = AtomicUsize::new(0);
        let signal = Arc::new(move || asked.fetch_add(1, Ordering::Relaxed) >= calls);
        let mut objective = Objective::new(&model).stopping_when(signal);
        let stopped = diagnose(&mut objective, DiagnoseOptions::default(), &|_| ()).unwrap();
        assert_eq!(names(&stopped)[..], names(&whole)[..stopped.effects.len()]);
        assert!(stopped.cut_short || stopped.effects.len() == 2, "{calls}");
        assert!(stopped.ladder.last().is_some_and(|step| step.held_out.is_some()), "{calls}");
        stopped_with[stopped.effects.len()] += 1;
    }
    assert!(stopped_with.iter().all(|count| *count > 0), "{stopped_with:?}");
}

/// Beyond the usual rollouts a diagnosis goes on while what is found halves the error, and no longer.
#[test]
fn a_diagnosis_goes_on_while_what_is_found_halves_the_error() {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        u[0] * swing(3.0, log, t) + u[1] * swing(5.0, log, t) + u[2] * swing(7.0, log, t)
    };
    let found = |sizes: [f64; 2], max_rollouts: usize, max_rollouts_while_falling: usize| {
        let model = SyntheticModel::new(&["first", "second"], &[0.4, sizes[0], sizes[1]], motion);
        let options = DiagnoseOptions { max_rollouts, max_rollouts_while_falling, ..DiagnoseOptions::default() };
        let diagnosis = diagnose(&mut Objective::new(&model), options, &|_| ()).unwrap();
        (diagnosis.effects.len(), diagnosis.cut_short)
    };
    // The first leaves less than half the error, or hardly less than before.
    for (sizes, then) in [([9.0, 2.5], (2, false)), ([9.0, 8.5], (1, true))] {
        let one = (1..100).map(|k| 20 * k).find(|&most| found(sizes, most, most) == (1, true)).unwrap();
        assert_eq!(found(sizes, one, usize::MAX), then, "{sizes:?} {one}");
        assert_eq!(found(sizes, usize::MAX, usize::MAX), (2, false));
    }
}

/// One effect shows in the training logs, another one in the held-out log.
#[test]
fn effects_that_show_in_different_logs_are_found_together() {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        let (often, rarely) = if log == 2 { (0.1, 1.0) } else { (1.0, 0.25) };
        u[0] * swing(3.0, log, t) + u[1] * often * swing(5.0, log, t) + u[2] * rarely * swing(7.0, log, t)
    };
    let model = SyntheticModel::new(&["training", "held_out"], &[0.4, 9.0, 20.0], motion);
    let diagnosis = model.diagnosis();
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["training", "held_out"]));
    // The held-out logs do not confirm the second one beside the first.
    let alone = SyntheticModel::new(&["training", "held_out"], &[0.4, 9.0, 0.0], motion).diagnosis();
    assert_eq!(names(&alone), vec!["training"]);
}

#[test]
fn an_effect_of_many_times_its_typical_size_is_found_despite_a_nonlinear_response() {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        u[0] * swing(3.0, log, t) + u[1] * swing(5.0, log, t + 0.05 * u[1]) + 0.2 * u[2] * swing(5.5, log, t)
    };
    let diagnosis = SyntheticModel::new(&["offset", "tilt"], &[0.4, -23.0, 0.0], motion).diagnosis();
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["offset"]));
    assert!((diagnosis.fit.u[1] + 23.0).abs() < 0.1, "{:?}", diagnosis.fit.u);
}

#[test]
fn a_step_too_coarse_for_the_held_out_log_alone_is_made_finer() {
    // The error falls with the step, but cannot be extrapolated from half the step.
    let motion = |u: &[f64], log: usize, t: f64, finer: f64| {
        let step_error = if log == 2 { 1.5 / finer * swing(4.0 + finer.min(8.0), log, t) } else { 0.0 };
        u[0] * swing(3.0, log, t) + step_error + 4.0 * u[1] * swing(5.0, log, t)
    };
    let diagnosis = SyntheticModel::new(&["tilt"], &[0.4, 0.0], motion).diagnosis();
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::NothingMissing, vec![]));
    assert!(diagnosis.integrator_error > 0.2, "{}", diagnosis.integrator_error);
}

#[test]
fn a_robot_that_tips_over_is_explained_by_the_beginning_of_its_logs() {
    // Once it tips over, every parameter affects how it falls.
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        let beginning = u[0] * swing(3.0, log, t) + 4.0 * u[1] * swing(5.0, log, t) + 4.0 * u[2] * swing(7.0, log, t);
        let tipped = 20.0 * (swing(9.0, log, t + 3.0 * (u[0] + u[1] + u[2])) - swing(9.0, log, 1.2));
        beginning + if t > 1.2 { tipped } else { 0.0 }
    };
    let whole = SyntheticModel::new(&["lift", "tilt"], &[0.4, 0.0, 1.5], motion);
    assert_ne!(whole.diagnosis().verdict, Verdict::EffectMissing, "whole logs do not show the effect");
    let diagnosis = SyntheticModel { beginning: Some(120), ..whole }.diagnosis();
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["tilt"]));
    assert!((diagnosis.fit.u[2] - 1.5).abs() < 0.1, "{:?}", diagnosis.fit.u);
}

/// Channels in a log of the following model.
const CHANNELS: usize = 8;

/// The width of the effect's interval where each channel has a constant offset of this size, which is in no model: a
/// foot lands at a slightly different place. The truth must be within it.
fn width_with_offsets<const PER_CENT: u32>(contact: bool) -> f64 {
    let motion = |u: &[f64], log: usize, t: f64, finer: f64| {
        let channel = (t * CHANNELS as f64 / (SAMPLES as f64 * PERIOD_S)) as usize;
        let size = f64::from(PER_CENT) / 100.0;
        let off = if finer < NO_STEP { 0.0 } else { size * (2.0 * (channel * channel + log) as f64).sin() };
        u[0] * swing(1.0, log, t) + 4.0 * u[1] * swing(2.0, log, t) + off
    };
    let mut model = SyntheticModel { contact, ..SyntheticModel::new(&["tilt"], &[0.4, 1.5], motion) };
    for log in &mut model.logs {
        let length = SAMPLES / CHANNELS;
        let channel = |k: usize| {
            let samples = k * length..(k + 1) * length;
            MeasuredChannel { samples, present: length, ..log.channels[0].clone() }
        };
        log.channels = (0..CHANNELS).map(channel).collect();
    }
    let [low, high] = model.diagnosis().effects[0].parameters[0].ci95.unwrap();
    assert!(low < 1.5 && 1.5 < high, "{low} {high}");
    high - low
}

#[test]
fn intervals_are_as_wide_as_channels_differ() {
    for contact in [false, true] {
        let (without, with) = (width_with_offsets::<0>(contact), width_with_offsets::<40>(contact));
        assert!(with > 1.3 * without, "{contact}: {with} {without}");
    }
}

const DECOYS: usize = 40;

/// Many decoy effects that seem to explain more of the training logs than the lift does, and nothing of the held-out
/// log, and the true effect: a lift of `size` typical sizes, whose response is nine times `response` of its size.
fn among_decoys(size: f64, response: fn(f64) -> f64) -> SyntheticModel {
    among_decoys_that_show(0.0, size, response)
}

/// The same with decoys of which this share shows in the held-out log.
fn among_decoys_that_show(held_out: f64, size: f64, response: fn(f64) -> f64) -> SyntheticModel {
    let motion = move |u: &[f64], log: usize, t: f64, _: f64| {
        let share = if log == 2 { held_out } else { 0.8 };
        let other = |i: usize| share * swing(5.0, log, t) + swing(20.0 + i as f64, log, t);
        let lift = 9.0 * response(u[DECOYS + 1]) * swing(5.0, log, t);
        u[0] * swing(3.0, log, t) + (1..=DECOYS).map(|i| u[i] * other(i)).sum::<f64>() + lift
    };
    let decoys: Vec<String> = (1..=DECOYS).map(|i| format!("other{i}")).collect();
    let effects: Vec<&str> = decoys.iter().map(String::as_str).chain(["lift"]).collect();
    let mut truth = vec![0.0; DECOYS + 2];
    truth[DECOYS + 1] = size;
    SyntheticModel::new(&effects, &truth, motion)
}

#[test]
fn an_error_is_unexplained_only_after_all_candidates_were_fitted() {
    for contact in [false, true] {
        let diagnosis = SyntheticModel { contact, ..among_decoys(30.0, |u| u / 30.0) }.diagnosis();
        assert_eq!(
            (diagnosis.verdict, names(&diagnosis)),
            (Verdict::EffectMissing, vec!["lift"]),
            "contact: {contact}"
        );
    }
}

#[test]
fn what_fits_the_training_logs_far_better_than_others_is_compared_with_all_candidates() {
    let diagnosis = among_decoys_that_show(0.3, 30.0, |u| u / 30.0).diagnosis();
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["lift"]));
}

#[test]
fn with_contact_the_leading_effect_is_tried_at_other_sites_if_it_leaves_much() {
    // At all sizes that are simulated for every candidate, this lift explains less than the decoys seem to.
    let peak = |u: f64| (1.0 + ((u - 9.0) / 2.5).powi(2)).recip() - (1.0 + (9.0f64 / 2.5).powi(2)).recip();
    let mut model = SyntheticModel { contact: true, ..among_decoys(9.0, peak) };
    assert_ne!(model.diagnosis().verdict, Verdict::EffectMissing, "no effect of the same name leads");
    for (place, candidate) in model.candidates.iter_mut().enumerate() {
        (candidate.effect, candidate.site) = ("payload".to_owned(), format!("place {place}"));
    }
    let diagnosis = model.diagnosis();
    let found = &diagnosis.effects[0];
    assert_eq!((diagnosis.verdict, &*found.site), (Verdict::EffectMissing, "place 40"));
}

#[test]
fn glitches_that_only_a_fitted_model_shows_do_not_change_the_verdict() {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| u[0] * swing(3.0, log, t) + 4.0 * u[1] * swing(5.0, log, t);
    let clean = SyntheticModel::new(&["large"], &[0.4, 9.0], motion);
    let mut spoilt = clean.clone();
    for (log, sample) in [(0, 50), (1, 300), (2, 120), (2, 121)] {
        spoilt.measured[log][sample] += 1.4 * GLITCH;
    }
    let (clean, spoilt) = (clean.diagnosis(), spoilt.diagnosis());
    assert_eq!((spoilt.verdict, names(&spoilt)), (clean.verdict, names(&clean)));
    assert_eq!((clean.verdict, names(&clean)), (Verdict::EffectMissing, vec!["large"]));
    let steps = |diagnosis: &Diagnosis| diagnosis.ladder.iter().any(|step| step.step == "glitches left out");
    assert!(steps(&spoilt) && !steps(&clean), "{:?}", spoilt.ladder);
}

#[test]
fn an_error_that_nothing_explains_is_not_left_out_as_glitches() {
    let motion = |u: &[f64], log: usize, t: f64, finer: f64| {
        let unknown = if finer == NO_STEP { 1.2 * GLITCH } else { 0.0 };
        u[0] * swing(3.0, log, t) + 4.0 * u[1] * swing(5.0, log, t) + unknown * (31.0 * t).sin().powi(5)
    };
    let diagnosis = SyntheticModel::new(&["large"], &[0.4, 9.0], motion).diagnosis();
    assert!(matches!(diagnosis.verdict, Verdict::Unexplained | Verdict::PartlyExplained), "{:?}", diagnosis.verdict);
    assert!(diagnosis.ladder.iter().all(|step| step.step != "glitches left out"), "{:?}", diagnosis.ladder);
}

/// The state in which a search ends is told alike, whatever ended it and when.
#[test]
fn a_verdict_does_not_depend_on_where_in_a_round_the_search_is_stopped() {
    // The size of an effect is twice as large in the log that shows it least, and something else is left.
    let motion = |u: &[f64], log: usize, t: f64, finer: f64| {
        let reach = if log == 0 { 0.45 } else { 1.0 };
        let size = if finer == NO_STEP && log == 0 { 2.0 * reach } else { reach };
        let unknown = if finer == NO_STEP { 1.2 * (31.0 * t).sin().powi(5) } else { 0.0 };
        u[0] * swing(3.0, log, t)
            + size * u[1] * swing(5.0, log, t)
            + u[2] * swing(7.0, log, t)
            + u[3] * swing(11.0, log, t)
            + unknown
    };
    let model = SyntheticModel::new(&["large", "small", "none"], &[0.4, 2.0, 1.0, 0.0], motion);
    let mut told: Vec<(usize, Verdict, Vec<bool>)> = Vec::new();
    for calls in (0..400).step_by(3) {
        let asked = AtomicUsize::new(0);
        let signal = Arc::new(move || asked.fetch_add(1, Ordering::Relaxed) >= calls);
        let mut objective = Objective::new(&model).stopping_when(signal);
        let stopped = diagnose(&mut objective, DiagnoseOptions::default(), &|_| ()).unwrap();
        let established = stopped.effects.iter().map(|found| found.evidence.established).collect();
        told.push((stopped.effects.len(), stopped.verdict, established));
    }
    told.dedup();
    assert!(told.windows(2).all(|pair| pair[0].0 < pair[1].0), "{told:?}");
    let unstable = told.iter().filter(|(found, _, established)| *found > 0 && !established[0]);
    assert!(unstable.count() > 0, "{told:?}");
}
