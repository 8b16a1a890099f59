//! Batches of logs of which some cannot be used: these are left out and told, unless nothing else remains.

use crate::freeze::{MODEL, planted};
use crate::lab::{Lab, text};
use serde_json::{Value, json};

/// A damaged file, what is wrong with it, and what to do.
const DAMAGED: [(&str, &str, &str); 6] = [
    ("cells.csv", "cells.csv:202: 2 cells, but the header has 3", "repair or remove that line"),
    ("empty.csv", "empty.csv: the file is empty", "record again"),
    ("clock.csv", "clock.csv:1: no time column", "name the time column"),
    ("slow.csv", "slow.csv: 10 s between two samples", "btr expects seconds"),
    ("foreign.csv", "foreign.csv", "[channels.channels] in the model file maps foreign names"),
    ("blind.csv", "blind.csv: nothing to compare with the model", "it needs a position q_<joint>"),
];

/// A model, two logs of it, a held-out one, and the damaged files.
fn lab() -> Lab {
    let lab = Lab::new();
    lab.write("swing.toml", MODEL);
    for (seed, log) in [(1, "a.csv"), (2, "b.csv"), (3, "held.csv")] {
        planted(&lab, "swing.toml", &format!("all_{log}"), seed, 1.3, 0.3);
        // The columns t, cmd_hinge, q_hinge.
        lab.edit(&format!("all_{log}"), log, |_, cells| {
            cells.truncate(3);
            true
        });
    }
    lab.edit("b.csv", "cells.csv", |row, cells| {
        cells.truncate(if row == 201 { 2 } else { 3 });
        true
    });
    lab.write("empty.csv", "");
    lab.write("clock.csv", &lab.read("b.csv").replacen("t,", "moment,", 1));
    lab.edit("b.csv", "slow.csv", |row, cells| {
        if row > 0 {
            cells[0] = (10 * row).to_string();
        }
        true
    });
    lab.write("foreign.csv", &lab.read("b.csv").replacen("q_hinge", "angle", 1));
    lab.edit("b.csv", "blind.csv", |row, cells| {
        if row > 0 {
            cells[2].clear();
        }
        true
    });
    lab
}

fn damaged() -> String {
    DAMAGED.map(|(file, ..)| file).join(" ")
}

/// The lines on stderr that tell what was left out.
fn left_out(lab: &Lab, arguments: &str, code: i32) -> Vec<String> {
    let output = lab.run(arguments);
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "btr {arguments}\n{stderr}");
    stderr.lines().filter(|line| line.starts_with("left out: ")).map(str::to_owned).collect()
}

fn must_tell_all(lines: &[String]) {
    assert_eq!(lines.len(), DAMAGED.len(), "{lines:#?}");
    for (line, (_, reason, remedy)) in lines.iter().zip(DAMAGED) {
        assert!(line.contains(reason) && line.contains(remedy), "{reason}: {line}");
    }
}

fn names(document: &Value) -> Vec<&str> {
    document["left_out"].as_array().unwrap().iter().map(|log| log["log"].as_str().unwrap()).collect()
}

#[test]
fn damaged_logs_are_left_out_of_a_batch_and_told() {
    let (lab, damaged) = (lab(), damaged());
    must_tell_all(&left_out(&lab, &format!("fit swing.toml a.csv {damaged} b.csv"), 0));
    must_tell_all(&left_out(&lab, &format!("compare swing.toml {damaged} a.csv"), 0));
    must_tell_all(&left_out(&lab, &format!("diagnose swing.toml {damaged} a.csv --max-rollouts 1"), 0));
    assert_eq!(left_out(&lab, &format!("fit swing.toml {damaged} a.csv -q"), 0), [""; 0], "-q says nothing");

    let (with, without) =
        (lab.json(&format!("fit swing.toml a.csv {damaged} b.csv")), lab.json("fit swing.toml a.csv b.csv"));
    assert_eq!(names(&with), DAMAGED.map(|(file, ..)| file));
    assert_eq!(with["left_out"][1], json!({ "log": "empty.csv", "reason": "empty.csv: the file is empty" }));
    for key in ["parameters", "train", "held_out", "doubts", "cost"] {
        assert_eq!(with[key], without[key], "{key}");
    }
    assert_eq!(without["left_out"], Value::Null);
    for verb in ["compare", "diagnose --max-rollouts 1"] {
        assert_eq!(names(&lab.json(&format!("{verb} swing.toml {damaged} a.csv"))).len(), DAMAGED.len(), "{verb}");
    }
    lab.ok(&format!("fit swing.toml a.csv {damaged} --add armature -q --report fit.html"));
    let page = lab.read("fit.html");
    assert!(page.contains("left out: empty.csv: the file is empty") && page.contains("swing.toml against a.csv, "));
}

#[test]
fn a_check_ends_with_1_if_a_log_was_left_out() {
    let lab = lab();
    assert_eq!(left_out(&lab, "check swing.toml a.csv b.csv", 0), [""; 0]);
    must_tell_all(&left_out(&lab, &format!("check swing.toml a.csv b.csv {}", damaged()), 1));
    let document: Value = serde_json::from_str(&lab.exits("check swing.toml a.csv empty.csv --json", 1)).unwrap();
    assert_eq!((names(&document), document["logs"].as_array().unwrap().len()), (vec!["empty.csv"], 1));
}

#[test]
fn a_damaged_log_is_an_error_if_nothing_else_remains_or_with_strict() {
    let lab = lab();
    for verb in ["check", "compare", "fit", "diagnose"] {
        let alone = lab.complaint(&format!("{verb} swing.toml cells.csv"));
        assert!(alone.starts_with("error: cells.csv:202: 2 cells") && alone.contains("help: repair"), "{alone}");
        assert_eq!(lab.complaint(&format!("{verb} swing.toml cells.csv empty.csv")), alone, "the first one is told");
        assert_eq!(lab.complaint(&format!("{verb} swing.toml a.csv cells.csv --strict")), alone);
    }
    let held_out = lab.complaint("fit swing.toml a.csv b.csv --held-out empty.csv");
    assert!(held_out.contains("error: empty.csv: the file is empty"), "{held_out}");
    let lines = left_out(&lab, "fit swing.toml a.csv cells.csv --held-out held.csv empty.csv", 0);
    assert_eq!(lines.len(), 2, "{lines:?}");
}

#[test]
fn a_path_that_is_wrong_is_an_error_whatever_else_there_is() {
    let lab = lab();
    let typo = lab.complaint("fit swing.toml a.csv bb.csv");
    assert!(typo.starts_with("error: bb.csv: No such file"), "{typo}");
    let model = lab.complaint("fit swing.toml a.csv swing.toml");
    assert!(model.contains("not a log format"), "{model}");
}
