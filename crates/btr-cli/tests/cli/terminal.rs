//! What people see: the help, colours, what many logs have in common, and how an interrupt ends.

use crate::lab::{Lab, text};
use std::path::{Path, PathBuf};

fn robots() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots")
}

/// A lab with the arm and these of its logs.
fn arm(logs: &[&str]) -> Lab {
    let lab = Lab::new();
    let copy = |from: PathBuf, name: &str| std::fs::copy(from, lab.path(name)).unwrap();
    for name in ["arm.toml", "arm.urdf"] {
        copy(robots().join(name), name);
    }
    for log in logs {
        copy(robots().join("arm").join(log), log);
    }
    lab
}

#[test]
fn the_help_begins_with_what_people_come_for() {
    let lab = Lab::new();
    insta::assert_snapshot!("help", lab.ok("--help"));
    assert_eq!(lab.ok("--help"), lab.ok("-h"));
}

#[test]
fn options_are_hidden_or_refused_where_they_do_nothing() {
    let lab = Lab::new();
    let shown = |verb: &str, option: &str| lab.ok(&format!("{verb} --help")).contains(option);
    assert!(shown("coevolve", "--seed") && shown("fit", "--set") && !shown("fit", "--seed"));
    assert!(!shown("schema", "--json") && !shown("schema", "--set") && !shown("effects", "--threads"));
    assert!(lab.complaint("schema --seed 7").contains("`btr schema` does nothing with --seed"));
    assert!(lab.complaint("--set a=1 effects").contains("`btr effects` does nothing with --set"));
    let tip = lab.complaint("fit small.toml log.csv -o fitted.toml --overwrite");
    assert!(tip.contains("tip: not needed here: an output replaces an earlier one of its kind"), "{tip}");
    let tip = lab.complaint("compare small.toml log.csv --held-out other.csv");
    assert!(tip.contains("tip: leave it out: this verb takes all logs alike"), "{tip}");
}

#[test]
fn colours_are_for_terminals_and_for_those_who_want_them() {
    let lab = arm(&["learn_1.csv"]);
    let said = |variables: &[(&str, &str)]| {
        let mut command = lab.command("compare arm.toml learn_1.csv");
        command.env_remove("NO_COLOR").env_remove("CLICOLOR_FORCE").envs(variables.iter().copied());
        text(&command.output().unwrap().stdout)
    };
    assert!(!said(&[]).contains('\u{1b}'));
    assert!(said(&[("CLICOLOR_FORCE", "1")]).starts_with("\u{1b}[1myaw: "));
    assert!(!said(&[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")]).contains('\u{1b}'));
}

#[test]
fn what_many_logs_have_in_common_is_told_once() {
    let lab = arm(&["learn_1.csv", "learn_2.csv", "learn_3.csv"]);
    let check = "check arm.toml learn_1.csv learn_2.csv learn_3.csv";
    let said = lab.ok(check);
    assert_eq!(said.matches("record at least three steps").count(), 1, "{said}");
    insta::assert_snapshot!("check_many", said);
    assert!(lab.ok(&format!("{check} -v")).contains("learn_2.csv: fine\n  fine      401 samples"));
    let dead_times = &lab.json(check)["dead_times"];
    assert_eq!(dead_times["not_known"], serde_json::json!(["shoulder", "elbow"]), "{dead_times}");
}

#[test]
fn joints_in_degrees_are_told_once_with_the_lines_that_mend_it() {
    let lab = arm(&["learn_1.csv", "learn_2.csv"]);
    for log in ["learn_1.csv", "learn_2.csv"] {
        lab.edit(log, log, |row, cells| {
            let degrees = |cell: &mut String| *cell = cell.parse::<f64>().unwrap().to_degrees().to_string();
            cells.iter_mut().skip(1).filter(|_| row > 0).for_each(degrees);
            true
        });
    }
    let output = lab.run("check arm.toml learn_1.csv learn_2.csv");
    let said = text(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert_eq!(said.matches("degrees").count(), 1, "{said}");
    let (_, fix) = said.split_once("bad: all 3 joints look like degrees").unwrap();
    let fix = fix.split_once("[channels.channels]").unwrap().1.split("\n\n").next().unwrap();
    lab.write("mended.toml", &format!("{}\n[channels.channels]{fix}\n", lab.read("arm.toml")));
    let mended = lab.ok("check mended.toml learn_1.csv learn_2.csv");
    assert!(mended.starts_with("all 2 logs are fine"), "{mended}");
}

/// Not an interrupt: jobs in the background of a shell ignore those, and so does what they start.
#[test]
#[cfg(unix)]
fn a_diagnosis_that_is_stopped_says_how_to_go_on() {
    use std::io::{BufRead, BufReader};
    use std::process::{Command, Stdio};
    let lab = arm(&["learn_1.csv", "learn_2.csv"]);
    let mut command = lab.command("diagnose arm.toml learn_1.csv learn_2.csv");
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut told = BufReader::new(child.stderr.take().unwrap()).lines();
    assert!(told.any(|line| line.unwrap().contains("its parameters fitted")));
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    let rest: Vec<String> = told.map(Result::unwrap).collect();
    assert!(rest.iter().any(|line| line == "finishing with the best so far; press again to stop at once"), "{rest:?}");
    let output = child.wait_with_output().unwrap();
    let said = text(&output.stdout);
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(
        said.contains("\ncut short; so far: ") && said.contains("the search was stopped by an interrupt"),
        "{said}"
    );
    assert!(said.contains("\nnext: btr diagnose arm.toml learn_1.csv learn_2.csv --max-rollouts "), "{said}");
}
