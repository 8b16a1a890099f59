//! Verdicts on robots that differ much from their model: what is named, and what is not.
#![allow(clippy::unwrap_used)]

use btr_identify::diagnose::{Diagnosis, Verdict};
use btr_identify::fit::Estimate;
use btr_lab::identification::IdentificationProblem;
use btr_physics::effects::{FormulaTarget, PlacedEffect, find, formula};
use btr_physics::model::Model;
use btr_tests::planted::{Planted, Waves, arm, diagnosis, names, problem};

const WAVES: Waves = Waves { seconds: 4, amplitude_rad: 0.5, steps_rad: 0.0 };

/// An effect with values in the order of its parameters.
fn effect(name: &str, site: &str, values: &[f64]) -> PlacedEffect {
    PlacedEffect { effect: find(name).unwrap(), site: site.to_owned(), values: values.to_vec() }
}

/// The diagnosis of a model with logs of a robot that has these effects as well.
fn diagnosed(model: Model, effects: Vec<PlacedEffect>) -> (IdentificationProblem, Diagnosis) {
    let problem = problem(model, WAVES, &Planted { effects, ..Planted::default() }, &[]);
    let diagnosis = diagnosis(&problem);
    (problem, diagnosis)
}

/// The desk arm.
fn desk_arm() -> Model {
    arm(str::to_owned)
}

/// Asserts that one effect is missing, and that it has this value.
fn assert_missing(
    found: &(IdentificationProblem, Diagnosis),
    name: &str,
    (parameter, truth): (&str, f64),
    within: f64,
) {
    let (problem, diagnosis) = found;
    let ladder: Vec<_> = diagnosis.ladder.iter().map(|step| (&step.step, step.train, step.held_out)).collect();
    assert_eq!(
        (diagnosis.verdict, names(problem, diagnosis)),
        (Verdict::EffectMissing, vec![name.to_owned()]),
        "{ladder:?}"
    );
    let value = estimate(diagnosis, parameter);
    assert!((value / truth - 1.0).abs() < within, "{value}");
    assert!(diagnosis.rollouts < 10_000, "{}", diagnosis.rollouts);
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
    let found = diagnosed(desk_arm(), vec![effect("torque_limit", "shoulder", &[1.1])]);
    let error = found.1.ladder[1].train;
    assert!(error > 100.0, "{error}");
    assert_missing(&found, "torque_limit@shoulder", ("torque_limit.torque@shoulder", 1.1), 0.01);
}

/// At the centre of mass a payload would be the twin of the link's mass, which is free.
#[test]
fn a_payload_at_the_tip_is_no_wrong_mass() {
    let found = diagnosed(desk_arm(), vec![effect("end_payload", "forearm", &[0.12])]);
    assert_missing(&found, "end_payload@forearm", ("end_payload.mass@forearm", 0.12), 0.03);
}

/// What a gripper holds, it holds somewhere: with its place, it is neither the forearm's mass nor its centre of mass.
#[test]
fn a_load_in_the_gripper_is_found_with_its_place() {
    let found = diagnosed(desk_arm(), vec![effect("tool_load", "forearm", &[0.1, 0.26, 0.0, 0.05])]);
    assert_missing(&found, "tool_load@forearm", ("tool_load.mass@forearm", 0.1), 0.15);
    // The same torque of weight by a lighter load that is farther out is told apart by its inertia alone.
    for (estimate, truth) in found.1.effects[0].parameters.iter().zip([0.1, 0.26, 0.0, 0.05]) {
        let [low, high] = estimate.ci95.unwrap();
        assert!((low..=high).contains(&truth), "{}: {low} to {high}", estimate.name);
    }
}

/// What a robot can carry does not depend on the mass of its last link.
#[test]
fn a_payload_may_outweigh_a_light_flange() {
    let mut model = desk_arm();
    let flange = model.robot.links.iter_mut().find(|link| link.name == "forearm").unwrap();
    flange.mass_kg = 0.05;
    flange.inertia_kg_m2 *= 0.05 / 0.35;
    let found = diagnosed(model, vec![effect("end_payload", "forearm", &[1.2])]);
    assert_missing(&found, "end_payload@forearm", ("end_payload.mass@forearm", 1.2), 0.02);
}

