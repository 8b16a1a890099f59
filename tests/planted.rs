//! The desk arm with logs of a robot in which something is planted: what a diagnosis should find is known.
#![allow(clippy::expect_used, reason = "for tests alone")]

use btr_core::log::{Log, Role};
use btr_identify::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use btr_identify::fit::Objective;
use btr_lab::experiment::{Source, model};
use btr_lab::identification::IdentificationProblem;
use btr_physics::drive::Replay;
use btr_physics::effects::PlacedEffect;
use btr_physics::model::parameter::Target;
use btr_physics::model::{Model, Scenario};
use btr_physics::rollout::{RolloutRequest, simulate};
use std::path::Path;
use std::sync::Arc;

/// What the robot has and the model lacks.
#[derive(Default)]
pub struct Planted {
    /// Effects.
    pub effects: Vec<PlacedEffect>,
    /// Values of the model by their names.
    pub values: Vec<(&'static str, f64)>,
}

/// The commands of an episode: two waves for each joint.
#[derive(Clone, Copy)]
pub struct Waves {
    /// Length in s.
    pub seconds: u32,
    /// Amplitude of the slower wave in rad.
    pub amplitude_rad: f64,
    /// Steps up and down every second, in rad.
    pub steps_rad: f64,
}

/// The desk arm with its text edited.
#[must_use]
pub fn arm(edited: impl Fn(&str) -> String) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../robots/arm.toml");
    let source = Source::read(&path).expect("the desk arm's model");
    let text = edited(&source.text);
    model(&Source { text, ..source }).expect("a model")
}

/// Commands that differ between episodes and joints.
fn scenario(model: &Model, episode: usize, waves: Waves) -> Scenario {
    let clock: Vec<f64> = (0..=waves.seconds * 100).map(|i| f64::from(i) * 0.01).collect();
    let mut commands = Log::new(clock.clone()).expect("a clock");
    for (k, (_, link)) in model.robot.movable().enumerate() {
        let rate = 2.0 + 1.3 * k as f64 + 0.7 * episode as f64;
        let steps = |t: f64| if (t + 0.005) % 2.0 < 1.0 { 0.0 } else { waves.steps_rad };
        let wave = |t: &f64| waves.amplitude_rad * (rate * t).sin() + 0.2 * (2.3 * rate * t).sin() + steps(*t);
        let name = format!("cmd_{}", link.joint.name);
        commands.insert(name, "rad", Role::Command, clock.iter().map(wave).collect()).expect("a channel");
    }
    Scenario {
        name: format!("episode {episode}"),
        replay: Some(Arc::new(Replay::new(&commands, &model.robot))),
        duration_s: f64::from(waves.seconds),
        ..Scenario::default()
    }
}

/// The model with logs of the robot: two episodes to learn from, one to judge on. The effects and values `without` are
/// no candidates.
#[must_use]
pub fn problem(model: Model, waves: Waves, planted: &Planted, without: &[&str]) -> IdentificationProblem {
    let mut model = Model { learn: 2, ..model };
    model.scenarios = (0..3).map(|episode| scenario(&model, episode, waves)).collect();
    let record = |episode: usize| {
        let (mut robot, mut effects, mut setup) = model.at(&model.simulations.nominal(), episode);
        for (name, value) in &planted.values {
            let target = Target::parse(name, &model.robot).expect("a value of the model");
            target.set(*value, &mut robot, &mut effects, &mut setup);
        }
        effects.extend_from_slice(&planted.effects);
        let drive = model.scenarios[episode].replay.clone().expect("commands");
        simulate(RolloutRequest::new(&robot, &drive).setup(&setup).effects(&effects).noise_seed(episode as u64))
            .expect("a rollout")
    };
    let logs = (0..3).map(record).collect();
    IdentificationProblem::new(Arc::new(model), logs, without).expect("a problem")
}

/// The diagnosis of a problem.
#[must_use]
pub fn diagnosis(problem: &IdentificationProblem) -> Diagnosis {
    diagnose(&mut Objective::new(problem), DiagnoseOptions::default(), &|_| {}).expect("a diagnosis")
}

/// What a diagnosis names, as `effect@site`.
#[must_use]
pub fn names(problem: &IdentificationProblem, diagnosis: &Diagnosis) -> Vec<String> {
    diagnosis.effects.iter().map(|found| problem.candidates()[found.candidate].name()).collect()
}
