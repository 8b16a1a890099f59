//! `btr coevolve`: what it leaves behind, how it ends, how it goes on.

use crate::lab::{Lab, text};
use serde_json::Value;
use std::process::Command;
use std::time::{Duration, Instant};

/// A map of the small experiment's controllers.
const MAP: &str = "iterations = 5
method = \"quality_diversity\"
map = { generations = 5, population = 10, cells = 3, descriptors = { peak_speed = [0.0, 9.0], \"amplitude@*\" = [0.0, 1.0] } }
";

#[test]
fn a_run_leaves_its_results_and_tells_them_as_json() {
    let lab = Lab::new();
    let document = lab.json("coevolve small.toml --out run");
    assert_eq!(document["ok"], true);
    assert_eq!(document["stop_reason"], "iterations_done");
    assert_eq!(document["real_tests"], 4);
    assert!(document["simulated_evaluations"].as_u64().unwrap() > 100);
    let iterations = document["iterations"].as_array().unwrap();
    assert_eq!(iterations.len(), 2);
    for (k, it) in iterations.iter().enumerate() {
        assert_eq!(it["i"], k + 1);
        for key in ["fitness_sim", "fitness_real", "phi", "real_tests"] {
            assert!(it[key].is_number(), "{key}: {it}");
        }
        assert!(it["parameters"]["mass@bob"].is_number());
    }
    let error = document["revealed"]["error_percent"]["mass@bob"].as_f64().unwrap().abs();
    let before = document["revealed"]["error_percent_before"]["mass@bob"].as_f64().unwrap().abs();
    assert!(error < 0.2 * before, "{error} % from {before} %");

    for file in document["files"].as_array().unwrap() {
        assert!(lab.exists(file.as_str().unwrap()), "{file}");
    }
    let history: Value = serde_json::from_str(&lab.read("run/history.json")).unwrap();
    assert_eq!(history["iterations"], document["iterations"]);
    for k in 0..4 {
        let folder = format!("run/transfers/000{k}");
        assert!(
            ["trial.toml", "references.csv", "log.mcap"].iter().all(|name| lab.exists(&format!("{folder}/{name}")))
        );
    }
    // The adapted model is a model: it runs, with the estimates as its nominal values.
    let adapted: toml::Table = toml::from_str(&lab.read("run/adapted.toml")).unwrap();
    assert_eq!(adapted["parameters"]["mass@bob"]["value"].as_float(), iterations[1]["parameters"]["mass@bob"].as_f64());
    lab.ok("simulate run/adapted.toml -o adapted.csv");
}

#[test]
fn the_terminal_shows_the_same_story() {
    let lab = Lab::new();
    let told = lab.ok("coevolve small.toml --out run");
    for part in ["stopped: all iterations are done", "real tests: 4", "the hidden twin", "mass@bob", "run/history.json"]
    {
        assert!(told.contains(part), "{part} is missing in\n{told}");
    }
}

#[test]
fn a_map_of_controllers_is_made_tried_and_told() {
    let lab = Lab::with(&[("iterations = 2\n", MAP)]);
    let told = lab.ok("coevolve small.toml --out run");
    for part in ["the map of controllers", "f promised", "no controller of the map promises much more"] {
        assert!(told.contains(part), "{part} is missing in\n{told}");
    }
    let history: Value = serde_json::from_str(&lab.read("run/history.json")).unwrap();
    let (map, tests) = (&history["map"], history["tests"].as_array().unwrap());
    let elites = map["elites"].as_array().unwrap();
    assert_eq!((&map["cells"], map["filled"].as_u64()), (&9.into(), Some(elites.len() as u64)));
    assert_eq!(map["descriptors"].as_object().unwrap().keys().collect::<Vec<_>>(), ["peak_speed", "amplitude@*"]);
    let tried = elites.iter().filter(|elite| elite["real"].is_number()).count();
    assert_eq!((tried, history["real_tests"].as_u64()), (tests.len(), Some(tests.len() as u64)));
    assert!(tests.iter().all(|test| test["promised_ci95"].is_array()), "{tests:?}");
    // It ends where it began, with what it knew.
    assert_eq!(lab.ok("coevolve small.toml --out run --resume"), told);
}

#[test]
fn a_goal_that_is_missed_is_exit_code_1_and_one_that_is_reached_0() {
    let lab = Lab::new();
    lab.exits("coevolve small.toml --out missed --set coevolve.fitness_goal=1e9", 1);
    let told = lab.ok("coevolve small.toml --out reached --set coevolve.fitness_goal=-1.0");
    assert!(told.contains("stopped: the goal was reached"), "{told}");
}

#[test]
fn a_folder_in_use_and_another_experiment_are_refused() {
    let lab = Lab::new();
    lab.ok("coevolve small.toml --out run -q");
    let refused = "error: run already contains a run\nhelp: go on with --resume, or choose another --out\n";
    assert_eq!(lab.complaint("coevolve small.toml --out run"), refused);
    for change in ["--seed 2", "--set simulation.duration_s=0.6"] {
        let told = lab.complaint(&format!("coevolve small.toml --out run --resume {change}"));
        assert!(told.contains("the experiment differs from the one that run was started with"), "{told}");
        assert!(told.contains("help: resume with the file"), "{told}");
    }
    let told = lab.complaint("coevolve small.toml --out nowhere --resume");
    assert_eq!(told, "error: nowhere contains no run to resume\nhelp: start it without --resume\n");
}

#[test]
fn a_real_test_that_is_gone_is_named() {
    // A log is no simulation that could be run again.
    let lab = Lab::with(&[(
        "kind = \"twin\"\nparameters = { \"mass@bob\" = 1.3, \"viscous_friction.coefficient@hinge\" = 0.3 }",
        "kind = \"manual\"",
    )]);
    lab.ok("coevolve small.toml --out run -q");
    for k in 0..2 {
        let folder = format!("run/transfers/000{k}");
        lab.write("drive.toml", &format!("[drive]\nkind = \"replay\"\nlog = \"{folder}/references.csv\"\n"));
        lab.ok(&format!("simulate small.toml -q --drive drive.toml -o {folder}/log.csv"));
    }
    lab.ok("coevolve small.toml --out run -q --resume");
    std::fs::remove_file(lab.path("run/transfers/0001/log.csv")).unwrap();
    let told = lab.complaint("coevolve small.toml --out run -q --resume");
    assert!(told.contains("real test 1 is in the ledger but its log cannot be used"), "{told}");
    assert!(told.contains("help: put the log back into its folder under transfers/"), "{told}");
}

#[test]
fn ctrl_c_ends_with_130_and_says_how_to_go_on() {
    let lab = Lab::with(&[("iterations = 2", "iterations = 100000")]);
    let child = lab.start("coevolve small.toml --out run -q -j 1");
    let begun = Instant::now();
    while !lab.exists("run/checkpoint.bin") && begun.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(5));
    }
    let told = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(told.success());
    let output = child.wait_with_output().unwrap();
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(130), "{stderr}");
    assert!(stderr.contains("resume with: btr coevolve small.toml --out run --resume"), "{stderr}");
}

#[test]
fn misuse_of_the_command_line_is_exit_code_2() {
    let lab = Lab::new();
    for arguments in ["", "coevolve", "evolve small.toml", "coevolve small.toml --fast", "simulate small.toml"] {
        let output = lab.run(arguments);
        assert_eq!(output.status.code(), Some(2), "btr {arguments}");
        assert!(text(&output.stderr).contains("Usage"), "btr {arguments}");
    }
}

#[test]
fn errors_are_json_documents_too() {
    let lab = Lab::new();
    let document: Value = serde_json::from_str(&lab.exits("coevolve nothing.toml --json", 2)).unwrap();
    assert_eq!((&document["ok"], &document["error"]["code"]), (&false.into(), &"file".into()));
    assert!(document["error"]["message"].as_str().unwrap().starts_with("nothing.toml: "));
    assert!(document["error"]["help"].is_string());
}