/// An elastic transmission is not told as a delay, and the rotor that the model knows is not in its way.
#[test]
fn elasticity_is_found_beside_a_known_rotor() {
    const ROTORS: &str = "\n[[effects]]\neffect = \"armature\"\nsite = \"*\"\ninertia = 0.012\n";
    let model = arm(|text| text.to_owned() + ROTORS);
    let found = diagnosed(model, vec![effect("joint_elasticity", "elbow", &[60.0, 0.02])]);
    assert_missing(&found, "joint_elasticity@elbow", ("joint_elasticity.stiffness@elbow", 60.0), 0.03);
}

/// Friction that grows over a range of speeds instead of jumping is dry friction, not a Stribeck curve upside down with
/// a delay beside it.
#[test]
fn regularised_friction_is_dry_friction() {
    let law = formula(FormulaTarget::Torque, "-0.2*tanh(dq/0.02)", &[]).unwrap();
    let planted = PlacedEffect { effect: law, site: "elbow".to_owned(), values: Vec::new() };
    let (problem, diagnosis) = diagnosed(desk_arm(), vec![planted]);
    let names = names(&problem, &diagnosis);
    let first = ["coulomb_friction@elbow", "presliding_friction@elbow"].contains(&names[0].as_str());
    let errors = diagnosis.ladder.last().unwrap();
    assert!(first && names[1..].iter().all(|name| name == "friction_creep@elbow"), "{names:?} {errors:?}");
    let torque = estimate(&diagnosis, &names[0].replace('@', ".torque@"));
    assert!((torque / 0.2 - 1.0).abs() < 0.05, "{torque}");
}

/// Dry friction as MuJoCo has it is told as dry friction and how it gives way, not as contacts that bend.
#[test]
fn creeping_friction_is_dry_friction_that_creeps() {
    let planted = vec![effect("coulomb_friction", "elbow", &[0.2]), effect("friction_creep", "elbow", &[0.1, 0.0095])];
    let (problem, diagnosis) = diagnosed(desk_arm(), planted);
    assert_eq!(names(&problem, &diagnosis), ["coulomb_friction@elbow", "friction_creep@elbow"]);
    assert_eq!(diagnosis.verdict, Verdict::EffectMissing);
    let all = diagnosis.effects.iter().flat_map(|found| &found.parameters);
    for (estimate, truth) in all.zip([0.2, 0.1, 0.0095]) {
        let [low, high] = estimate.ci95.unwrap();
        assert!(0.0 < low && (low..=high).contains(&truth) && high < 2.0 * truth, "{}: {low} to {high}", estimate.name);
    }
}

/// Where nothing creeps, Stribeck's friction fits best as Coulomb's; with its creep, it is found.
#[test]
fn stribeck_friction_that_creeps_is_found_with_its_creep() {
    let stribeck = effect("stribeck_friction", "elbow", &[0.15, 0.35, 0.3]);
    let (problem, diagnosis) = diagnosed(desk_arm(), vec![stribeck, effect("friction_creep", "elbow", &[0.3, 0.0095])]);
    let mut names = names(&problem, &diagnosis);
    names.sort_unstable();
    let ladder: Vec<_> = diagnosis.ladder.iter().map(|step| (&step.step, step.train)).collect();
    assert_eq!(names, ["friction_creep@elbow", "stribeck_friction@elbow"], "{ladder:?}");
    assert_eq!(diagnosis.verdict, Verdict::EffectMissing);
    for (name, truth) in [("coulomb", 0.15), ("static", 0.35), ("velocity", 0.3)] {
        let value = estimate(&diagnosis, &format!("stribeck_friction.{name}@elbow"));
        assert!((value / truth - 1.0).abs() < 0.1, "{name}: {value}");
    }
}

/// Contacts that bend before they slide need no creep.
#[test]
fn presliding_stays_presliding() {
    let found = diagnosed(desk_arm(), vec![effect("presliding_friction", "elbow", &[0.2, 15.0])]);
    assert_missing(&found, "presliding_friction@elbow", ("presliding_friction.torque@elbow", 0.2), 0.02);
}

