//! A robot with contact: what is planted in one of its legs is found in windows of its logs.
#![allow(clippy::unwrap_used)]

use btr_core::diagnose::{Question, Verdict, diagnose};
use btr_core::fit::Bench;
use btr_core::log::{Log, Role};
use btr_physics::ant;
use btr_physics::beside::Beside;
use btr_physics::drive::{Drive, Replay};
use btr_physics::effect::{EFFECTS, Placed, find};
use btr_physics::experiment::{Source, model};
use btr_physics::model::{Model, Scenario};
use btr_physics::sim;
use std::path::PathBuf;
use std::sync::Arc;

const MODEL: &str = r#"
name = "ant"
[robot]
builtin = "ant"
[simulation]
control_s = 0.01
steps_per_control = 2
sample_every = 2
[noise]
position_rad = 0.0005
gyro_rad_s = 0.01
[parameters]
"mass@trunk" = { relative = [0.75, 1.33] }
"#;

/// A tripod gait of its own in each episode.
fn scenario(model: &Model, episode: usize) -> Scenario {
    let clock: Vec<f64> = (0..=140).map(|i| f64::from(i) * 0.01).collect();
    let mut gait = ant::tripod();
    gait.omega_rad_s *= 0.8 + 0.2 * episode as f64;
    let mut told = Log::new(clock.clone()).unwrap();
    let mut command = vec![0.0; ant::centres().len()];
    for (joint, (_, link)) in model.robot.movable().enumerate() {
        let mut at = |t: f64| {
            gait.command(t, &mut command);
            command[joint]
        };
        let row = clock.iter().map(|&t| at(t)).collect();
        told.insert(format!("cmd_{}", link.joint.name), "rad", Role::Command, row).unwrap();
    }
    let replay = Some(Arc::new(Replay::new(&told, &model.robot)));
    Scenario { name: format!("episode {episode}"), replay, duration_s: 1.4, ..Scenario::default() }
}

/// What is found where `hidden` is, among friction on any joint.
fn found(hidden: &[Placed]) -> (Verdict, Vec<String>) {
    let source = Source { path: PathBuf::from("ant.toml"), text: MODEL.to_owned() };
    let mut model = Model { learn: 1, ..model(&source).unwrap() };
    model.scenarios = (0..2).map(|episode| scenario(&model, episode)).collect();
    let heavier: Vec<f64> = model.simulations.nominal().iter().map(|mass| 1.1 * mass).collect();
    let record = |episode: usize| {
        let (robot, mut effects, mut setup) = model.at(&heavier, episode);
        effects.extend_from_slice(hidden);
        setup.dt_s /= 2.0;
        let drive = model.scenarios[episode].replay.clone().unwrap();
        sim::simulate(&robot, &effects, &setup, &drive, Some(episode as u64)).unwrap()
    };
    let logs = (0..2).map(record).collect();
    let names = EFFECTS.iter().map(|effect| effect.card().name);
    let without: Vec<&str> = names.filter(|name| *name != "coulomb_friction").collect();
    let beside = Beside::new(Arc::new(model), logs, &without).unwrap();
    let diagnosis =
        diagnose(&Bench::new(&beside), Question { max_effects: 1, ..Question::default() }, &|_| ()).unwrap();
    let named = diagnosis.effects.iter().map(|found| format!("{}@{}", found.effect, found.site)).collect();
    (diagnosis.verdict, named)
}

#[test]
#[ignore = "a minute or more of simulated contact"]
fn friction_on_one_leg_is_found_while_it_walks() {
    let effect = find("coulomb_friction").unwrap();
    let placed = Placed { effect, site: "L2_pitch".to_owned(), values: vec![0.15] };
    let (verdict, named) = found(&[placed]);
    assert_eq!((verdict, named), (Verdict::EffectMissing, vec!["coulomb_friction@L2_pitch".to_owned()]));
}

#[test]
fn nothing_is_found_where_nothing_is() {
    assert_eq!(found(&[]), (Verdict::NothingMissing, Vec::new()));
}
