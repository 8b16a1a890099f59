//! Models with logs that are named explicitly.
#![allow(clippy::unwrap_used, clippy::panic)]

use btr_core::log::{Log, Role};
use btr_core::world::Simulator;
use btr_identify::residual_model::TimeStep;
use btr_io::Meta;
use btr_lab::experiment;
use btr_lab::experiment::{LogSource, Source};
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
    Source::new(folder.join("swing.toml"), text)
}

/// Two logs of the same swing with other noise, in a folder.
fn recorded(folder: &Path) -> Vec<PathBuf> {
    let model = experiment::model(&source(folder, MODEL)).unwrap();
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let write = |(seed, name): (u64, &str)| {
        let path = folder.join(name);
        btr_io::write_log(
            &path,
            &model.simulate(model.request(&s, 0).controller(&c).noise_seed(seed)).unwrap(),
            &Meta::default(),
        )
        .unwrap();
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
    let lone = experiment::model_replaying(&source(folder.path(), &text), logs[1].clone()).unwrap();
    assert_eq!(lone.scenarios[0].settings.first().map(|(_, mass)| *mass), Some(0.5));
    let wrong = text.replace("\"grams\"", "\"gram\"");
    let error = experiment::replays(&source(folder.path(), &wrong), &logs, &[]).err().unwrap();
    assert!(error.line > 0 && error.help == Some("did you mean `grams`?".into()), "{error} {:?}", error.help);
    let twice = experiment::replays(&source(folder.path(), MODEL), &logs, &logs[..1]).err().unwrap();
    assert!(twice.to_string().contains("held out"), "{twice}");
}

#[test]
fn a_log_in_memory_is_read_under_the_names_of_the_model() {
    let folder = tempfile::tempdir().unwrap();
    let paths = recorded(folder.path());
    let (log, _) = btr_io::read_log(&paths[0], &btr_io::Mapping::default()).unwrap();
    let mut foreign = Log::new(log.clock_s().to_vec()).unwrap();
    for (ours, theirs) in [("cmd_hinge", "goal"), ("q_hinge", "encoder")] {
        let halves = log.values(ours).unwrap().iter().map(|value| 0.5 * value).collect();
        foreign.insert(theirs, "1", Role::Truth, halves).unwrap();
    }
    let mapped = "[channels.channels]\ncmd_hinge = { column = \"goal\", factor = 2.0 }\n\
                  q_hinge = { column = \"encoder\", factor = 2.0 }\n";
    let source = source(folder.path(), &format!("{MODEL}{mapped}"));
    let read = |log: Log| {
        let log = LogSource::InMemory { name: "log 1".into(), log };
        experiment::replays(&source, &[log], &[]).unwrap().recordings.learn.remove(0).log
    };
    let once = read(foreign);
    assert_eq!(once.values("q_hinge").unwrap(), log.values("q_hinge").unwrap());
    assert_eq!(once.channel("cmd_hinge").unwrap().role, Role::Command);
    assert!(read(once.clone()).is_same(&once) && read(log.clone()).is_same(&log.from_zero()));
}

#[test]
fn half_the_step_gives_the_same_samples_more_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let logs = recorded(folder.path());
    let model = experiment::replays(&source(folder.path(), MODEL), &logs[..1], &[]).unwrap().model;
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let run = |step| model.simulate(model.request(&s, 0).controller(&c).time_step(step)).unwrap();
    let (usual, halved) = (run(TimeStep::USUAL), run(TimeStep::USUAL.halved()));
    assert_eq!(usual.len(), halved.len());
    let change = usual.values("q_hinge").unwrap().iter().zip(halved.values("q_hinge").unwrap());
    let change = change.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(change > 0.0 && change < 0.01, "{change}");
}

/// Root mean square of a torque, and of what a model's differs from it, along the measured motion.
fn needed(folder: &Path, log: &Path, text: &str) -> (f64, f64) {
    let replays = experiment::replays(&source(folder, text), &[log.to_owned()], &[]).unwrap();
    let simulated = replays.model.simulate(replays.model.request(&replays.model.simulations().nominal(), 0)).unwrap();
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
    btr_io::write_log(&path, &model.simulate(model.request(&s, 0).controller(&c)).unwrap(), &Meta::default()).unwrap();
    let prescribed = MODEL.replace("kind = \"position\"\nkp = 10.0\nkd = 0.2", "kind = \"prescribed\"");
    let (torque, error) = needed(folder.path(), &path, &prescribed);
    assert!(error < 0.1 * torque, "{error} of {torque} N·m");
    let heavy = prescribed.replace("length_m = 0.3", "length_m = 0.3\nmass_kg = 1.5");
    let (torque, error) = needed(folder.path(), &path, &heavy);
    assert!(error > 0.3 * torque, "{error} of {torque} N·m");
}

