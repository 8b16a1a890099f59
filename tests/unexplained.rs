//! What a diagnosis says beyond names: the law that an unknown error follows, and the experiment that tells rivals
//! apart.
#![allow(clippy::unwrap_used, clippy::panic)]

use btr_identify::diagnose::{Diagnosis, RivalPoint, Verdict};
use btr_lab::identification::IdentificationProblem;
use btr_lab::verbs::{NextExperiment, next_experiment};
use btr_physics::effects::{EFFECTS, FormulaTarget, PlacedEffect, find, formula};
use btr_physics::model::Model;
use btr_physics::robot::Actuator;
use btr_tests::planted::{Planted, Waves, arm, diagnosis, names, problem as planted_problem};

/// The arm with logs of what it does with `hidden` in it.
fn problem(hidden: &[PlacedEffect], without: &[&str]) -> IdentificationProblem {
    problem_of(arm(str::to_owned), hidden, without)
}

/// A model with logs of what it does with `hidden` in it.
fn problem_of(model: Model, hidden: &[PlacedEffect], without: &[&str]) -> IdentificationProblem {
    let planted = Planted { effects: hidden.to_vec(), ..Planted::default() };
    planted_problem(model, Waves { seconds: 3, amplitude_rad: 0.45, steps_rad: 0.0 }, &planted, without)
}

/// A diagnosis that knows no effects, so that there is only the law.
fn asked(hidden: &[PlacedEffect]) -> (IdentificationProblem, Diagnosis) {
    asked_of(arm(str::to_owned), hidden)
}

fn asked_of(model: Model, hidden: &[PlacedEffect]) -> (IdentificationProblem, Diagnosis) {
    let values = ["mass", "inertia", "length", "origin", "tilt", "kp", "ki", "kd", "max_torque"];
    let names: Vec<&str> = EFFECTS.iter().map(|effect| effect.spec().name).chain(values).collect();
    let problem = problem_of(model, hidden, &names);
    let diagnosis = diagnosis(&problem);
    (problem, diagnosis)
}

fn planted(site: &str, law: &str) -> PlacedEffect {
    PlacedEffect {
        effect: formula(FormulaTarget::Torque, law, &[]).unwrap(),
        site: site.to_owned(),
        values: Vec::new(),
    }
}

#[test]
fn a_law_that_is_no_effect_is_told_with_its_joint() {
    let laws = [
        // The frequency is a fitted number: right to half a percent.
        ("elbow", "0.2*sin(19*t)", ["sin(18.9", "sin(19*", "sin(19.0"]),
        ("shoulder", "-1.2*dq*max(0,q)", ["dq*max(0,q)"; 3]),
        ("yaw", "-0.4*dq*abs(dq)", ["dq*abs(dq)"; 3]),
    ];
    for (joint, law, parts) in laws {
        let (problem, diagnosis) = asked(&[planted(joint, law)]);
        assert_eq!(diagnosis.verdict, Verdict::Unexplained);
        let found = diagnosis.residual_law.unwrap();
        let (site, _, text) = problem.law(&found).unwrap();
        let named = parts.iter().any(|part| text.contains(part));
        assert!(site == joint && named && found.explains > 0.8, "{law}: {text} {}", found.explains);
        assert!(diagnosis.rollouts < 1500, "{}", diagnosis.rollouts);
    }
}

/// The arm with an integral part in each servo, so that a law on a command is not one on a torque.
fn integrating_arm() -> Model {
    let mut model = arm(str::to_owned);
    for link in &mut model.robot.links {
        if let Actuator::Position { ki, .. } = &mut link.joint.actuator {
            *ki = 60.0;
        }
    }
    model
}

#[test]
fn a_coupling_of_neighbouring_joints_is_told_with_its_coefficient() {
    let cases = [
        (arm(str::to_owned), "shoulder", FormulaTarget::Torque, "-2*q_child"),
        (arm(str::to_owned), "elbow", FormulaTarget::Torque, "-0.15*dq_parent"),
        (integrating_arm(), "elbow", FormulaTarget::Command, "cmd + 0.2*q_parent"),
    ];
    for (model, joint, on, law) in cases {
        let effect = formula(on, law, &[]).unwrap();
        let hidden = PlacedEffect { effect, site: joint.to_owned(), values: Vec::new() };
        let (problem, diagnosis) = asked_of(model, &[hidden]);
        let found = diagnosis.residual_law.unwrap();
        let (site, target, text) = problem.law(&found).unwrap();
        assert!((&*site, target) == (joint, on) && found.explains > 0.9, "{law}: {text} {}", found.explains);
        let ([planted, variable], [fitted, named]) = (parts(law), parts(&text));
        let ratio = fitted.parse::<f64>().unwrap() / planted.parse::<f64>().unwrap();
        assert!(variable == named && (ratio - 1.0).abs() < 0.05, "{law}: {text}");
    }
}

