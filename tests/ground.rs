//! A robot with contact: what is planted in one of its legs is found, from a standing start in whole logs and else in
//! windows.
#![allow(clippy::unwrap_used)]

use btr_core::log::{Log, Role};
use btr_identify::diagnose::{DiagnoseOptions, Verdict, diagnose};
use btr_identify::fit::{LogSet, Objective, squares};
use btr_identify::residual_model::{Derivation, ResidualModel, ResidualRequest, TimeStep};
use btr_lab::experiment::{Source, model};
use btr_lab::identification::IdentificationProblem;
use btr_physics::drive::{Drive, Replay};
use btr_physics::effects::{EFFECTS, PlacedEffect, find};
use btr_physics::model::{Model, Scenario};
use btr_physics::presets::ant;
use btr_physics::robot::{JointKind, Link};
use btr_physics::rollout::{RolloutRequest, simulate};
use std::sync::Arc;

const MODEL: &str = r#"
name = "ant"
[robot]
builtin = "ant"
[simulation]
control_s = 0.01
steps_per_control = 8
sample_every = 8
[noise]
position_rad = 0.0005
gyro_rad_s = 0.01
[parameters]
"mass@trunk" = { relative = [0.75, 1.33] }
"#;

/// A tripod gait of its own in each episode, which grows from the stance; it is known where the joints begin if the
/// robot stands first.
fn scenario(model: &Model, episode: usize, stands: bool) -> Scenario {
    let clock: Vec<f64> = (0..=140).map(|i| f64::from(i) * 0.01).collect();
    let mut gait = ant::tripod();
    gait.omega_rad_s *= 0.8 + 0.2 * episode as f64;
    let mut told = Log::new(clock.clone()).unwrap();
    let mut command = vec![0.0; ant::centres().len()];
    for (joint, (_, link)) in model.robot.movable().enumerate() {
        let stance = ant::centres()[joint];
        let mut at = |t: f64| {
            gait.command(t, &mut command);
            stance + (t / 0.3).min(1.0) * (command[joint] - stance)
        };
        let row = clock.iter().map(|&t| at(t)).collect();
        told.insert(format!("cmd_{}", link.joint.name), "rad", Role::Command, row).unwrap();
    }
    let replay = Some(Arc::new(Replay::new(&told, &model.robot)));
    let start = if stands { command_at_rest(&told, model) } else { Vec::new() };
    Scenario { name: format!("episode {episode}"), replay, duration_s: 1.4, start, ..Scenario::default() }
}

/// The first commands, and no velocity.
fn command_at_rest(told: &Log, model: &Model) -> Vec<(f64, f64)> {
    let first = |name: &str| (told.values(&format!("cmd_{name}")).unwrap()[0], 0.0);
    model.robot.movable().map(|(_, link)| first(&link.joint.name)).collect()
}

/// What is found where `hidden` is, among friction on any joint. The robot stood for so many seconds, or is said to be
/// under way.
fn found(hidden: &[PlacedEffect], stood_s: Option<f64>) -> (Verdict, Vec<String>) {
    let source = Source::new("ant.toml", MODEL);
    let mut model = Model { learn: 1, ..model(&source).unwrap() };
    model.scenarios = (0..2).map(|episode| scenario(&model, episode, stood_s.is_some())).collect();
    let heavier: Vec<f64> = model.simulations.nominal().iter().map(|mass| 1.1 * mass).collect();
    let record = |episode: usize| {
        let (robot, mut effects, mut setup) = model.at(&heavier, episode);
        effects.extend_from_slice(hidden);
        // Finer than any step that a diagnosis may take.
        setup.dt_s /= 6.0;
        setup.rest_s = stood_s.unwrap_or(0.0);
        let drive = model.scenarios[episode].replay.clone().unwrap();
        simulate(RolloutRequest::new(&robot, &drive).setup(&setup).effects(&effects).noise_seed(episode as u64))
            .unwrap()
    };
    let logs = (0..2).map(record).collect();
    let names = EFFECTS.iter().map(|effect| effect.spec().name);
    let without: Vec<&str> = names.filter(|name| *name != "coulomb_friction").collect();
    let problem = IdentificationProblem::new(Arc::new(model), logs, &without).unwrap();
    assert_eq!(problem.is_chaotic(), stood_s.is_none(), "whole logs from a standing start, windows else");
    let diagnosis = diagnose(
        &mut Objective::new(&problem),
        DiagnoseOptions { max_effects: 1, ..DiagnoseOptions::default() },
        &|_| (),
    )
    .unwrap();
    let named = diagnosis.effects.iter().map(|found| format!("{}@{}", found.effect, found.site)).collect();
    (diagnosis.verdict, named)
}

fn friction_on_one_leg() -> PlacedEffect {
    PlacedEffect { effect: find("coulomb_friction").unwrap(), site: "L2_pitch".to_owned(), values: vec![0.15] }
}

#[test]
fn friction_on_one_leg_is_found_from_a_standing_start() {
    let (verdict, named) = found(&[friction_on_one_leg()], Some(1.0));
    assert_eq!((verdict, named), (Verdict::EffectMissing, vec!["coulomb_friction@L2_pitch".to_owned()]));
}

#[test]
fn friction_on_one_leg_is_found_while_it_walks() {
    let (verdict, named) = found(&[friction_on_one_leg()], None);
    assert_eq!((verdict, named), (Verdict::EffectMissing, vec!["coulomb_friction@L2_pitch".to_owned()]));
}

