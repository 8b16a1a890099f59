//! Models beside logs named by hand.
#![allow(clippy::unwrap_used, clippy::panic)]

use btr_core::family::Step;
use btr_core::world::Simulator;
use btr_physics::experiment::{self, Source};
use btr_physics::io::{self, Meta};
use std::path::{Path, PathBuf};

const MODEL: &str = r#"name = "swing"
[robot]
builtin = "pendulum"
length_m = 0.3
[actuators.hinge]
kind = "position"
kp = 10.0
kd = 0.2
[simulation]
control_s = 0.01
steps_per_control = 5
sample_every = 5
duration_s = 1.0
[noise]
position_rad = 0.001
[drive]
kind = "sine"
omega_rad_s = 6.0
set = { "amplitude@hinge" = 0.6, "phase@hinge" = 0.8 }
[parameters]
"mass@bob" = { relative = [0.5, 3.0] }
"#;

fn source(folder: &Path, text: &str) -> Source {
    Source { path: folder.join("swing.toml"), text: text.to_owned() }
}

/// Two logs of the same swing with other noise, in a folder.
fn recorded(folder: &Path) -> Vec<PathBuf> {
    let model = experiment::model(&source(folder, MODEL)).unwrap();
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let write = |(seed, name): (u64, &str)| {
        let path = folder.join(name);
        io::write_log(&path, &model.simulate(&s, &c, 0, Some(seed)).unwrap(), &Meta::default()).unwrap();
        path
    };
    [(1, "one.csv"), (2, "two.csv"), (3, "three.csv")].map(write).into()
}

#[test]
fn every_log_is_a_scenario_of_its_own_and_starts_between_its_readings() {
    let folder = tempfile::tempdir().unwrap();
    let logs = recorded(folder.path());
    let replays = experiment::replays(&source(folder.path(), MODEL), &logs[..2], &logs[2..]).unwrap();
    assert_eq!((replays.model.scenarios.len(), replays.model.learn, replays.logs.len()), (3, 2, 3));
    assert!(replays.warnings.is_empty(), "{:?}", replays.warnings);
    for (scenario, log) in replays.model.scenarios.iter().zip(&replays.logs) {
        // The drive begins at 0.6·sin(0.8), where the robot stands still.
        let (q, dq) = scenario.start[0];
        assert!((q - log.values("q_hinge").unwrap()[0]).abs() < 4e-3 && dq.abs() < 0.3, "{q} {dq}");
    }
}

#[test]
fn the_index_sets_what_it_knows_of_a_log() {
    let folder = tempfile::tempdir().unwrap();
    let logs = recorded(folder.path());
    std::fs::write(folder.path().join("index.csv"), "file,grams\none.csv,2000\nelsewhere/two.csv,500\n").unwrap();
    let text = format!(
        "{MODEL}[logs]\nindex = \"index.csv\"\ncolumns = {{ \"mass@bob\" = {{ column = \"grams\", factor = 0.001 }} }}\n"
    );
    let replays = experiment::replays(&source(folder.path(), &text), &logs, &[]).unwrap();
    let masses: Vec<Option<f64>> =
        replays.model.scenarios.iter().map(|s| s.settings.first().map(|(_, mass)| *mass)).collect();
    assert_eq!(masses, [Some(2.0), Some(0.5), None]);
    assert!(replays.warnings.len() == 1 && replays.warnings[0].contains("three.csv"), "{:?}", replays.warnings);
    let lone = experiment::model_replaying(&source(folder.path(), &text), &logs[1]).unwrap();
    assert_eq!(lone.scenarios[0].settings.first().map(|(_, mass)| *mass), Some(0.5));
    let wrong = text.replace("\"grams\"", "\"gram\"");
    let error = experiment::replays(&source(folder.path(), &wrong), &logs, &[]).err().unwrap();
    assert!(error.line > 0 && error.help.as_deref() == Some("did you mean `grams`?"), "{error} {:?}", error.help);
    let twice = experiment::replays(&source(folder.path(), MODEL), &logs, &logs[..1]).err().unwrap();
    assert!(twice.to_string().contains("held out"), "{twice}");
}

#[test]
fn half_the_step_gives_the_same_samples_more_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let logs = recorded(folder.path());
    let model = experiment::replays(&source(folder.path(), MODEL), &logs[..1], &[]).unwrap().model;
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let run = |step| model.simulate_in_steps(&s, &c, 0, None, step).unwrap();
    let (usual, halved) = (run(Step::USUAL), run(Step::USUAL.halved()));
    assert_eq!(usual.len(), halved.len());
    let change = usual.values("q_hinge").unwrap().iter().zip(halved.values("q_hinge").unwrap());
    let change = change.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(change > 0.0 && change < 0.01, "{change}");
}

/// Root mean square of a torque, and of what a model's differs from it, along the measured motion.
fn needed(folder: &Path, log: &Path, text: &str) -> (f64, f64) {
    let replays = experiment::replays(&source(folder, text), &[log.to_owned()], &[]).unwrap();
    let simulated = replays.model.rollout(&replays.model.simulations().nominal(), 0, &[], Step::USUAL).unwrap();
    let (said, measured) = (simulated.values("tau_hinge").unwrap(), replays.logs[0].values("tau_hinge").unwrap());
    let inner = 10..measured.len() - 10;
    let rms =
        |of: &dyn Fn(usize) -> f64| (inner.clone().map(|i| of(i).powi(2)).sum::<f64>() / inner.len() as f64).sqrt();
    (rms(&|i| measured[i]), rms(&|i| measured[i] - said[i]))
}

#[test]
fn a_prescribed_joint_weighs_what_it_carries_without_its_servo() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("swing.csv");
    let model = experiment::model(&source(folder.path(), MODEL)).unwrap();
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    io::write_log(&path, &model.simulate(&s, &c, 0, None).unwrap(), &Meta::default()).unwrap();
    let prescribed = MODEL.replace("kind = \"position\"\nkp = 10.0\nkd = 0.2", "kind = \"prescribed\"");
    let (torque, error) = needed(folder.path(), &path, &prescribed);
    assert!(error < 0.1 * torque, "{error} of {torque} N·m");
    let heavy = prescribed.replace("length_m = 0.3", "length_m = 0.3\nmass_kg = 1.5");
    let (torque, error) = needed(folder.path(), &path, &heavy);
    assert!(error > 0.3 * torque, "{error} of {torque} N·m");
}
