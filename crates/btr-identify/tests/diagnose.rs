//! The diagnosis beside made-up worlds, each with one thing that is awkward about real ones.
#![allow(clippy::unwrap_used)]

use btr_core::random::stream;
use btr_core::world::WorldError;
use btr_identify::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use btr_identify::fit::Objective;
use btr_identify::residual_model::{
    Derivation, EffectCandidate, FitParameter, MeasuredChannel, ModelDescription, Parametrisation, RecordedLog,
    ResidualModel, ResidualRequest, TimeStep,
};
use rand::RngExt;
use std::sync::Arc;

const SAMPLES: usize = 400;
const PERIOD_S: f64 = 0.01;

type Motion = dyn Fn(&[f64], usize, f64, f64) -> f64 + Send + Sync;

/// Two logs to learn from and one to judge on, of one channel with a noise of 1.
#[derive(Clone)]
struct Made {
    parameters: Vec<FitParameter>,
    candidates: Vec<EffectCandidate>,
    logs: Vec<RecordedLog>,
    measured: Vec<Vec<f64>>,
    contact: bool,
    /// How many samples are the beginning of a log, which can be foretold where the rest cannot.
    beginning: Option<usize>,
    /// What is measured at a point, without noise: coordinates, log, time in s, and by what the time step is divided.
    motion: Arc<Motion>,
}

/// Divides the time step by so much that nothing is left of it.
const NO_STEP: f64 = 1e9;

impl Made {
    /// A world with a gain in doubt and effects of one amplitude each, which really stand where `truth` says.
    fn new(
        effects: &[&str],
        truth: &[f64],
        motion: impl Fn(&[f64], usize, f64, f64) -> f64 + Send + Sync + 'static,
    ) -> Self {
        let names = ["gain"].iter().chain(effects).enumerate();
        let parameters: Vec<FitParameter> = names.map(|(i, name)| parameter(name, i > 0)).collect();
        let candidate = |(i, name): (usize, &&str)| EffectCandidate {
            effect: (*name).to_owned(),
            site: "here".to_owned(),
            amplitudes: vec![i + 1],
            shapes: Vec::new(),
            starts: vec![Vec::new()],
            similar: Vec::new(),
            nested: Vec::new(),
        };
        let log = |i: usize| RecordedLog {
            name: format!("log {i}"),
            held_out: i == 2,
            channels: vec![MeasuredChannel {
                name: "q".to_owned(),
                unit: "rad".to_owned(),
                sigma: 1.0,
                samples: 0..SAMPLES,
            }],
            present: SAMPLES,
        };
        // Twelve evenly distributed numbers have a variance of one.
        let noise = |log: usize, i: usize| {
            let mut rng = stream(7, &[log as u64, i as u64]);
            (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
        };
        let measured = |log: usize| {
            (0..SAMPLES).map(|i| motion(truth, log, i as f64 * PERIOD_S, NO_STEP) + noise(log, i)).collect()
        };
        Made {
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

impl ResidualModel for Made {
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
        let mut short = Made { beginning: None, ..self.clone() };
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

/// A swing of its own for each log.
fn swing(rate: f64, log: usize, t: f64) -> f64 {
    (rate * t + 2.0 * log as f64).sin()
}

#[test]
fn what_shows_on_one_side_only_is_found_there() {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        u[0] * swing(3.0, log, t) + 4.0 * (-u[1]).max(0.0) * swing(5.0, log, t) + u[2] * swing(7.0, log, t)
    };
    let made = Made { contact: true, ..Made::new(&["lift", "tilt"], &[0.4, -1.5, 0.0], motion) };
    let diagnosis = made.diagnosis();
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["lift"]));
    assert!((diagnosis.fit.u[1] + 1.5).abs() < 0.1, "{:?}", diagnosis.fit.u);
}

#[test]
fn what_is_many_times_its_usual_size_is_found_where_the_way_there_is_no_straight_line() {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        u[0] * swing(3.0, log, t) + u[1] * swing(5.0, log, t + 0.05 * u[1]) + 0.2 * u[2] * swing(5.5, log, t)
    };
    let diagnosis = Made::new(&["offset", "tilt"], &[0.4, -23.0, 0.0], motion).diagnosis();
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["offset"]));
    assert!((diagnosis.fit.u[1] + 23.0).abs() < 0.1, "{:?}", diagnosis.fit.u);
}