#[test]
fn nothing_is_found_where_nothing_is_after_standing() {
    assert_eq!(found(&[], Some(1.0)), (Verdict::NothingMissing, Vec::new()));
}

#[test]
fn nothing_is_found_where_nothing_is_in_a_robot_just_put_there() {
    assert_eq!(found(&[], Some(0.0)), (Verdict::NothingMissing, Vec::new()));
}

#[test]
fn nothing_is_found_where_nothing_is_on_the_way() {
    assert_eq!(found(&[], None), (Verdict::NothingMissing, Vec::new()));
}

/// The root mean square of a family's residuals at a point, in noise floors.
fn error(model: &dyn ResidualModel, u: &[f64]) -> f64 {
    let logs = 0..model.description().logs.len();
    let all: Vec<f64> =
        logs.flat_map(|log| model.residual(ResidualRequest::of(u, log), TimeStep::USUAL).unwrap()).collect();
    let finite: Vec<f64> = all.into_iter().filter(|r| r.is_finite()).collect();
    (squares(&finite) / finite.len() as f64).sqrt()
}

#[test]
fn friction_tells_how_the_robot_came_to_where_its_log_begins() {
    let source = Source::new("ant.toml", MODEL);
    let mut model = Model { learn: 1, ..model(&source).unwrap() };
    model.scenarios = vec![scenario(&model, 0, true)];
    // It was put down as it is told, stood for a moment, and sagged as far as friction let it.
    let hidden = PlacedEffect { values: vec![0.8], ..friction_on_one_leg() };
    let (robot, mut effects, mut setup) = model.at(&model.simulations.nominal(), 0);
    effects.push(hidden);
    setup.rest_s = 0.5;
    let drive = model.scenarios[0].replay.clone().unwrap();
    let log = simulate(RolloutRequest::new(&robot, &drive).setup(&setup).effects(&effects).noise_seed(1)).unwrap();
    let read = |link: &Link| (log.values(&format!("q_{}", link.joint.name)).unwrap()[0], 0.0);
    model.scenarios[0].start = model.robot.movable().map(|(_, link)| read(link)).collect();
    let problem = IdentificationProblem::new(Arc::new(model), vec![log], &[]).unwrap();
    let mut truth = vec![0.0; problem.parameters().len()];
    let parameter =
        problem.parameters().iter().position(|parameter| parameter.name == "coulomb_friction.torque@L2_pitch").unwrap();
    truth[parameter] = problem.parameters()[parameter].coordinate(0.8);
    let blind = error(&problem, &truth);
    let told = problem.derive(&Derivation::WithStartsAt(truth.clone())).unwrap();
    let (seen, again) = (error(&*told, &truth), told.derive(&Derivation::WithStartsAt(truth.clone())));
    assert!(blind > 1.2 && seen < 1.05 && again.is_none(), "{blind} {seen}");
}

#[test]
fn where_feet_came_down_is_not_held_against_the_model() {
    let source = Source::new("ant.toml", MODEL);
    let mut model = Model { learn: 1, ..model(&source).unwrap() };
    model.scenarios = vec![scenario(&model, 0, true)];
    let (mut robot, effects, mut setup) = model.at(&model.simulations.nominal(), 0);
    setup.rest_s = 1.0;
    let told: Vec<f64> = model.scenarios[0].start.iter().map(|(q, _)| *q).collect();
    let by = |size: f64, k: usize| if k.is_multiple_of(2) { size } else { -size };
    for (k, link) in robot.links.iter_mut().filter(|link| link.joint.kind != JointKind::Fixed).enumerate() {
        link.joint.start = told[k] + by(0.02, k);
    }
    let drive = model.scenarios[0].replay.clone().unwrap();
    let log = simulate(RolloutRequest::new(&robot, &drive).setup(&setup).effects(&effects).noise_seed(1)).unwrap();
    // Where the joints were put down is read no better than sensors read, and feet hold on to it.
    model.scenarios[0].start = told.iter().enumerate().map(|(k, q)| (q + by(0.012, k), 0.0)).collect();
    let problem = IdentificationProblem::new(Arc::new(model), vec![log], &[]).unwrap();
    let truth = vec![0.0; problem.parameters().len()];
    let objective = Objective::at(&problem, &truth);
    let whitened = objective.residuals_of(std::slice::from_ref(&truth), &[0]).pop().unwrap().unwrap();
    let seen = (squares(&whitened) / objective.samples(LogSet::Learn) as f64).sqrt();
    let blind = error(&problem, &truth);
    assert!(blind > 1.2 && seen < 1.05, "{blind} {seen}");
}

#[test]
fn a_walk_that_grows_its_errors_is_compared_in_windows() {
    // Rapier's contacts make much of little: the same walk that is followed through the whole log otherwise.
    let is_chaotic = |engine: &str| {
        let text = MODEL.replace("[simulation]", &format!("[simulation]\nengine = \"{engine}\""));
        let source = Source::new("ant.toml", text);
        let mut model = Model { learn: 1, ..model(&source).unwrap() };
        model.scenarios = vec![scenario(&model, 0, true)];
        let (robot, effects, mut setup) = model.at(&model.simulations.nominal(), 0);
        setup.rest_s = 1.0;
        let drive = model.scenarios[0].replay.clone().unwrap();
        let log = simulate(RolloutRequest::new(&robot, &drive).setup(&setup).effects(&effects).noise_seed(1)).unwrap();
        IdentificationProblem::new(Arc::new(model), vec![log], &[]).unwrap().is_chaotic()
    };
    assert_eq!(["auto", "rapier"].map(is_chaotic), [false, true]);
}