/// Coefficient and variable of a law of one term.
fn parts(law: &str) -> [String; 2] {
    let term = law.strip_prefix("cmd").unwrap_or(law).replace(' ', "");
    let (coefficient, variable) = term.split_once('*').unwrap();
    [coefficient.to_owned(), variable.to_owned()]
}

#[test]
fn nothing_is_read_into_noise() {
    let (_, diagnosis) = asked(&[]);
    assert_eq!(diagnosis.verdict, Verdict::NothingMissing);
    assert!(diagnosis.residual_law.is_none());
}

#[test]
fn the_law_is_the_same_for_any_number_of_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (problem, diagnosis) = pool.install(|| asked(&[planted("elbow", "-0.5*q*q*dq")]));
        let law = diagnosis.residual_law.unwrap();
        (problem.law(&law).unwrap(), law.explains.to_bits(), diagnosis.rollouts)
    };
    assert_eq!(run(1), run(3));
}

/// The experiment for frictions at the elbow: Coulomb's, and those of `rivals`.
fn frictions(rivals: &[(&str, &[(&str, f64)])]) -> Option<NextExperiment> {
    let problem = problem(&[], &[]);
    let rival = |effect: &str, values: &[(&str, f64)]| {
        let candidate = problem.candidates().iter().position(|c| c.effect == effect && c.site == "elbow").unwrap();
        let mut u = vec![0.0; problem.parameters().len()];
        for (name, value) in values {
            let name = format!("{effect}.{name}@elbow");
            let k = problem.parameters().iter().position(|parameter| parameter.name == name).unwrap();
            u[k] = problem.parameters()[k].coordinate(*value);
        }
        RivalPoint { candidate, u }
    };
    let all = [&[("coulomb_friction", &[("torque", 0.28)][..])], rivals].concat();
    next_experiment(&problem, &all.into_iter().map(|(effect, values)| rival(effect, values)).collect::<Vec<_>>())
        .unwrap()
}

/// Much like it.
const STRIBECK: (&str, &[(&str, f64)]) =
    ("stribeck_friction", &[("coulomb", 0.27), ("static", 0.45), ("velocity", 0.1)]);
/// The same in all that can be measured.
const ALIKE: (&str, &[(&str, f64)]) = ("asymmetric_friction", &[("coulomb_forward", 0.28), ("coulomb_backward", 0.28)]);

#[test]
fn the_next_experiment_tells_two_frictions_better_than_the_logs_did() {
    let next = frictions(&[STRIBECK]).unwrap();
    assert!(next.separation > 2.0 * next.separation_so_far && next.separation > 2.0, "{}", next.sentence);
    assert_eq!(next.rivals[0].effect, "stribeck_friction@elbow");
    assert!(next.joints.contains(&"elbow".to_owned()), "{}", next.sentence);
    let commands = next.commands.unwrap();
    // Nowhere beyond what the logs were told.
    for (name, channel) in commands.channels() {
        assert!(channel.values.iter().all(|x| x.is_nan() || x.abs() <= 0.65), "{name}");
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(pool.install(|| frictions(&[STRIBECK])).unwrap().sentence, next.sentence);
}

#[test]
fn an_experiment_claims_no_more_than_it_tells() {
    assert_eq!(frictions(&[ALIKE]), None);
    let next = frictions(&[STRIBECK, ALIKE]).unwrap();
    let (sentence, told, alike) = (&next.sentence, &next.rivals[0], &next.rivals[1]);
    let least = format!("and stribeck_friction@elbow then differ by at least {:.1} noise floors", told.separation);
    assert!(sentence.contains(&least), "{sentence}");
    assert!(sentence.ends_with("; this does not distinguish it from asymmetric_friction@elbow."), "{sentence}");
    assert!(next.separation.to_bits() == told.separation.to_bits() && told.separation > 2.0, "{sentence}");
    assert!(alike.separation < 0.3, "{sentence}");
}

#[test]
fn there_is_no_experiment_where_nothing_is_to_be_told_apart() {
    let problem = problem(&[], &[]);
    let only = RivalPoint { candidate: 0, u: vec![0.0; problem.parameters().len()] };
    assert_eq!(next_experiment(&problem, &[only]).unwrap(), None);
}

/// A servo that keeps its goal until the command has moved by more than a band is told as that, and as no friction.
#[test]
fn a_goal_that_is_held_is_no_friction() {
    let effect = find("command_hysteresis").unwrap();
    let hidden = PlacedEffect { effect, site: "elbow".to_owned(), values: vec![0.03] };
    let problem = problem(&[hidden], &[]);
    let diagnosis = diagnosis(&problem);
    assert_eq!(diagnosis.verdict, Verdict::EffectMissing);
    assert_eq!(names(&problem, &diagnosis), ["command_hysteresis@elbow"]);
}