#[test]
fn a_step_too_coarse_for_the_held_out_log_alone_is_made_finer() {
    // The error falls with the step, but half the step does not tell where it goes.
    let motion = |u: &[f64], log: usize, t: f64, finer: f64| {
        let of_the_step = if log == 2 { 1.5 / finer * swing(4.0 + finer.min(8.0), log, t) } else { 0.0 };
        u[0] * swing(3.0, log, t) + of_the_step + 4.0 * u[1] * swing(5.0, log, t)
    };
    let diagnosis = Made::new(&["tilt"], &[0.4, 0.0], motion).diagnosis();
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::NothingMissing, vec![]));
    assert!(diagnosis.integrator_error > 0.2, "{}", diagnosis.integrator_error);
}

#[test]
fn what_tips_over_is_explained_by_how_it_began() {
    // Once it tips, every number decides how it falls.
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        let began = u[0] * swing(3.0, log, t) + 4.0 * u[1] * swing(5.0, log, t) + 4.0 * u[2] * swing(7.0, log, t);
        let tipped = 20.0 * (swing(9.0, log, t + 3.0 * (u[0] + u[1] + u[2])) - swing(9.0, log, 1.2));
        began + if t > 1.2 { tipped } else { 0.0 }
    };
    let whole = Made::new(&["lift", "tilt"], &[0.4, 0.0, 1.5], motion);
    assert_ne!(whole.diagnosis().verdict, Verdict::EffectMissing, "the whole tells nothing from where it stands");
    let diagnosis = Made { beginning: Some(120), ..whole }.diagnosis();
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["tilt"]));
    assert!((diagnosis.fit.u[2] - 1.5).abs() < 0.1, "{:?}", diagnosis.fit.u);
}

#[test]
fn intervals_on_the_ground_are_as_wide_as_channels_differ() {
    // What no model has: a foot came down a little elsewhere, and each channel is off by as much or as little from then on.
    let motion = |u: &[f64], log: usize, t: f64, finer: f64| {
        let channel = (t * CHANNELS as f64 / (SAMPLES as f64 * PERIOD_S)) as usize;
        let off = if finer < NO_STEP { 0.0 } else { 0.4 * (2.0 * (channel * channel + log) as f64).sin() };
        u[0] * swing(1.0, log, t) + 4.0 * u[1] * swing(2.0, log, t) + off
    };
    const CHANNELS: usize = 8;
    let mut air = Made::new(&["tilt"], &[0.4, 1.5], motion);
    for log in &mut air.logs {
        let each = SAMPLES / CHANNELS;
        let channel = |k: usize| MeasuredChannel { samples: k * each..(k + 1) * each, ..log.channels[0].clone() };
        log.channels = (0..CHANNELS).map(channel).collect();
    }
    let ground = Made { contact: true, ..air.clone() };
    let width = |made: &Made| {
        let [low, high] = made.diagnosis().effects[0].parameters[0].ci95.unwrap();
        assert!(low < 1.5 && 1.5 < high || !made.contact, "{low} {high}");
        high - low
    };
    let (air, ground) = (width(&air), width(&ground));
    assert!(ground > 1.3 * air, "{ground} {air}");
}

#[test]
fn what_is_one_and_the_same_is_called_by_the_librarys_first_name() {
    // Where the first is off by less than anybody could tell, the second fits a little better.
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        u[0] * swing(3.0, log, t) + 4.0 * u[1] * swing(5.0, log, t + 0.0015) + 4.0 * u[2] * swing(5.0, log, t)
    };
    for truth in [[0.4, 1.5, 0.0], [0.4, 0.0, 1.5]] {
        let diagnosis = Made::new(&["lift", "tilt"], &truth, motion).diagnosis();
        assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::EffectMissing, vec!["lift"]));
        assert_eq!(diagnosis.effects[0].alike, ["tilt@here"]);
    }
}