/// A log of the swing in which some samples are changed or left out.
fn edited(folder: &Path, name: &str, change: impl Fn(usize, &mut Vec<String>) -> bool) -> PathBuf {
    let text = std::fs::read_to_string(&recorded(folder)[0]).unwrap();
    let rows = text.lines().enumerate().filter_map(|(k, line)| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        change(k, &mut cells).then(|| cells.join(","))
    });
    let path = folder.join(name);
    std::fs::write(&path, rows.collect::<Vec<_>>().join("\n")).unwrap();
    path
}

#[test]
fn the_last_command_is_held_over_lost_ones_and_torque_is_off_over_many() {
    let folder = tempfile::tempdir().unwrap();
    let commands = |from: usize, to: usize, as_text: &dyn Fn(&str) -> String| {
        let held = std::cell::RefCell::new(String::new());
        let path = edited(folder.path(), "edited.csv", |k, cells| {
            match (from..to).contains(&k) {
                true => cells[1] = as_text(&held.borrow()),
                false => held.borrow_mut().clone_from(&cells[1]),
            }
            true
        });
        let replays = experiment::replays(&source(folder.path(), MODEL), &[path], &[]).unwrap();
        let log = replays.model.simulate(replays.model.request(&replays.model.simulations().nominal(), 0)).unwrap();
        log.values("q_hinge").unwrap().to_vec()
    };
    let (empty, last) = (|_: &str| String::new(), |held: &str| held.to_owned());
    assert_eq!(commands(40, 45, &empty), commands(40, 45, &last));
    let (off, held) = (commands(40, 46, &empty), commands(40, 46, &last));
    assert!(off.iter().zip(&held).any(|(a, b)| (a - b).abs() > 1e-4));
}

#[test]
fn the_pieces_of_a_log_with_gaps_keep_its_time_and_what_is_known_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let text = MODEL.replace("duration_s = 1.0", "duration_s = 3.0");
    let model = experiment::model(&source(folder.path(), &text)).unwrap();
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let whole = model.simulate(model.request(&s, 0).controller(&c).noise_seed(1)).unwrap();
    let path = folder.path().join("whole.csv");
    btr_io::write_log(&path, &whole, &Meta::default()).unwrap();
    let kept = |k: usize| k == 0 || !(100..140).contains(&k) && !(150..190).contains(&k);
    let rows = std::fs::read_to_string(&path).unwrap();
    let rows: Vec<&str> = rows.lines().enumerate().filter(|(k, _)| kept(*k)).map(|(_, row)| row).collect();
    let gap = folder.path().join("gap.csv");
    std::fs::write(&gap, rows.join("\n")).unwrap();
    std::fs::write(folder.path().join("index.csv"), "file,grams\ngap.csv,2000\n").unwrap();
    let indexed = format!(
        "{text}[logs]\nindex = \"index.csv\"\ncolumns = {{ \"mass@bob\" = {{ column = \"grams\", factor = 0.001 }} }}\n"
    );
    let replays = experiment::replays(
        &source(folder.path(), &indexed),
        std::slice::from_ref(&gap),
        &[folder.path().join("whole.csv")],
    )
    .unwrap();
    let scenarios: Vec<_> = replays.model.scenarios.iter().map(|s| (s.name.as_str(), s.settings.len())).collect();
    assert_eq!(scenarios, [("gap from 0.0 s", 1), ("gap from 1.9 s", 1), ("whole", 0)]);
    assert_eq!((replays.model.learn, replays.logs.len(), replays.checked.len()), (2, 3, 2));
    assert!(replays.warnings.iter().any(|w| w.contains("10 samples between gaps from 1.390 s on: too short")));
    assert!(replays.logs[1].clock_s()[0].abs() < 1e-12 && (replays.model.scenarios[1].begins_s - 1.89).abs() < 1e-9);
    // A law that swings with time swings on after the gap as it does in the whole log.
    let swinging = format!(
        "{text}[[effects]]\neffect = \"formula\"\nsite = \"hinge\"\non = \"torque\"\nlaw = \"a*sin(9*t)\"\na = 2.0\n"
    );
    let swinging = source(folder.path(), &swinging);
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let swinging_model = experiment::model(&swinging).unwrap();
    let real = swinging_model.simulate(swinging_model.request(&s, 0).controller(&c).noise_seed(1)).unwrap();
    btr_io::write_log(&path, &real, &Meta::default()).unwrap();
    let rows = std::fs::read_to_string(&path).unwrap();
    let rows: Vec<&str> = rows.lines().enumerate().filter(|(k, _)| kept(*k)).map(|(_, row)| row).collect();
    std::fs::write(&gap, rows.join("\n")).unwrap();
    let replays = experiment::replays(&swinging, &[gap], &[]).unwrap();
    let again = replays.model.simulate(replays.model.request(&s, 1)).unwrap();
    let pairs = again.values("q_hinge").unwrap().iter().zip(replays.logs[1].values("q_hinge").unwrap());
    let furthest = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(furthest < 0.02, "{furthest}");
}