/// A motor's ripple is faster than any that is tried beforehand.
#[test]
fn the_order_of_a_fast_ripple_comes_from_the_error() {
    let found = diagnosed(desk_arm(), vec![effect("cogging", "elbow", &[0.15, 28.0, 1.0])]);
    assert_missing(&found, "cogging@elbow", ("cogging.order@elbow", 28.0), 0.01);
}

/// Commands in steps are faster than the joint ever is.
#[test]
fn a_rate_limit_that_only_steps_reach_is_found() {
    let planted = Planted { effects: vec![effect("command_rate_limit", "elbow", &[15.0])], ..Planted::default() };
    let waves = Waves { steps_rad: 0.4, ..WAVES };
    let problem = problem(desk_arm(), waves, &planted, &[]);
    let diagnosis = diagnosis(&problem);
    let found = (problem, diagnosis);
    assert_missing(&found, "command_rate_limit@elbow", ("command_rate_limit.rate@elbow", 15.0), 0.03);
}

/// A servo that rounds its commands, and one that ignores small changes of them: no derivative leads to such a size.
#[test]
fn the_size_of_what_a_servo_makes_of_commands_comes_from_the_error() {
    let found = diagnosed(desk_arm(), vec![effect("command_resolution", "elbow", &[0.0307])]);
    assert_missing(&found, "command_resolution@elbow", ("command_resolution.step@elbow", 0.0307), 1e-3);
    let found = diagnosed(desk_arm(), vec![effect("command_hysteresis", "shoulder", &[0.025])]);
    assert_missing(&found, "command_hysteresis@shoulder", ("command_hysteresis.band@shoulder", 0.025), 1e-2);
}

/// Servos of one kind have one resolution.
#[test]
fn a_resolution_of_all_servos_is_one_finding() {
    let found = diagnosed(desk_arm(), vec![effect("command_resolution", "*", &[0.0205])]);
    assert_missing(&found, "command_resolution@*", ("command_resolution.step@*", 0.0205), 1e-3);
}

/// What ignores an error, not a change of the command, has no size in the commands.
#[test]
fn a_dead_band_of_the_error_is_no_hysteresis_of_the_command() {
    let found = diagnosed(desk_arm(), vec![effect("command_deadband", "elbow", &[0.03])]);
    assert_missing(&found, "command_deadband@elbow", ("command_deadband.band@elbow", 0.03), 0.02);
}

/// A motor's ripple has the orders of its poles, its slots and the stages of its gear at once.
#[test]
fn ripples_of_several_orders_are_found_on_one_joint() {
    let truth = [(0.15, 7.0, 1.0), (0.1, 28.0, -0.5), (0.1, 14.0, 0.3), (0.08, 12.0, 2.0), (0.08, 36.0, -2.0)];
    let planted: Vec<PlacedEffect> =
        truth.map(|(amplitude, order, phase)| effect("cogging", "elbow", &[amplitude, order, phase])).to_vec();
    let (problem, diagnosis) = diagnosed(desk_arm(), planted);
    let errors: Vec<f64> = diagnosis.ladder.iter().map(|step| step.train).collect();
    assert_eq!(
        names(&problem, &diagnosis),
        ["cogging@elbow", "cogging@elbow#2", "cogging@elbow#3", "cogging@elbow#4", "cogging@elbow#5"],
        "{errors:?}"
    );
    assert_eq!(diagnosis.verdict, Verdict::EffectMissing);
    let mut found: Vec<&Vec<Estimate>> = diagnosis.effects.iter().map(|effect| &effect.parameters).collect();
    found.sort_by(|a, b| a[1].value.total_cmp(&b[1].value));
    let by_order = [truth[0], truth[3], truth[2], truth[1], truth[4]];
    for (estimates, (amplitude, order, _)) in found.iter().zip(by_order) {
        for (estimate, truth) in estimates.iter().zip([amplitude, order]) {
            // Orders 12 and 14 can hardly be told apart on an arc of 1.4 rad: that is what the intervals say.
            let [low, high] = estimate.ci95.unwrap();
            let told = (estimate.value - truth).abs() < high - low && high - low < 0.3 * truth;
            assert!(told, "{truth}: {low} to {high} of {errors:?}");
        }
    }
}
