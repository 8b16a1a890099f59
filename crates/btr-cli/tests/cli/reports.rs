//! Reports for people: `--report` of `compare`, `diagnose` and `fit`. That browsers draw them is asked in tests/python.

use crate::compare::{FRICTION, NONE, lab};
use crate::lab::{Lab, robots};
use serde_json::Value;

/// The page has all of this, is whole, and asks nobody for anything.
fn shows(html: &str, all: &[&str]) {
    all.iter().for_each(|text| assert!(html.contains(&format!(">{text}")), "no {text}"));
    assert!(html.contains("default-src 'none'") && html.contains("prefers-color-scheme"));
    assert!(!html.contains("NaN") && !html.contains("src="));
    let (page, scripts) = taken_apart(html);
    let [document, script] = &scripts[..] else { panic!("{} scripts", scripts.len()) };
    assert!(document.starts_with(" type=\"application/json\" id=\"motion-data\">{\"links\":[{"), "{document}");
    assert!(script.starts_with(">(() => {") && html.contains("; script-src 'sha256-"), "{script}");
    closes_what_it_opens(&page);
}

/// A page without its scripts, and these.
fn taken_apart(html: &str) -> (String, Vec<&str>) {
    let mut parts = html.split("<script");
    let mut page = parts.next().unwrap().to_owned();
    let mut scripts = Vec::new();
    for part in parts {
        let (script, rest) = part.split_once("</script>").unwrap();
        scripts.push(script);
        page += rest;
    }
    (page, scripts)
}

/// What the player of a page shows.
fn played(html: &str) -> Value {
    let (_, scripts) = taken_apart(html);
    serde_json::from_str(scripts[0].split_once('>').unwrap().1).unwrap()
}

/// Every tag is closed in its order.
fn closes_what_it_opens(html: &str) {
    let mut open: Vec<&str> = Vec::new();
    for tag in html.split('<').skip(1).filter(|tag| !tag.starts_with('!')) {
        let inside = tag.split('>').next().unwrap();
        let name = inside.trim_start_matches('/').split([' ', '/', '\n']).next().unwrap();
        match () {
            () if inside.starts_with('/') => assert_eq!(open.pop(), Some(name), "{tag}"),
            () if inside.ends_with('/') => {}
            () => open.push(name),
        }
    }
    assert!(open.is_empty(), "{open:?}");
}

#[test]
fn compare_draws_every_plot() {
    let lab = lab(FRICTION);
    lab.ok("compare swing.toml log.csv --report report.html -q");
    shows(
        &lab.read("report.html"),
        &[
            "hinge in log",
            "Residual in log",
            "Residual against velocity",
            "Residual against position",
            "Residual against load",
            "Residual around reversals",
            "Spectrum of the residual",
            "Autocorrelation of the residual",
            "By regime",
            "Over log",
        ],
    );
}

/// What `btr` writes into a report on the swing and its log, with these further arguments.
fn report(lab: &Lab, verb: &str, further: &str) -> String {
    lab.ok(&format!("{verb} swing.toml log.csv --report report.html -q {further}"));
    lab.read("report.html")
}

#[test]
fn diagnose_says_what_is_missing_and_shows_why() {
    let lab = lab(FRICTION);
    let html = report(&lab, "diagnose", "");
    shows(
        &html,
        &[
            "The model lacks coulomb_friction on hinge: with it, the error on the held-out logs falls from",
            "coulomb_friction.torque@hinge<",
            "Law: -torque",
            "The error, step by step<",
            "model as it stands<",
            "Round 1: the error with each candidate<",
            "coulomb_friction@hinge<",
            "before<",
            "after<",
            "after: hinge, throughout: 1.",
            "Residual against velocity<",
            "btr fit swing.toml log.csv --add coulomb_friction@hinge -o fitted.toml<",
            "q_hinge<",
        ],
    );
    // Wall time is nowhere in it.
    assert_eq!(html, report(&lab, "diagnose", "--threads 1"));
    // The next fit does not write over the model that it reads.
    lab.write("fitted.toml", &lab.read("swing.toml"));
    let next = lab.ok("diagnose fitted.toml log.csv -q");
    assert!(next.contains("--add coulomb_friction@hinge -o fitted_again.toml"), "{next}");
}

#[test]
fn diagnose_draws_the_evidence_that_candidates_lack() {
    let html = report(&lab(FRICTION), "diagnose", "");
    shows(&html, &["Round 1: the evidence behind that for the best<", "none of them<", "difference of delta BIC<"]);
    // Its name is the title of the document, and stands above it.
    let chart = html.split("Round 1: the evidence behind").nth(2).unwrap().split("</svg>").next().unwrap();
    assert!(chart.contains("coulomb_friction@hinge<") && chart.contains("(off the scale)<"), "{chart}");
}

#[test]
fn diagnose_says_that_nothing_is_missing() {
    let html = report(&lab(NONE), "diagnose", "");
    shows(&html, &["Nothing is missing: the error on the held-out logs is", "No effect was fitted"]);
}

#[test]
fn fit_shows_each_value_between_its_bounds_or_why_there_is_no_interval() {
    let found = report(&lab(FRICTION), "fit", "--add coulomb_friction@hinge");
    let plots = [
        "The error, step by step<",
        "Each value between its bounds<",
        "coulomb_friction.torque@hinge<",
        "upper bound<",
    ];
    shows(&found, &plots);
    assert!(found.contains("what remains is noise") && !found.contains("withheld"), "{found}");
    let wrong = report(&lab(FRICTION), "fit", "--add parallel_spring@hinge");
    shows(&wrong, &["No intervals: the error is still"]);
    assert!(wrong.contains("(withheld)") || wrong.contains("(at its bound)"), "{wrong}");
}

