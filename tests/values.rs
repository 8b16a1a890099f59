//! A value that the model states wrongly is named as a value, with what the logs show.
#![allow(clippy::unwrap_used)]

use btr_core::log::{Log, Role};
use btr_identify::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use btr_identify::fit::Objective;
use btr_identify::residual_model::CandidateKind;
use btr_lab::experiment::{Source, model};
use btr_lab::identification::IdentificationProblem;
use btr_physics::drive::Replay;
use btr_physics::model::parameter::Target;
use btr_physics::model::{Model, Scenario};
use btr_physics::rollout::{RolloutRequest, simulate};
use std::path::Path;
use std::sync::Arc;

/// A rotor inertia that the model states for all joints.
const ROTORS: &str = "\n[[effects]]\neffect = \"armature\"\nsite = \"*\"\ninertia = 0.012\n";

/// The desk arm with rotors, whose parameter `known` is not free.
fn arm(known: &str) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../robots/arm.toml");
    let source = Source::read(&path).unwrap();
    let lines = source.text.lines().filter(|line| !line.starts_with(&format!("\"{known}\"")));
    let text = lines.collect::<Vec<_>>().join("\n") + ROTORS;
    model(&Source { text, ..source }).unwrap()
}

/// Four seconds of commands, other ones for each episode and joint.
fn scenario(model: &Model, episode: usize) -> Scenario {
    let clock: Vec<f64> = (0..=400).map(|i| f64::from(i) * 0.01).collect();
    let mut commands = Log::new(clock.clone()).unwrap();
    for (k, (_, link)) in model.robot.movable().enumerate() {
        let rate = 2.0 + 1.3 * k as f64 + 0.7 * episode as f64;
        let wave = |t: &f64| 0.5 * (rate * t).sin() + 0.2 * (2.3 * rate * t).sin();
        let name = format!("cmd_{}", link.joint.name);
        commands.insert(name, "rad", Role::Command, clock.iter().map(wave).collect()).unwrap();
    }
    Scenario {
        name: format!("episode {episode}"),
        replay: Some(Arc::new(Replay::new(&commands, &model.robot))),
        duration_s: 4.0,
        ..Scenario::default()
    }
}

/// Diagnoses the arm with logs of one in which a value is another one.
fn diagnosis(name: &str, truth: f64) -> (IdentificationProblem, Diagnosis) {
    let mut model = Model { learn: 2, ..arm(name) };
    model.scenarios = (0..3).map(|episode| scenario(&model, episode)).collect();
    let target = Target::parse(name, &model.robot).unwrap();
    let record = |episode: usize| {
        let (mut robot, mut effects, mut setup) = model.at(&model.simulations.nominal(), episode);
        target.set(truth, &mut robot, &mut effects, &mut setup);
        let drive = model.scenarios[episode].replay.clone().unwrap();
        simulate(RolloutRequest::new(&robot, &drive).setup(&setup).effects(&effects).noise_seed(episode as u64))
    };
    let logs = (0..3).map(|episode| record(episode).unwrap()).collect();
    let problem = IdentificationProblem::new(Arc::new(model), logs, &[]).unwrap();
    let diagnosis = diagnose(&mut Objective::new(&problem), DiagnoseOptions::default(), &|_| {}).unwrap();
    (problem, diagnosis)
}

#[test]
fn a_wrong_value_is_named_with_what_the_logs_show() {
    let wrong = [
        ("armature.inertia@shoulder", 0.038, "armature@shoulder"),
        ("armature.inertia@*", 0.03, "armature@*"),
        ("mass@forearm", 0.2, "mass@forearm"),
        ("kp@elbow", 9.0, "kp@elbow"),
        ("length@upper", 1.05, "length@upper"),
    ];
    for (name, truth, candidate) in wrong {
        let (problem, diagnosis) = diagnosis(name, truth);
        let found: Vec<String> = diagnosis.effects.iter().map(|e| problem.candidates()[e.candidate].name()).collect();
        assert_eq!((diagnosis.verdict, found), (Verdict::ValueWrong, vec![candidate.to_owned()]), "{name}");
        assert_eq!(diagnosis.effects[0].kind, CandidateKind::Value);
        let estimate = &diagnosis.effects[0].parameters[0];
        let [low, high] = estimate.ci95.unwrap();
        let width = high - low;
        assert!(estimate.name == name && low - width < truth && truth < high + width, "{estimate:?}");
        assert!(diagnosis.effects[0].evidence.established);
    }
}

#[test]
fn right_values_are_not_suspected() {
    let (_, diagnosis) = diagnosis("kp@elbow", 12.0);
    assert_eq!((diagnosis.verdict, diagnosis.effects.len()), (Verdict::NothingMissing, 0));
}
