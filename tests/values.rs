//! A value that the model states wrongly is named as a value, with what the logs show.
#![allow(clippy::unwrap_used)]

use btr_identify::diagnose::{Diagnosis, Verdict};
use btr_identify::residual_model::CandidateKind;
use btr_lab::identification::IdentificationProblem;
use btr_tests::planted::{Planted, Waves, arm, diagnosis, names, problem};

/// A rotor inertia that the model states for all joints.
const ROTORS: &str = "\n[[effects]]\neffect = \"armature\"\nsite = \"*\"\ninertia = 0.012\n";

/// Diagnoses the arm, with rotors and with its parameter `name` not free, with logs of one in which that value is
/// another one.
fn with_a_wrong_value(name: &'static str, truth: f64) -> (IdentificationProblem, Diagnosis) {
    let fixed = |text: &str| {
        let lines = text.lines().filter(|line| !line.starts_with(&format!("\"{name}\"")));
        lines.collect::<Vec<_>>().join("\n") + ROTORS
    };
    let planted = Planted { values: vec![(name, truth)], ..Planted::default() };
    let problem = problem(arm(fixed), Waves { seconds: 4, amplitude_rad: 0.5, steps_rad: 0.0 }, &planted, &[]);
    let diagnosis = diagnosis(&problem);
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
        let (problem, diagnosis) = with_a_wrong_value(name, truth);
        let found = names(&problem, &diagnosis);
        assert_eq!((diagnosis.verdict, found), (Verdict::ValueWrong, vec![candidate.to_owned()]), "{name}");
        assert_eq!(diagnosis.effects[0].kind, CandidateKind::Value);
        let estimate = &diagnosis.effects[0].parameters[0];
        let [low, high] = estimate.ci95.unwrap();
        let width = high - low;
        assert!(estimate.name == name && low - width < truth && truth < high + width, "{estimate:?}");
        assert!(diagnosis.effects[0].evidence.established);
    }
}

/// A joint that counts the other way round than the robot's file says, in readings and commands.
#[test]
fn a_joint_that_counts_the_other_way_round_is_named() {
    for joint in ["shoulder", "elbow"] {
        let planted = Planted { values: vec![(&format!("direction@{joint}").leak()[..], -1.0)], ..Planted::default() };
        let waves = Waves { seconds: 4, amplitude_rad: 0.5, steps_rad: 0.0 };
        let problem = problem(arm(str::to_owned), waves, &planted, &[]);
        let diagnosis = diagnosis(&problem);
        let found = names(&problem, &diagnosis);
        assert_eq!((diagnosis.verdict, found), (Verdict::ValueWrong, vec![format!("direction@{joint}")]));
        let estimate = &diagnosis.effects[0].parameters[0];
        assert!((estimate.value + 1.0).abs() < 1e-12 && estimate.ci95.is_none() && !estimate.at_bound, "{estimate:?}");
    }
}

#[test]
fn right_values_are_not_suspected() {
    let (_, diagnosis) = with_a_wrong_value("kp@elbow", 12.0);
    assert_eq!((diagnosis.verdict, diagnosis.effects.len()), (Verdict::NothingMissing, 0));
}
