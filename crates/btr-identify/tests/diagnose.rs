//! The diagnosis of synthetic models, each with one difficulty of real ones.
#![allow(clippy::unwrap_used)]

use btr_core::random::stream;
use btr_core::world::WorldError;
use btr_identify::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use btr_identify::fit::Objective;
use btr_identify::residual_model::{
    CandidateKind, Derivation, EffectCandidate, FitParameter, MeasuredChannel, ModelDescription, Needs,
    Parametrisation, RecordedLog, ResidualModel, ResidualRequest, TimeStep,
};
use rand::RngExt;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

const SAMPLES: usize = 400;
const PERIOD_S: f64 = 0.01;

type Motion = dyn Fn(&[f64], usize, f64, f64) -> f64 + Send + Sync;

/// Two training logs and a held-out one, of one channel with a noise of 1.
#[derive(Clone)]
struct SyntheticModel {
    parameters: Vec<FitParameter>,
    candidates: Vec<EffectCandidate>,
    logs: Vec<RecordedLog>,
    measured: Vec<Vec<f64>>,
    contact: bool,
    /// Number of samples of a log's beginning, where that can be predicted and the rest cannot.
    beginning: Option<usize>,
    /// The noiseless measurement as a function of coordinates, log, time in s, and divisor of the time step.
    motion: Arc<Motion>,
}

/// Divisor of the time step for which the integrator's error vanishes.
const NO_STEP: f64 = 1e9;

impl SyntheticModel {
    /// A model with a free gain and effects of one amplitude each, whose true coordinates are `truth`.
    fn new(
        effects: &[&str],
        truth: &[f64],
        motion: impl Fn(&[f64], usize, f64, f64) -> f64 + Send + Sync + 'static,
    ) -> Self {
        Self::with_logs_of(SAMPLES, effects, truth, motion)
    }

    /// The same with logs of that many samples.
    fn with_logs_of(
        samples: usize,
        effects: &[&str],
        truth: &[f64],
        motion: impl Fn(&[f64], usize, f64, f64) -> f64 + Send + Sync + 'static,
    ) -> Self {
        let names = ["gain"].iter().chain(effects).enumerate();
        let parameters: Vec<FitParameter> = names.map(|(i, name)| parameter(name, i > 0)).collect();
        let candidate = |(i, name): (usize, &&str)| EffectCandidate {
            ripple: None,
            kind: CandidateKind::Effect,
            effect: (*name).to_owned(),
            site: "here".to_owned(),
            amplitudes: vec![i + 1],
            shapes: Vec::new(),
            starts: vec![Vec::new()],
            similar: Vec::new(),
            nested: Vec::new(),
            needs: Needs::Nothing,
        };
        let log = |i: usize| RecordedLog {
            name: format!("log {i}"),
            held_out: i == 2,
            channels: vec![MeasuredChannel {
                name: "q".to_owned(),
                unit: "rad".to_owned(),
                sigma: 1.0,
                samples: 0..samples,
            }],
            present: samples,
        };
        // The sum of twelve uniform numbers has a variance of one.
        let noise = |log: usize, i: usize| {
            let mut rng = stream(7, &[log as u64, i as u64]);
            (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
        };
        let measured = |log: usize| {
            (0..samples).map(|i| motion(truth, log, i as f64 * PERIOD_S, NO_STEP) + noise(log, i)).collect()
        };
        SyntheticModel {
            parameters,
            candidates: effects.iter().enumerate().map(candidate).collect(),
            logs: (0..3).map(log).collect(),
            measured: (0..3).map(measured).collect(),
            contact: false,
            beginning: None,
            motion: Arc::new(motion),
        }
    }

    fn diagnosis(&self) -> Diagnosis {
        diagnose(&mut Objective::new(self), DiagnoseOptions::default(), &|_| ()).unwrap()
    }
}

fn parameter(name: &str, amplitude: bool) -> FitParameter {
    let (bounds, spread) = if amplitude { ((-40.0, 40.0), 30.0) } else { ((-3.0, 3.0), 1.0) };
    let (name, unit) = (name.to_owned(), "1".to_owned());
    FitParameter {
        name,
        unit,
        origin: 0.0,
        size: 1.0,
        law: Parametrisation::Linear,
        bounds,
        spread,
        reach: 0.1,
        amplitude,
    }
}

impl ResidualModel for SyntheticModel {
    fn description(&self) -> ModelDescription {
        ModelDescription {
            free: vec![0],
            candidates: self.candidates.clone(),
            has_contact: self.contact,
            ..ModelDescription::new(self.parameters.clone(), self.logs.clone())
        }
    }

    fn residuals(&self, requests: &[ResidualRequest], step: TimeStep) -> Vec<Result<Vec<f64>, WorldError>> {
        let finer = f64::from(step.divides_by());
        let residual = |&ResidualRequest { u, log, .. }: &ResidualRequest| {
            let simulated = (0..self.logs[log].rows()).map(|i| (self.motion)(u, log, i as f64 * PERIOD_S, finer));
            Ok(self.measured[log].iter().zip(simulated).map(|(measured, simulated)| measured - simulated).collect())
        };
        requests.iter().map(residual).collect()
    }

    fn derive(&self, derivation: &Derivation) -> Option<Box<dyn ResidualModel>> {
        let Derivation::Beginnings = derivation else { return None };
        let mut short = SyntheticModel { beginning: None, ..self.clone() };
        for log in &mut short.logs {
            log.channels[0].samples.end = self.beginning?;
            log.present = self.beginning?;
        }
        Some(Box::new(short))
    }
}

fn names(diagnosis: &Diagnosis) -> Vec<&str> {
    diagnosis.effects.iter().map(|found| found.effect.as_str()).collect()
}

/// A sine with a different phase for each log.
fn swing(rate: f64, log: usize, t: f64) -> f64 {
    (rate * t + 2.0 * log as f64).sin()
}

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
        let channel = |k: usize| MeasuredChannel { samples: k * length..(k + 1) * length, ..log.channels[0].clone() };
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

const DECOYS: usize = 40;

/// Many decoy effects that seem to explain more of the training logs than the lift does, and nothing of the held-out
/// log, and the true effect: a lift of `size` typical sizes, whose response is nine times `response` of its size.
fn among_decoys(size: f64, response: fn(f64) -> f64) -> SyntheticModel {
    let motion = move |u: &[f64], log: usize, t: f64, _: f64| {
        let share = if log == 2 { 0.0 } else { 0.8 };
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