#[test]
fn a_run_ends_with_where_its_files_are_and_a_fitted_model_says_what_holds_in_it() {
    let lab = lab(FRICTION);
    assert!(lab.ok("compare swing.toml log.csv --report where.html").ends_with("\nwhere.html: the report\n"));
    let fit = "fit swing.toml log.csv --add coulomb_friction@hinge";
    assert!(lab.ok(fit).ends_with("not saved: give -o FILE\n"));
    lab.write("swing.toml", &format!("#:schema no.schema.json\n{}", lab.read("swing.toml")));
    let told = lab.ok(&format!("{fit} -o fitted.toml --report fit.html"));
    assert!(told.ends_with("\nfitted.toml: the fitted model\n\nfit.html: the report\n"), "{told}");
    let fitted = lab.read("fitted.toml");
    let wins = "# As fitted: a value here wins over the same one in another section, and is where the next fit begins.\n\
                [parameters]\n";
    let begins = "# Written by btr: another output may replace this file.\nname = \"swing\"\n";
    assert!(fitted.starts_with(begins) && fitted.contains(wins), "{fitted}");
    lab.ok("fit fitted.toml log.csv -o again.toml");
    assert_eq!(lab.read("again.toml").matches("As fitted").count(), 1);
}

#[test]
fn the_player_has_the_states_of_the_model_that_a_verb_knows() {
    let states = |html: &str| -> Vec<(String, bool)> {
        let document = played(html);
        let state = |state: &Value| (state["name"].as_str().unwrap().to_owned(), state["error"].is_string());
        document["states"].as_array().unwrap().iter().map(state).collect()
    };
    let named =
        |names: &[&str]| -> Vec<(String, bool)> { names.iter().map(|name| ((*name).to_owned(), true)).collect() };
    let with_friction = lab(FRICTION);
    assert_eq!(states(&report(&with_friction, "compare", "")), [("as it stands".to_owned(), false)]);
    let fitted = report(&with_friction, "fit", "--add coulomb_friction@hinge");
    assert_eq!(states(&fitted), named(&["as it stands", "fitted, with coulomb_friction@hinge"]));
    let found = report(&with_friction, "diagnose", "");
    assert_eq!(states(&found), named(&["as it stands", "+ coulomb_friction@hinge"]));
}

#[test]
fn a_run_has_a_page_with_its_tests_its_parameters_and_its_best_test_before_and_after() {
    let lab = Lab::new();
    let run = lab.json("coevolve small.toml --out run");
    let html = lab.read("run/report.html");
    shows(
        &html,
        &["Distance to reality<", "mass@bob<", "hinge, real − simulated after<", "error % at first<", "f promised<"],
    );
    assert_eq!(html.matches("<td>done</td>").count(), run["real_tests"].as_u64().unwrap() as usize);
    let played = played(&html);
    assert_eq!((&played["states"][0]["name"], &played["states"][1]["name"]), (&"before".into(), &"after".into()));
    assert!(played["logs"][0]["name"].as_str().unwrap().starts_with("real test "));
    let files = run["files"].as_array().unwrap();
    assert!(files.iter().any(|file| file.as_str().unwrap().ends_with("report.html")), "{files:?}");
}

#[test]
fn the_player_says_what_was_not_measured_and_where_replays_start_anew() {
    let lab = Lab::new();
    let ant = robots().join("ant.toml");
    let ant = ant.display();
    lab.ok(&format!("simulate {ant} --seed 1 -q -o walk.csv"));
    // From the middle of a step on, without the pose of the body.
    let walk = lab.read("walk.csv");
    let rows: Vec<Vec<&str>> = walk.lines().map(|line| line.split(',').collect()).collect();
    let kept = |k: &usize| !rows[0][*k].starts_with("base_");
    let line = |row: &Vec<&str>| (0..row.len()).filter(kept).map(|k| row[k]).collect::<Vec<_>>().join(",") + "\n";
    let walk: String = rows.iter().take(1).chain(rows.iter().skip(40)).map(line).collect();
    lab.write("walk.csv", &walk);
    lab.ok(&format!("fit {ant} walk.csv --report report.html -q"));
    let html = lab.read("report.html");
    assert!(html.contains("The pose of the base was not measured in every log: there it is the model's."));
    assert!(html.contains("The replay starts anew from the measured state in every window of a log."));
}

#[test]
fn a_log_is_played_under_its_name_whatever_that_is() {
    let lab = lab(FRICTION);
    let name = "<script>alert(1)<.csv";
    lab.write(name, &lab.read("log.csv"));
    lab.ok(&format!("compare swing.toml {name} --report report.html -q"));
    let html = lab.read("report.html");
    shows(&html, &[]);
    assert!(html.contains(r#""name":"\u003cscript\u003ealert(1)\u003c","#), "{html}");
}

#[test]
fn a_report_that_cannot_be_written_is_an_error() {
    let lab = lab(NONE);
    assert!(
        lab.complaint("fit swing.toml log.csv --add coulomb_friction@hinge --report no/such/folder.html")
            .contains("folder.html")
    );
}