/// A law and one that has another term of this size beside the same.
fn with_a_larger_law(term: f64) -> Diagnosis {
    let motion = |u: &[f64], log: usize, t: f64, _: f64| {
        u[0] * swing(3.0, log, t) + 4.0 * (u[1] + u[2]) * swing(5.0, log, t) + u[3] * swing(11.0, log, t)
    };
    let mut made = Made::new(&["plain", "larger", "term"], &[0.4, 0.0, 1.5, term], motion);
    made.candidates.truncate(2);
    made.candidates[1].amplitudes.push(3);
    (made.candidates[0].similar, made.candidates[1].similar) = (vec![1], vec![0]);
    made.candidates[1].nested = vec![0];
    made.diagnosis()
}

#[test]
fn a_larger_law_must_earn_its_numbers() {
    let diagnosis = with_a_larger_law(0.25);
    let found = &diagnosis.effects[0];
    let first = &diagnosis.rounds[0];
    assert!(first[0].name == "larger@here" && first[0].delta_bic - first[1].delta_bic > 10.0, "{first:?}");
    assert_eq!((names(&diagnosis), &*found.alike), (vec!["plain"], &["larger@here".to_owned()][..]));
    assert!(found.probability > 0.99, "{}", found.probability);
    assert_eq!(names(&with_a_larger_law(0.7)), ["larger"]);
}

const PRETENDERS: usize = 40;

/// Many who seem to know more of the first two logs than a lift does, and nothing of the one to judge on; and that
/// lift, so many times its usual size, which is what is there: nine times what this makes of its size.
fn beside_pretenders(times: f64, lifts: fn(f64) -> f64) -> Made {
    let motion = move |u: &[f64], log: usize, t: f64, _: f64| {
        let known = if log == 2 { 0.0 } else { 0.8 };
        let other = |i: usize| known * swing(5.0, log, t) + swing(20.0 + i as f64, log, t);
        let lift = 9.0 * lifts(u[PRETENDERS + 1]) * swing(5.0, log, t);
        u[0] * swing(3.0, log, t) + (1..=PRETENDERS).map(|i| u[i] * other(i)).sum::<f64>() + lift
    };
    let others: Vec<String> = (1..=PRETENDERS).map(|i| format!("other{i}")).collect();
    let effects: Vec<&str> = others.iter().map(String::as_str).chain(["lift"]).collect();
    let mut truth = vec![0.0; PRETENDERS + 2];
    truth[PRETENDERS + 1] = times;
    Made::new(&effects, &truth, motion)
}

#[test]
fn nothing_is_called_unexplained_before_everybody_was_tried() {
    for contact in [false, true] {
        let diagnosis = Made { contact, ..beside_pretenders(30.0, |u| u / 30.0) }.diagnosis();
        assert_eq!(
            (diagnosis.verdict, names(&diagnosis)),
            (Verdict::EffectMissing, vec!["lift"]),
            "contact: {contact}"
        );
    }
}

#[test]
fn on_the_ground_who_leads_and_leaves_much_is_tried_in_other_places() {
    // At all sizes that everybody is simulated with, this lift does less than the others seem to.
    let peak = |u: f64| (1.0 + ((u - 9.0) / 2.5).powi(2)).recip() - (1.0 + (9.0f64 / 2.5).powi(2)).recip();
    let mut made = Made { contact: true, ..beside_pretenders(9.0, peak) };
    assert_ne!(made.diagnosis().verdict, Verdict::EffectMissing, "nobody of the same name leads");
    for (place, candidate) in made.candidates.iter_mut().enumerate() {
        (candidate.effect, candidate.site) = ("payload".to_owned(), format!("place {place}"));
    }
    let diagnosis = made.diagnosis();
    let found = &diagnosis.effects[0];
    assert_eq!((diagnosis.verdict, &*found.site), (Verdict::EffectMissing, "place 40"));
}
